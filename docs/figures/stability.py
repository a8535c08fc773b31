"""The figure of the page on stability: bottom-heavy ellipsoids, and three sets of numbers of REMUS 100; a minute.

Run as: python docs/figures/stability.py; it writes docs/figures/stability.png.
"""

from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint.models.paper_form import start
from coadjoint.plotting import style
from coadjoint.stability import Search, stability
from coadjoint_vehicles.hydrodynamics import ellipsoid
from coadjoint_vehicles.trim import SteadyFlight, trim

LEVERS = np.linspace(0.004, 0.04, 7)
SPEEDS = np.linspace(0.1, 1.1, 9)
ELLIPSOIDS = {2: (0.3, 0.5, 1.0), 1: (1.0, 0.4, 0.3)}
TITLES = {2: "along $e_3$, vertical", 1: "along $e_2$, horizontal"}
MARKS = {"stable": ("o", style.COLOURS[0]), "undecided": ("s", style.COLOURS[4]), "unstable": ("x", style.COLOURS[1])}


def masses(body):
    """M = m + added mass, and mg."""
    p = body.parameters
    return p.mass + np.diag(p.added_mass)[:3], p.mass * p.gravity


def verdicts(axis: int, lever: float) -> list[str]:
    """Of the motion along an axis at every speed."""
    body = ellipsoid(semi_axes=ELLIPSOIDS[axis], center_of_mass=(0, 0, lever))
    along = np.eye(3)[axis]

    def conditions(state, speed):
        return jnp.concatenate([state.nu - speed * along, state.xi])

    search = Search(body, start(body, velocity=SPEEDS[0] * along), conditions)
    return [stability(search.find(start(body, velocity=v * along), v)).verdict for v in SPEEDS]


def bottom_heavy(axes, axis: int) -> None:
    """Verdicts over speed and lever, and the closed form's bound."""
    found = [(v, l, verdict) for l in LEVERS for v, verdict in zip(SPEEDS, verdicts(axis, float(l)), strict=True)]
    for verdict, (marker, colour) in MARKS.items():
        points = np.array([(v, l) for v, l, found_here in found if found_here == verdict]).reshape(-1, 2)
        axes.scatter(points[:, 0], 1e3 * points[:, 1], marker=marker, s=13, c=colour, linewidths=0.9, label=verdict)
    M, weight = masses(ellipsoid(semi_axes=ELLIPSOIDS[axis]))
    steep = max(1 / M[2] - 1 / M[0], 1 / M[2] - 1 / M[1]) if axis == 2 else 1 / M[1] - 1 / M[2]
    speeds = np.linspace(0, 1.15, 100)
    bound = (M[axis] * speeds) ** 2 * steep / weight
    axes.plot(speeds, 1e3 * bound, color="black", label="closed form")
    axes.set(xlabel="speed (m/s)", title=TITLES[axis], ylim=(0, 44), xlim=(0, 1.15))


def growth(vehicle, speeds):
    """The largest Re λ at every speed, NaN where there is no steady flight, and whether its actuators can hold it."""
    flight, motion, rates, held = SteadyFlight(vehicle), None, [], []
    for speed in speeds:
        try:
            motion = flight.at(float(speed), near=motion)
        except ArgumentError:
            motion = None
        rates.append(np.nan if motion is None else stability(motion).growth_rate)
        held.append(motion is not None and not trim(vehicle, motion).beyond)
    return np.array(rates), np.array(held)


def growth_rates(axes) -> None:
    """The largest Re λ of each set of numbers of REMUS 100 against speed."""
    composed, prestero, sgarioto = (vehicles.load(f"remus_100{name}") for name in ("", "_prestero", "_sgarioto"))
    fins = ("stern_planes", "rudder")
    bare = replace(composed, parts=tuple(part for part in composed.parts if part.name not in fins))
    speeds = np.linspace(0.25, 2.5, 10)
    m1, m2, J = composed.mass + 0.8389, composed.mass + 29.4376, 4.0278 + 3.4262
    munk = np.sqrt((m2 - m1) * m1 / (m2 * J)) * speeds
    axes.plot(speeds, munk, color="black", linestyle=style.DASHES[1], label="composed, bare: Munk")
    shown = ((bare, "composed, bare"), (sgarioto, "Sgarioto"), (prestero, "Prestero"), (composed, "composed"))
    for (vehicle, label), k in zip(shown, (1, 2, 3, 0), strict=True):
        (rates, held), colour = growth(vehicle, speeds), style.COLOURS[k]
        axes.plot(speeds, rates, color=colour)
        axes.plot([], [], "o-", markersize=3, color=colour, label=label)
        for which, face in ((held, colour), (~held, "white")):
            axes.plot(speeds[which], rates[which], "o", markersize=3, color=colour, markerfacecolor=face)
    axes.axhline(0, color="black", linewidth=0.6)
    axes.set(xlabel="speed (m/s)", ylabel="largest Re λ (1/s)", title="sets of REMUS 100, level", ylim=(-0.6, 5.8))
    axes.legend(loc="upper left", fontsize=6)


def draw() -> None:
    """Find and draw."""
    with style.style():
        figure = style.canvas(style.PAGE, 2.7)
        vertical, horizontal, remus = figure.subplots(1, 3)
        bottom_heavy(vertical, 2)
        bottom_heavy(horizontal, 1)
        vertical.set_ylabel("lever $l$ (mm)")
        growth_rates(remus)
        handles, labels = vertical.get_legend_handles_labels()
        shown = [(h, l) for h, l in zip(handles, labels, strict=True) if l != "undecided"]
        style.legend(figure, *map(list, zip(*shown, strict=True)))
        style.save(figure, Path(__file__).with_suffix(".png"), dpi=150)


if __name__ == "__main__":
    draw()
