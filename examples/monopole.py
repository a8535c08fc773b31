"""Charged particles and a charged pendulum on a sphere around a magnetic monopole: motions on Hopf's fibration.

Run as: python examples/monopole.py [duration of the pendulum in s]
It prints how far the motions are from closed forms, and writes monopole.png.

No potential of a monopole's field covers the sphere: S³ → S² has no global section. Motions go through two of them,
north and south, and the momentum along the fibre U(1) is the charge.
"""

import sys

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import hopf

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 12.0
bundle = hopf.fibration()


def particle(weight):
    """½|ẋ|² + ½(𝒜ṗ)² − weight x₃ in terms of points p of S³ over x."""

    def lagrangian(p, v):
        along = hopf.connection_form(p)[0] @ v * jnp.sqrt(p @ p)
        return 2 * (v @ v - along**2) + 0.5 * along**2 - weight * hopf.direction(p)[2]

    return lagrangian


def start(x, v, charge):
    """p over x, and ṗ over v with this charge."""
    p = np.asarray(evaluate(bundle.sections[0].point, np.array(x)))
    along = np.asarray(evaluate(hopf.connection_form, p))[0]
    slope = evaluate(jax.jacfwd(hopf.direction), p)
    return p, np.linalg.lstsq(np.vstack([slope, p, along]), np.array([*v, 0.0, charge]), rcond=None)[0]


circles = {}
for charge in (0.5, 1.0, 2.0, 4.0):
    rho = np.arctan2(2.0, charge)  # cot ρ = e/2 at unit mass and speed
    period = 2 * np.pi * np.sin(rho)
    x, v = np.array([np.sin(1.2), 0.0, np.cos(1.2)]), np.array([-np.cos(1.2), 0.0, np.sin(1.2)])
    run = co.theory.bundle_motion(bundle, particle(0.0), *start(x, -v, charge), dt=period / 200, steps=200)
    first, last = (run.p[k, ::2] + 1j * run.p[k, 1::2] for k in (0, -1))
    geometric = (np.angle(np.conj(first) @ last) - charge * period) % (2 * np.pi)
    circles[charge] = run, rho, geometric
    axis = np.cross(x, -v) - 0.5 * charge * x
    axis /= np.linalg.norm(axis)
    off = np.max(np.abs(run.x @ axis - x @ axis))
    print(f"charge {charge:g}: off its circle by {off:.0e}, charge kept within {np.ptp(run.momentum):.0e}, "
          f"{np.count_nonzero(np.diff(run.section))} changes of section")  # fmt: skip

pendulum = start([np.sin(1.0), 0.0, np.cos(1.0)], [0.0, 0.6, 0.0], 3.0)
steps = max(round(duration / 0.01), 1)
runs = [co.theory.bundle_motion(bundle, particle(3.0), *pendulum, dt=0.01, steps=steps, margin=m) for m in (0.2, 0.8)]
apart = np.max(np.abs(runs[0].p - runs[1].p))
print(f"pendulum: sections changed earlier or later move it by {apart:.0e}")

figure = plt.figure(figsize=(8.4, 3.2), layout="constrained")
ball = np.mgrid[0 : np.pi : 25j, 0 : 2 * np.pi : 49j]
grid = np.stack([np.sin(ball[0]) * np.cos(ball[1]), np.sin(ball[0]) * np.sin(ball[1]), np.cos(ball[0])])
COLOURS = np.array(["#0072B2", "#D55E00"])


def draw(axes, curves, title):
    axes.plot_wireframe(*grid, rcount=9, ccount=13, color="0.85", linewidth=0.5)
    for run in curves:
        for k, side in enumerate(("north", "south")):
            x = np.where((run.section == k)[:, None], run.x, np.nan)
            axes.plot(*x.T, color=COLOURS[k], linewidth=1.2, label=side if run is curves[0] else None)
    axes.set(title=title, xticks=[], yticks=[], zticks=[])
    axes.set_box_aspect((1, 1, 1), zoom=1.45)
    axes.view_init(elev=12, azim=-60)
    axes.set_axis_off()


draw(figure.add_subplot(1, 3, 1, projection="3d"), [run for run, *_ in circles.values()], "charges 0.5, 1, 2, 4")
hung = figure.add_subplot(1, 3, 2, projection="3d")
draw(hung, runs[:1], "charged pendulum")
figure.legend(*hung.get_legend_handles_labels(), title="through the section", loc="lower left", ncols=2, frameon=False,
              fontsize=8, title_fontsize=8)  # fmt: skip
phase = figure.add_subplot(1, 3, 3)
area = np.linspace(0, 2 * np.pi, 50)
phase.plot(area, area / 2, color="0.6", label="half the solid angle")
for charge, (_, rho, geometric) in circles.items():
    solid = 2 * np.pi * (1 - np.cos(rho))
    phase.plot(solid, geometric, "o", color=COLOURS[0])
    phase.annotate(f"e = {charge:g}", (solid, solid / 2), (5, -9), textcoords="offset points", fontsize=8)
phase.set(xlabel="solid angle of the circle", ylabel="geometric phase (rad)", title="phase after one turn")
phase.legend(frameon=False, loc="upper left", fontsize=8)
figure.savefig("monopole.png", dpi=150)
