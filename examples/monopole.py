"""Charged particles and a charged pendulum on a sphere around a magnetic monopole: motions on Hopf's fibration.

Run as: python examples/monopole.py [duration of the pendulum in s]
It prints how far the motions are from closed forms, and writes monopole.png. No potential of a monopole's field covers
the sphere: motions go through two sections of S³ → S², north and south; the momentum along U(1) is the charge.
"""

import sys

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import hopf

steps = max(round(100 * float(sys.argv[1])), 1) if len(sys.argv) > 1 else 1200
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
    off = np.max(np.abs((run.x - x) @ axis)) / np.linalg.norm(axis)
    print(f"charge {charge:g}: off its circle by {off:.0e}, charge kept within {np.ptp(run.momentum):.0e}, "
          f"{np.count_nonzero(np.diff(run.section))} changes of section")  # fmt: skip

pendulum = start([np.sin(1.0), 0.0, np.cos(1.0)], [0.0, 0.6, 0.0], 3.0)
runs = [co.theory.bundle_motion(bundle, particle(3.0), *pendulum, dt=0.01, steps=steps, margin=m) for m in (0.2, 0.8)]
apart = np.max(np.abs(runs[0].p - runs[1].p))
print(f"pendulum: sections changed earlier or later move it by {apart:.0e}")

figure = plt.figure(figsize=(8.4, 3.2), layout="constrained")
polar, turn = np.mgrid[0 : np.pi : 9j, 0 : 2 * np.pi : 13j]
sphere = np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)
panels = ("charges 0.5, 1, 2, 4", [run for run, *_ in circles.values()]), ("charged pendulum", runs[:1])
for i, (title, curves) in enumerate(panels):
    axes = figure.add_subplot(1, 3, i + 1, projection="3d", title=title)
    axes.plot_wireframe(*sphere, color="0.85", linewidth=0.5)
    for run in curves:
        for k, colour in enumerate(("C0", "C1")):
            axes.plot(*np.where((run.section == k)[:, None], run.x, np.nan).T, colour, linewidth=1.2)
    axes.set_box_aspect((1, 1, 1), zoom=1.45)
    axes.view_init(elev=12, azim=-60)
    axes.set_axis_off()
axes.legend(axes.lines, ("north", "south"), loc="upper center", bbox_to_anchor=(0.5, 0.1), ncols=2, fontsize=8)
phase = figure.add_subplot(1, 3, 3, title="phase of one turn (rad)", xlabel="solid angle of the circle")
phase.plot([0, 2 * np.pi], [0, np.pi], color="0.6")  # half the solid angle
for charge, (_, rho, geometric) in circles.items():
    solid = 2 * np.pi * (1 - np.cos(rho))
    phase.plot(solid, geometric, "C0o")
    phase.annotate(f"e = {charge:g}", (solid, solid / 2), (5, -9), textcoords="offset points", fontsize=8)
figure.savefig("monopole.png", dpi=150)
