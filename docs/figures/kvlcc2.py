"""A tanker by the MMG standard method, and its turning circles and zigzags next to those that MARIN measured.

The ship is KVLCC2 by the coefficients of its model of 7 m (Yasukawa and Yoshimura, Introduction of MMG standard
method for ship maneuvering predictions, J. Mar. Sci. Technol. 20, 2015, 37-52), as ShipMMG (MIT, commit b004dab) has
them; C_1, C_2 and x'_P of the wake are those of wPCC_pipeline. The part `Mmg` is written on the public interface. The
measured tracks are those of MARIN's free-running model of that length for the workshop SIMMAN 2008, scaled to 320 m:
data/01_raw/kvlcc2 of https://github.com/martinlarsalbert/wPCC_pipeline, commit be1c14f, which states no licence. They
are not part of this library.

Run as: python docs/figures/kvlcc2.py [FOLDER]; it prints the table of docs/validation.md and, with the folder of the
measured tracks, writes docs/figures/kvlcc2.png.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import coadjoint as co
from coadjoint import units as u
from coadjoint.arrays import Array, Scalar
from coadjoint.mechanics import Force
from coadjoint.plotting import style
from coadjoint.spaces import Named
from coadjoint_vehicles import Command, Craft, Flow, Part, Vehicle, measured
from coadjoint_vehicles.trials import Track, analyse

DENSITY, LENGTH, DRAUGHT, MASS, AHEAD = 1000.0, 7.0, 0.46, 3270.0, 0.25
"""kg/m³; L, m; d, m; kg; x_G, m ahead of midships."""
SPEED, SHIP = 1.179, 320.0
"""m/s of the model, 15.5 knots of the ship of 320 m."""
M_X, M_Y, J_Z = 0.022, 0.223, 0.011
"""Added masses in ½ρL²d, the moment of inertia in ½ρL⁴d."""
HULL_X = {"vv": -0.040, "vr": 0.002, "rr": 0.011, "vvvv": 0.771}
HULL_Y = {"v": -0.315, "r": 0.083, "vvv": -1.607, "vvr": 0.379, "vrr": -0.391, "rrr": 0.008}
HULL_N = {"v": -0.137, "r": -0.049, "vvv": -0.030, "vvr": -0.294, "vrr": 0.055, "rrr": -0.013}
DIAMETER, THRUST, WAKE, DEDUCTION, AT_PROPELLER = 0.216, (0.2931, -0.2753, -0.1385), 0.40, 0.220, -0.48
"""D_P, m; k₀, k₁, k₂; w_P0; t_P; x'_P."""
AREA, SPAN, SLOPE, LOST, GAIN, AT_GAIN = 0.0539, 0.345, 2.747, 0.387, 0.312, -0.464
"""Of the rudder: A_R, m²; H_R, m; f_α; t_R; a_H; x'_H."""
RUDDER_WAKE, RACE, AT_RUDDER, STRAIGHTENING = 1.09, 0.50, -0.710, (0.395, 0.640)
"""ε; κ; l'_R; γ_R for β_R < 0 and > 0."""
RESISTANCE, MEASURED_REVOLUTIONS = 0.022, 620 / 60
"""R'_0, as printed; 1/s, which MARIN's model had."""
STEP = 0.02
"""s."""
SEEN = {"seen": lambda s: jnp.hstack([s.q[:2], jnp.arctan2(s.g[1, 0], s.g[0, 0]), s.nu[0]])}
"""What a flight shows: place, heading, speed ahead."""


class Inflow(NamedTuple):
    """K_T of the propeller; u_R and v_R of the rudder, m/s."""

    thrust: Array
    along: Array
    across: Array


def inflow(ahead: Scalar, across: Scalar, r: Scalar, revolutions: Scalar) -> Inflow:
    """The water at propeller and rudder, of u and v of midships, m/s, and r, rad/s."""
    speed = jnp.hypot(ahead, across)
    drift, turn = jnp.arctan2(-across, ahead), r * LENGTH / speed
    beta = drift - AT_PROPELLER * turn
    rise = jnp.where(beta > 0, 0.6, 0.1) * (1 - jnp.exp(-2.0 * jnp.abs(beta)))  # C_2 - 1 and C_1
    entering, tip = ahead * (1 - WAKE) * (1 + rise), revolutions * DIAMETER
    ratio = entering / tip
    thrust = THRUST[0] + THRUST[1] * ratio + THRUST[2] * ratio**2
    race = entering + RACE * (jnp.sqrt(entering**2 + 8 * thrust * tip**2 / np.pi) - entering)
    share = DIAMETER / SPAN
    beta = drift - AT_RUDDER * turn
    straight = jnp.where(beta > 0, STRAIGHTENING[1], STRAIGHTENING[0])
    return Inflow(thrust, RUDDER_WAKE * jnp.sqrt(share * race**2 + (1 - share) * entering**2), speed * straight * beta)


