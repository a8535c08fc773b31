"""The figures of the page on actuators: the curve of a thruster, and a glider's sawtooth.

Run as: python docs/figures/actuators.py; it writes thruster_curve.png and glider_sawtooth.png beside itself.
"""

from pathlib import Path

import numpy as np

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.plotting import style
from coadjoint_vehicles import Craft
from coadjoint_vehicles.parts import T200, Thrusters
from coadjoint_vehicles.trim import SteadyFlight, trim

HERE = Path(__file__).parent


def thruster() -> None:
    """The T200 at 16 V: rows, lines, dead band, and the command for a force."""
    part = Thrusters("thrusters", "T200", positions=[[0, 0, 0]], directions=[[1, 0, 0]], unit="µs")
    own = part.nominal
    figure = style.canvas(style.PAGE, 2.6)
    curve, inverse = figure.subplots(1, 2)
    u = np.linspace(1080, 1920, 500)
    curve.plot(u, evaluate(part.thrusts, u, own), color=style.COLOURS[0])
    curve.plot(T200.commands, T200.forces, "o", color=style.COLOURS[1], markersize=3, label="rows of the table")
    curve.axvspan(1472, 1528, color="#dddddd", label="dead band")
    curve.set(xlabel="pulse width [µs]", ylabel="thrust at bollard [N]")
    curve.legend(loc="upper left")
    F = np.linspace(-40, 52, 2001)
    inverse.plot(F, evaluate(part.commands_for, F, own), color=style.COLOURS[2])
    inverse.set(xlabel="wanted thrust [N]", ylabel="command [µs]")
    figure.savefig(HERE / "thruster_curve.png", dpi=150)


def glider() -> None:
    """An hour of a Slocum-like glider, beside the closed form of its steady glides."""
    vehicle = vehicles.load("slocum_graver")
    craft = Craft(vehicle, controller=vehicle.controller)
    start = craft.start(position=(0, 0, 4), velocity=(0.1, 0, 0))
    depths = {"shallow": co.Held([0.0], [5.0]), "deep": co.Held([0.0], [50.0])}
    made = co.simulate(craft.system, start, dt=0.05, duration=3600, inputs=depths, save_every=20).dataset
    glide = trim(vehicle, SteadyFlight(vehicle, climb=np.radians(-25)).at(0.3))
    figure = style.canvas(style.PAGE, 3.6)
    (track, angle), (mass, volume) = figure.subplots(2, 2)
    minutes = made.time.values / 60
    track.plot(made.q[:, 0], made.q[:, 2], color=style.COLOURS[0])
    track.set(xlabel="north [m]", ylabel="depth [m]")
    track.invert_yaxis()
    angle.plot(minutes, np.degrees(made.euler_angles[:, 1]), color=style.COLOURS[1])
    for sign in (1, -1):
        angle.axhline(sign * np.degrees(glide.pitch), color="black", linewidth=0.6, linestyle=style.DASHES[2], zorder=3)
    angle.set(xlabel="time [min]", ylabel="pitch [°]")
    mass.plot(minutes, 1e3 * made.internal_battery_position, color=style.COLOURS[2])
    mass.set(xlabel="time [min]", ylabel="moving mass [mm]")
    volume.plot(minutes, 1e6 * made.internal_pump, color=style.COLOURS[3])
    volume.set(xlabel="time [min]", ylabel="ballast [cm³]")
    figure.savefig(HERE / "glider_sawtooth.png", dpi=150)


if __name__ == "__main__":
    with style.style():
        thruster()
        glider()
