"""A model of a real vehicle from one half of its log, and what it predicts of the other half.

The log is that of Kingfisher, the AUV of Tartan AUV (Carnegie Mellon University), of the first of December 2022: 16
minutes in a pool, in closed loop, with the velocities of its DVL and the forces and torques that its controller
demanded. It is in dynamics-parameter-estimation/data/bags-12-01-22 of https://github.com/Tartan-AUV/TAUV-Playground,
commit d9405b8, which states no licence: it is not part of this library.

Run as: python docs/figures/kingfisher.py FOLDER; it prints the tables of docs/validation.md and writes
docs/figures/kingfisher.png.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.identification import Identification, Log, identify
from coadjoint.plotting import style
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.parts import Damping, Thrusters

EVERY = 0.2
"""s between samples, of which the DVL gives five to six a second."""
AXES = ("X", "Y", "Z", "K", "M", "N")
DVL = (-0.16256, 0.0, 0.110236)
"""m, the place of the DVL in the body, as the vehicle's software has it (state_estimation_cpp.yaml of tauv-mono)."""
SEEN = {"seen": lambda s: jnp.hstack([s.q, jnp.arctan2(s.g[1, 0], s.g[0, 0]), s.nu + jnp.cross(s.xi, jnp.array(DVL))])}
"""What the model shows: position, heading, and the velocity at the DVL."""
HALF, SHOWN = 480.0, (200.0, 320.0)
"""s: of the first half, and what the figure shows of the second."""
HORIZONS = (2.0, 5.0, 10.0)
"""s over which the model predicts."""


def read(folder: Path) -> Log:
    """The log at equal intervals: means of what came in each, commands over the interval that they drive.

    Times of the motion are those of its stamps, times of the commands those of the recorder.
    """
    found = np.genfromtxt(folder / "navigation_state.csv", delimiter=",", skip_header=1)
    files = [file for file in folder.glob("wrench_*.csv") if file.stat().st_size > 0]
    driven = np.vstack([np.genfromtxt(file, delimiter=",", skip_header=1) for file in files])
    found, driven = found[np.argsort(found[:, 2])], driven[np.argsort(driven[:, 0])]
    first = found[0, 2]
    t, at = 1e-9 * (found[:, 2] - first), 1e-9 * (driven[:, 0] - first)
    edges = np.arange(10.0, min(t[-1], at[-1]) - EVERY, EVERY)
    moved = np.column_stack([found[:, 4:10], found[:, 13:15], np.unwrap(found[:, 15])])
    rows = np.stack([_mean(t, moved, edge - EVERY / 2, edge + EVERY / 2) for edge in edges])
    commands = np.stack([_mean(at, driven[:, 1:], edge, edge + EVERY) for edge in edges])
    commands = np.stack([_filled(edges, column) for column in commands.T], axis=1)
    names = ("north", "east", "depth", "u", "v", "w", "roll", "pitch", "heading")
    places = dict.fromkeys(("u", "v", "w"), DVL)
    return Log(edges - edges[0], dict(zip(names, rows.T, strict=True)), {"thrusters": commands}, positions=places)


def _mean(t: np.ndarray, rows: np.ndarray, begin: float, end: float) -> np.ndarray:
    inside = rows[(t >= begin) & (t < end)]
    return inside.mean(axis=0) if len(inside) else np.full(rows.shape[1], np.nan)


def _filled(t: np.ndarray, column: np.ndarray) -> np.ndarray:
    """A demand is held while no other one comes."""
    known = np.flatnonzero(np.isfinite(column))
    return column[known[np.clip(np.searchsorted(known, np.arange(len(t)), "right") - 1, 0, None)]]


def part(log: Log, begin: float, end: float) -> Log:
    """The log between two times."""
    of = (log.time >= begin) & (log.time < end)
    columns = {name: values[of] for name, values in log.columns.items()}
    inputs = {"thrusters": log.inputs["thrusters"][of]}
    return Log(log.time[of] - log.time[of][0], columns, inputs, positions=log.positions)


def craft() -> Craft:
    """29 kg, as its software has it; moments and added mass of its size, guessed; demands as forces, N, and torques."""
    parts = (
        Damping("damping", linear=[10.0, 10.0, 10.0, 2.0, 2.0, 2.0], quadratic=[20.0, 30.0, 40.0, 1.0, 1.0, 1.0]),
        Thrusters("thrusters", curve={"linear": 1.0}, allocation=np.eye(6), limit=200.0, effectiveness=np.full(6, 0.3)),
    )
    vehicle = Vehicle(
        name="Kingfisher", mass=29.0, volume=0.0288, fluid_density=1000.0, inertia=[0.7, 1.2, 1.5], parts=parts,
        added_mass=[10.0, 20.0, 30.0, 0.3, 0.5, 0.5], center_of_mass=(0.0, 0.0, 0.02), length=0.8,
    )  # fmt: skip
    return Craft(vehicle)


def identified(log: Log) -> Identification:
    """The shares of demands that arrive and linear damping, of four axes; volume and height of the centre of mass."""
    one = craft()
    sought = [f"{name}[{k}]" for name in ("thrusters.effectiveness", "damping.linear") for k in (0, 1, 2, 5)]
    sought += ["volume", "center_of_mass[2]"]
    return identify(
        one.system, log, start=one.start(position=(0, 0, 1)), parameters=sought, dt=0.1,
        coloured=["position", "velocity", "attitude"],
    )  # fmt: skip