def forces(
    ahead: Scalar, across: Scalar, r: Scalar, rudder: Scalar, revolutions: Scalar, resistance: Scalar
) -> tuple[Array, Array, Array]:
    """X, Y, N about midships, N and N m, of hull, propeller and rudder; δ in rad, positive to starboard."""
    square = ahead**2 + across**2
    v, turn = across / jnp.sqrt(square), r * LENGTH / jnp.sqrt(square)
    pressure = 0.5 * DENSITY * LENGTH * DRAUGHT * square

    def hull(terms: dict[str, float]) -> Array:
        return pressure * sum(c * v ** name.count("v") * turn ** name.count("r") for name, c in terms.items())

    flow = inflow(ahead, across, r, revolutions)
    angle = rudder - jnp.arctan2(flow.across, flow.along)
    normal = 0.5 * DENSITY * AREA * (flow.along**2 + flow.across**2) * SLOPE * jnp.sin(angle)
    aside = normal * jnp.cos(rudder)
    X = hull(HULL_X) - pressure * resistance - (1 - LOST) * normal * jnp.sin(rudder)
    X = X + (1 - DEDUCTION) * DENSITY * revolutions**2 * DIAMETER**4 * flow.thrust
    return X, hull(HULL_Y) - (1 + GAIN) * aside, LENGTH * (hull(HULL_N) - (-0.5 + GAIN * AT_GAIN) * aside)


def balanced(revolutions: float | None = None) -> tuple[float, float]:
    """(1/s, R'_0) that keep SPEED ahead: the revolutions for the printed R'_0, or R'_0 for given ones."""
    pressure, n = 0.5 * LENGTH * DRAUGHT * SPEED**2, revolutions
    push, ratio = (1 - DEDUCTION) * DIAMETER**4, SPEED * (1 - WAKE) / DIAMETER
    if n is None:  # push (k₀ n² + k₁ n ratio + k₂ ratio²) = pressure R'_0
        n = float(max(np.roots([THRUST[0], THRUST[1] * ratio, THRUST[2] * ratio**2 - pressure * RESISTANCE / push])))
    return n, push * (THRUST[0] * n**2 + THRUST[1] * n * ratio + THRUST[2] * ratio**2) / pressure


@dataclass(frozen=True, eq=False)
class Mmg(Part):
    """Hull, propeller and rudder; the command is the angle of the rudder."""

    kind: ClassVar[str] = "mmg"
    limit: float = measured(u.ANGLE, default=np.radians(35.0))
    lag: float = measured(u.TIME, default=0.0)
    rate: float = measured(u.ANGULAR_VELOCITY, default=np.radians(15.8))
    revolutions: float = measured(u.FREQUENCY, default=MEASURED_REVOLUTIONS)
    resistance: float = measured(u.NUMBER, default=RESISTANCE)

    @property
    def command(self) -> Command:
        return Command("rad")

    def force(self, flow: Flow, actual: Array, own: Named) -> Force:
        ahead, across, r = flow.velocity[0], flow.velocity[1], flow.omega[2]
        X, Y, N = forces(ahead, across, r, actual, own.revolutions, own.resistance)
        munk = 0.5 * DENSITY * LENGTH**2 * DRAUGHT * (M_Y - M_X) * ahead * across
        zero = jnp.zeros(())  # N' has the Munk moment, and so has ℓ: it is taken away once
        return Force(force=jnp.stack([X, Y, zero]), torque=jnp.stack([zero, zero, N + munk]))


def craft(revolutions: float | None = None) -> Craft:
    """The model of 7 m in the plane of its motion, in which all forces are."""
    unit, yaw = 0.5 * DENSITY * LENGTH**2 * DRAUGHT, MASS * (0.25 * LENGTH) ** 2
    n, resistance = balanced(revolutions)
    ship = Vehicle(
        name="KVLCC2", mass=MASS, inertia=(yaw, yaw, yaw), fluid_density=DENSITY, length=LENGTH,
        added_mass=(unit * M_X, unit * M_Y, unit * M_Y, 0.0, 0.0, unit * LENGTH**2 * J_Z),
        center_of_mass=(AHEAD, 0.0, 0.0), center_of_buoyancy=(AHEAD, 0.0, -0.1),
        parts=(Mmg("rudder", revolutions=n, resistance=resistance),),
    )  # fmt: skip
    return Craft(ship)


def next_order(manoeuvre: str, order: float, heading: float) -> float:
    """That of a zigzag is reversed once the heading is off by the angle of the rudder, on its side."""
    return -order if manoeuvre == "zigzag" and heading * np.sign(order) > abs(order) else order


def flown(manoeuvre: str, rudder: float, revolutions: float | None = None, duration: float = 100.0) -> Track:
    """The track of a turning circle or a zigzag, rudder in °, positive to starboard first; executed at 1 s."""
    one = craft(revolutions)
    stepper = co.Stepper(one.system, one.start(speed=SPEED), dt=STEP, inputs={"rudder": 0.0}, observe=SEEN)
    rows, orders = [np.array([0.0, 0.0, 0.0, SPEED])], []
    for k in range(round(duration / STEP)):
        last = orders[-1] if orders and orders[-1] else np.radians(rudder)
        orders.append(0.0 if k < 1.0 / STEP else next_order(manoeuvre, last, rows[-1][2]))
        rows.append(np.copy(stepper.step({"rudder": orders[-1]})["seen"]))
    return Track(
        manoeuvre, STEP * np.arange(len(orders)), *np.array(rows[:-1]).T, order=np.array(orders), length=LENGTH
    )


