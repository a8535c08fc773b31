"""A filter on the log of a real glider: mass and drag from depth, pitch and the pump, beside the speed of its DVL.

The log is data/gliderflight_data.npy (MIT) of https://github.com/smerckel/gliderflight: four hours of the Slocum glider
"comet" in the Baltic, June 2016, of which the DVL was processed by its author. It is not part of this library.

Run as: python docs/figures/glider_log.py PATH/TO/gliderflight_data.npy; it writes docs/figures/glider_log.png.
Source: L. Merckelbach, A. Berger, G. Krahmann, M. Dengler, J. R. Carpenter, *A dynamic flight model for Slocum gliders
and implications for turbulence microstructure measurements*, J. Atmos. Oceanic Technol. 36 (2019), 281-296.
"""

import sys
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.optimize import brentq

import coadjoint as co
from coadjoint.estimation import Filter, Measurement, ModelProcess, RandomWalk
from coadjoint.plotting import style
from coadjoint_vehicles.parts import Ballast, LiftingBody
from coadjoint_vehicles.water import DensityTable, Sea

RHO, VOLUME, COMPRESSIBILITY = 1004.0, 70 / 1004.0, 5e-10
"""kg/m³, m³ and 1/Pa of the hull, as the source has them."""
AREA = 0.5 * RHO * 0.1
"""½ρS with its S = 0.1 m², to which its coefficients refer."""
LIFT, INDUCED = 3.73 + 3.8, 10.5
"""Slope of the lift of wings and hull, and the drag by the angle of attack, per rad and rad²."""
GROUPS = ((1215.0, 3760.0), (4230.0, 6830.0), (7520.0, 10090.0), (10620.0, 13190.0))
"""s; four dives each, between which the glider does not stay at the surface."""
SHALLOW = 2.0
"""m; a group begins and ends below."""


class Log(NamedTuple):
    """Times (K,) s, depth m, pitch rad, the pump's volume m³, the speed by the DVL, m/s, NaN where it is not known."""

    t: np.ndarray
    depth: np.ndarray
    pitch: np.ndarray
    pump: np.ndarray
    speed: np.ndarray


def read(path: Any) -> tuple[Log, DensityTable]:
    """The log, and the median density of each metre. The pump's volume has what pressure takes from the hull."""
    t, bar, pitch, pumped, density, speed = np.load(path, allow_pickle=False)
    depth = 1e5 * bar / (density.mean() * 9.81)
    edges = np.unique(np.floor(depth[depth >= 0]))
    rows = [np.median(density[(depth >= edge) & (depth < edge + 1)]) for edge in edges]
    pump = 1e-6 * pumped - VOLUME * COMPRESSIBILITY * 1e5 * bar
    return Log(t - t[0], depth, pitch, pump, speed), DensityTable(edges + 0.5, rows)


def craft(density: DensityTable, mass: float = 70.0, drag: float = 0.15) -> co.vehicles.Craft:
    """The glider, with the drag coefficient Cd0; added mass of the source, moments of inertia of its size."""
    hull = LiftingBody(
        "hull", drag=(AREA * drag, AREA * INDUCED), lift=(0.0, AREA * LIFT), pitch=(0.0, -60.0, -60.0), side=-20.0,
        roll=(0.0, -20.0), yaw=(60.0, -20.0),
    )  # fmt: skip
    pump = Ballast("pump", position=(0, 0, 0), low=-1e-3, high=1e-3, rate=1e-3)
    vehicle = co.vehicles.Vehicle(
        name="comet", mass=mass, volume=VOLUME, fluid_density=RHO, inertia=[1.0, 12.0, 12.0], length=1.8,
        added_mass=[14.0, 68.6, 68.6, 0, 0, 0], center_of_mass=(0, 0, 0.005), parts=(hull, pump),
    )  # fmt: skip
    return co.vehicles.Craft(vehicle, water=Sea(density=density))


class Result(NamedTuple):
    """What a filter found of a group: its log, the speed (K,), mass and Cd0 with their deviations at the nodes t."""

    log: Log
    speed: np.ndarray
    nis: np.ndarray
    t: np.ndarray
    mass: np.ndarray
    drag: np.ndarray


def filtered(log: Log, density: DensityTable, group: tuple[float, float], force: float, known: Any = None) -> Result:
    """The filter over a group of dives. force: N √s. known: (mass, Cd0), by default sought from (70.0, 0.15).

    The shift of the battery, by which the glider pitches, is a centre of mass that walks: the log does not have it.
    """
    inside = np.flatnonzero((log.t > group[0]) & (log.t < group[1]) & (log.depth > SHALLOW))
    log = Log(*(part[inside[0] : inside[-1] + 1] for part in log))
    log = log._replace(t=log.t - log.t[0])
    one = craft(density, *(known or ()))
    start = one.start(position=(0, 0, log.depth[0]), velocity=(0.3, 0, 0.03), euler_zyx=(0, log.pitch[0], 0))
    drifting = {"center_of_mass": RandomWalk([2e-3, 0, 0])}
    spread = {"g": [0, 0.01, 0], "q": [0, 0, 0.05], "xi": [0, 0.05, 0], "nu": [0.05, 0, 0.02]}
    spread["center_of_mass"] = [0.01, 0, 0]
    if known is None:
        drifting |= {"mass": RandomWalk(), "hull.drag": RandomWalk()}
        spread |= {"mass": 0.1, "hull.drag": [0.04 * AREA, 0.0]}
    process = ModelProcess(
        one.system, start, inputs={"pump": log.pump[0]}, drifting=drifting,
        noise={"torque": [0, 0.3, 0], "force": [force, 0, force]},
    )  # fmt: skip
    seen = {
        "depth": Measurement(lambda motion: motion.q[2], 0.05**2),
        "pitch": Measurement(lambda motion: jnp.arcsin(-motion.g[2, 0]), 0.005**2),
    }
    filter = Filter(process, start, measurements=seen, deviations=spread)
    found = filter.run(
        {"depth": (log.t, log.depth), "pitch": (log.t, log.pitch)}, dt=1.0, inputs={"pump": (log.t, log.pump)}
    )
    speed = np.interp(log.t, found.t, np.linalg.norm(found.states.nu, axis=1))
    theta = np.stack([found.rows[:, -3:], found.deviations[:, -3:]], axis=1)
    return Result(log, speed, found.nis["depth"].nis, found.t, theta[..., 0], theta[..., 1] / AREA)