class Window(NamedTuple):
    """10 s from a state of the log, (K, 4) north, east, depth, m, and heading, rad: of the log, of the model with the
    demands that came, of a motion that keeps its velocity; and the model's speeds at the DVL, (K, 3) m/s."""

    begin: float
    log: np.ndarray
    model: np.ndarray
    steady: np.ndarray
    speeds: np.ndarray


def windows(system: co.System, log: Log) -> list[Window]:
    """One every 10 s, where the log has no gap."""
    rows = np.column_stack([log.columns[name] for name in ("north", "east", "depth", "heading")])
    body = np.column_stack([log.columns[name] for name in ("u", "v", "w")])
    turn, length, one = np.gradient(rows[:, 3], log.time), round(HORIZONS[-1] / EVERY), craft()
    start, inputs = one.start(position=(0, 0, 1)), {"thrusters": np.zeros(6)}
    stepper = co.Stepper(system, start, dt=EVERY / 2, inputs=inputs, observe=SEEN, accuracy=False)
    found = []
    for k in range(2, len(log.time) - length - 1, length):
        inside = slice(k - 2, k + length + 1)
        if not np.all(np.isfinite(np.hstack([rows, body])[inside])):
            continue
        rate = turn[k - 2 : k + 3].mean()
        velocity = body[k - 2 : k + 3].mean(axis=0) - np.cross([0, 0, rate], DVL)
        angles = {"euler_zyx": (rows[k, 3], log.columns["pitch"][k], log.columns["roll"][k])}
        stepper.reset(one.start(position=rows[k, :3], velocity=velocity, angular_velocity=(0, 0, rate), **angles))
        driven = [np.copy(stepper.step({"thrusters": u}, n=2)["seen"]) for u in log.inputs["thrusters"][k : k + length]]
        model = np.array([[*rows[k], *body[k]], *driven])
        headings = rows[k, 3] + rate * EVERY * np.arange(length + 1)
        steps = EVERY * np.array([_rotated(velocity, heading) for heading in headings])
        steady = np.column_stack([rows[k, :3] + np.cumsum(steps, axis=0) - steps[0], headings])
        model[:, 3] = np.unwrap(model[:, 3], period=2 * np.pi) + rows[k, 3] - model[0, 3]
        found.append(Window(log.time[k], rows[k : k + length + 1], model[:, :4], steady, model[:, 4:]))
    return found


def errors(found: list[Window], name: str) -> np.ndarray:
    """Of the model or of the steady motion (windows, horizons, 4); "log": how far the vehicle moved."""
    at = [round(horizon / EVERY) for horizon in HORIZONS]
    return np.array([(one.log - one.log[0] if name == "log" else getattr(one, name) - one.log)[at] for one in found])


def _rotated(velocity: np.ndarray, heading: float) -> np.ndarray:
    c, s = np.cos(heading), np.sin(heading)
    return np.array([c * velocity[0] - s * velocity[1], s * velocity[0] + c * velocity[1], velocity[2]])


def rms(errors: np.ndarray) -> np.ndarray:
    """Root mean squares (horizons, 3): in the horizontal plane, m, of depth, m, and of heading, °."""
    squares = np.mean(errors**2, axis=0)
    return np.sqrt(np.stack([squares[:, 0] + squares[:, 1], squares[:, 2], squares[:, 3]], axis=1)) * [
        1,
        1,
        180 / np.pi,
    ]


def table(first: list[Window], second: list[Window]) -> None:
    """Print the rows of the page."""
    parts = (errors(first, "model"), *(errors(second, name) for name in ("model", "steady", "log")))
    for k, horizon in enumerate(HORIZONS):
        for j, name in enumerate(("horizontal, m", "depth, m", "heading, °")):
            print(f"| {horizon:g} s | {name} |", " | ".join(f"{rms(one)[k, j]:.2f}" for one in parts), "|")
    within = np.abs(parts[1]) < 1.96 * np.sqrt(np.mean(parts[0] ** 2, axis=0))
    print("windows:", len(first), len(second), "within 1.96 deviations of the first half:", within.mean(axis=(0, 1)))


def figure(found: list[Window], log: Log):
    """Speeds and heading of two minutes of the second half, and predictions that begin every 10 s."""
    fig = style.canvas(style.PAGE, 3.4)
    axes = fig.subplots(2, 2, sharex=True)
    shown = (log.time >= SHOWN[0]) & (log.time < SHOWN[1])
    for ax, name, j in zip(axes.ravel(), ("u", "v", "w", "heading"), (0, 1, 2, 3), strict=True):
        scale = np.degrees(1.0) if name == "heading" else 1.0
        ax.plot(log.time[shown], scale * log.columns[name][shown], color="black", linewidth=0.7, label="log")
        for one in found:
            if SHOWN[0] <= one.begin < SHOWN[1]:
                values = one.model[:, 3] if name == "heading" else one.speeds[:, j]
                times = one.begin + EVERY * np.arange(len(values))
                ax.plot(times[1:], scale * values[1:], color=style.COLOURS[0], linewidth=1.0)
        ax.set_ylabel("heading (°)" if name == "heading" else f"{name} (m/s)")
    for ax in axes[1]:
        ax.set_xlabel("time in the second half (s)")
    return fig


if __name__ == "__main__":
    log = read(Path(sys.argv[1]))
    first, second = part(log, 0, HALF), part(log, HALF, np.inf)
    found = identified(first)
    print(found)
    table(windows(found.system, first), latter := windows(found.system, second))
    style.save(figure(latter, second), Path(__file__).with_suffix(".png"))