MEASURED = {
    ("turning_circle", 35): "tc_-35", ("turning_circle", -35): "tc_35", ("zigzag", 10): "zz_-10",
    ("zigzag", -10): "zz_10", ("zigzag", 20): "zz_-20", ("zigzag", -20): "zz_20",
}  # fmt: skip
"""The file of each manoeuvre, by its rudder, °, positive to starboard; in the files it is positive to port."""


def read(folder: Path, manoeuvre: str, rudder: int) -> Track:
    """A measured track: rows with the same time, of three digits, are averaged.

    The execute is where the rudder has moved by 0.3°; a turn ends where it is put back.
    """
    lines = (folder / f"MARIN_FREE_KVLCC2_{MEASURED[manoeuvre, rudder]}_m.dat").read_text("latin-1").splitlines()
    rows = np.array([line.split() for line in lines if len(line.split()) == 11], dtype=float)
    time, same = np.unique(rows[:, 0], return_inverse=True)
    columns = [np.bincount(same, rows[:, j]) / np.bincount(same) for j in (1, 2, 4, 5, 6, 9)]
    north, east, heading, along, across, angle = columns
    heading, angle = np.radians(heading), -np.radians(angle)
    speed = along * np.cos(heading) + across * np.sin(heading)
    orders = np.zeros(len(time))
    for k in range(int(np.argmax(np.abs(angle - angle[0]) > np.radians(0.3))), len(time)):
        orders[k] = next_order(manoeuvre, orders[k - 1] or np.radians(rudder), heading[k])
    turned = np.flatnonzero(np.abs(angle) > 0.9 * abs(np.radians(rudder)))
    kept = slice(None, turned[-1] if manoeuvre == "turning_circle" else None)
    return Track(manoeuvre, *(one[kept] for one in (time, north, east, heading, speed, orders)), length=SHIP)


FIGURES = {
    "turning_circle": ("advance", "transfer", "tactical_diameter"),
    "zigzag": ("initial_turning", "first_overshoot", "second_overshoot"),
}


def figures(track: Track) -> dict[str, float]:
    """Distances in lengths of the ship, angles in °."""
    found = analyse(track)
    assert track.length is not None
    unit = {name: track.length if found.merits[name].unit == "m" else 1.0 for name in FIGURES[track.manoeuvre]}
    return {name: found[name] / one for name, one in unit.items()}


def figure(manoeuvres: dict[tuple[str, int], list[Track]]) -> Figure:
    """Tracks of the turning circles and headings of the zigzags: measured in black, of the two models in blue."""
    fig = style.canvas(style.PAGE, 3.6)
    grid = fig.add_gridspec(2, 2)
    circle, *zigzags = fig.add_subplot(grid[:, 0]), fig.add_subplot(grid[0, 1]), fig.add_subplot(grid[1, 1])
    looks = ({"color": "black"}, {"color": style.COLOURS[0], "linestyle": ":"}, {"color": style.COLOURS[0]})
    for (manoeuvre, rudder), tracks in manoeuvres.items():
        for track, look in zip(tracks, looks, strict=True):
            assert track.length is not None and track.begin is not None
            if manoeuvre == "turning_circle":
                along, aside = track.ahead_and_aside[track.first :].T / track.length
                shown = np.abs(track.turned[track.first :]) < np.radians(400)
                circle.plot(aside[shown], along[shown], linewidth=0.9, **look)
            else:
                after = (track.time - track.begin) * np.sqrt(SHIP / track.length)
                shown = (after > -10) & (after < 520)
                ax = zigzags[0 if abs(rudder) == 10 else 1]
                ax.plot(after[shown], np.degrees(track.heading[shown]), linewidth=0.9, **look)
    circle.set(xlabel="across / L", ylabel="ahead / L", aspect="equal", title="35°")
    for ax, angle in zip(zigzags, (10, 20), strict=True):
        ax.set(ylabel="heading (°)", title=f"{angle}°/{angle}°")
    zigzags[1].set_xlabel("time of the ship (s)")
    return fig


def main(folder: Path | None) -> None:
    manoeuvres: dict[tuple[str, int], list[Track]] = {}
    for manoeuvre, rudder in MEASURED:
        tracks = [flown(manoeuvre, rudder, n, duration=125.0) for n in (None, MEASURED_REVOLUTIONS)]
        tracks = tracks if folder is None else [read(folder, manoeuvre, rudder), *tracks]
        manoeuvres[manoeuvre, rudder] = tracks
        columns = [figures(track) for track in tracks]
        print(f"{manoeuvre.replace('_', ' ')}, {rudder}°")
        for name in columns[0]:
            print(f"  {name:20s}", *(f"{one[name]:8.2f}" for one in columns))
    if folder is not None:
        style.save(figure(manoeuvres), Path(__file__).with_suffix(".png"))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