def off(result: Result) -> np.ndarray:
    """Speed of the model less that of the DVL, between 13 and 37 m; 0.2 m/s and more are errors of the DVL."""
    log = result.log
    found = (result.speed - log.speed)[np.isfinite(log.speed) & (log.depth > 13) & (log.depth < 37)]
    return found[np.abs(found) < 0.2]


def steady(log: Log, density: DensityTable, mass: float = 70.1) -> tuple[float, float, float]:
    """Means over the glides between 13 and 37 m: |pitch|, rad; |weight − buoyancy|, N; speed by the DVL, m/s."""
    steep = np.abs(log.pitch) > np.radians(15)
    glides = steep & np.isfinite(log.speed) & (log.depth > 13) & (log.depth < 37)
    water = np.interp(log.depth[glides], np.asarray(density.depths), np.asarray(density.densities))
    net = 9.81 * (mass - water * (VOLUME + log.pump[glides]))
    return float(np.abs(log.pitch[glides]).mean()), float(np.abs(net).mean()), float(log.speed[glides].mean())


def glide(pitch: float, net: float, drag: float, induced: float, lift: float) -> float:
    """The speed at which D = (K_D0 + K_D α²)V² and L = K_L α V² carry a net weight, on a path steeper by α, m/s."""
    attack = brentq(lambda a: drag + induced * a**2 - lift * a * np.tan(pitch + a), 1e-4, 0.5)
    return float(np.sqrt(net * np.sin(pitch + attack) / (drag + induced * attack**2)))


def figure(result: Result):
    """Depth, the speed beside that of the DVL, and mass and drag as they are found."""
    fig = style.canvas(style.PAGE, 3.4)
    axes = fig.subplots(2, 2, sharex=True)
    log, minutes = result.log, result.log.t / 60
    axes[0, 0].plot(minutes, log.depth)
    axes[0, 0].invert_yaxis()
    axes[0, 0].set(ylabel="depth (m)")
    axes[1, 0].plot(minutes, result.speed, label="model, by depth and pitch", linewidth=0.8)
    axes[1, 0].plot(minutes, log.speed, label="DVL, not told to the filter", linewidth=0.8)
    axes[1, 0].set(xlabel="time (min)", ylabel="speed (m/s)", ylim=(0.1, 0.6))
    axes[1, 0].legend(fontsize=7)
    for ax, value, label in ((axes[0, 1], result.mass, "mass (kg)"), (axes[1, 1], result.drag, "drag coefficient")):
        ax.plot(result.t / 60, value[:, 0])
        ax.fill_between(result.t / 60, value[:, 0] - 2 * value[:, 1], value[:, 0] + 2 * value[:, 1], alpha=0.3)
        ax.set(ylabel=label, ylim=(value[-1, 0] * 0.999, value[-1, 0] * 1.001) if ax is axes[0, 1] else (0.1, 0.22))
    axes[1, 1].set(xlabel="time (min)")
    return fig


def main(path: Any) -> None:
    """Print what is found, and write the figure."""
    log, density = read(path)
    pitch, net, speed = steady(log, density)
    hull: Any = co.vehicles.load("slocum_graver").part("hull")
    own, shipped = (AREA * 0.16, AREA * INDUCED, AREA * LIFT), (*hull.drag, hull.lift[1])
    print(f"Glides: pitch {np.degrees(pitch):.1f}°, net weight {net:.2f} N, {speed:.3f} m/s by the DVL,")
    print(
        f"  {glide(pitch, net, *own):.3f} by the coefficients here, {glide(pitch, net, *shipped):.3f} by slocum_graver"
    )
    for force in (0.05, 0.1, 0.2):
        one = filtered(log, density, GROUPS[0], force)
        deep = one.nis[one.log.depth > 5]
        print(f"Force {force} N √s: mass {one.mass[-1, 0]:.4f} ± {one.mass[-1, 1]:.4f} kg, Cd0 {one.drag[-1, 0]:.4f} ±")
        print(f"  {one.drag[-1, 1]:.4f}; NIS of the depth {one.nis.mean():.2f}, deeper than 5 m {deep.mean():.2f};")
        print(f"  speed less that of the DVL: mean {off(one).mean():.4f}, RMS {np.std(off(one)):.4f} about it, m/s")
        known = one.mass[-1, 0], one.drag[-1, 0]
        others = [off(filtered(log, density, group, force, known)) for group in GROUPS[1:]]
        print("  the other groups with these: " + ", ".join(f"{e.mean():.4f} and {np.std(e):.4f}" for e in others))
    style.save(figure(one), Path(__file__).parent / "glider_log.png")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("Give the path of gliderflight_data.npy; where it is from stands at the top of this script.")
    main(sys.argv[1])
