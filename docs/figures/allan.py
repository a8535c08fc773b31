"""The figure of the page on sensors: Allan deviations of the inertial unit of REMUS 100 and of a tactical one, at rest.

Run as: python docs/figures/allan.py; it writes docs/figures/allan.png.
"""

from pathlib import Path

import numpy as np

import coadjoint as co
from coadjoint.plotting import style
from coadjoint_vehicles.sensors import Errors, Imu, Noise, allan_deviation, expected_allan_deviation

TACTICAL = Imu(
    name="tactical",
    rate=20,
    gyroscope=Errors(noise_density=np.radians(0.125) / 60, bias_instability=np.radians(0.3) / 3600, bias_time=200.0),
    accelerometer=Errors(noise_density=0.065 * 0.3048 / 60, bias_instability=5e-5 * 9.80665, bias_time=200.0),
)
"""Noise densities of the Honeywell HG1700; bias instabilities typical of such units."""
READINGS = 200_000


def draw():
    """Both channels of both units, simulated and by the formula of their data sheets."""
    figure = style.canvas(style.PAGE, 2.9)
    panels = figure.subplots(1, 2)
    unit = co.vehicles.load("remus_100").sensor("imu")
    for colour, (label, imu) in zip(style.COLOURS, {"remus_100": unit, "HG1700": TACTICAL}.items(), strict=False):
        rest = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, -9.81], (READINGS, 1))
        values, rate = Noise(imu, seed=1).read(rest).values, float(imu.rate)
        times = np.geomspace(1 / rate, READINGS / rate / 8, 25)
        times = np.unique(np.round(times * rate)) / rate
        found = allan_deviation(values, rate, times)
        for axes, channel, here in zip(panels, imu.channels, (slice(0, 3), slice(3, 6)), strict=True):
            expected = expected_allan_deviation(imu.errors(channel), channel, rate, times)
            axes.plot(times, np.sqrt(np.mean(found[:, here] ** 2, axis=1)), ".", color=colour)
            axes.plot(times, expected[:, 0], color=colour, label=label)
    for axes, label in zip(panels, ("σ of angular velocity (rad/s)", "σ of specific force (m/s²)"), strict=True):
        axes.set(xscale="log", yscale="log", xlabel="averaging time τ (s)", ylabel=label)
        axes.legend()
    return figure


if __name__ == "__main__":
    style.save(draw(), Path(__file__).parent / "allan.png")
