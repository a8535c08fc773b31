"""The picture of the first page: what one writes, the motion, and what stays of energy and momentum.

Run as: python docs/figures/overview.py; it writes docs/figures/overview.png.
"""

from pathlib import Path

import numpy as np

import coadjoint as co
from coadjoint.plotting import style

INERTIA, WEIGHT, DT, DURATION = np.diag([5.0, 5.0, 1.0]), 20.0, 0.02, 200.0
TEXT = """def lagrangian(xi, a, p):
    turning = 0.5 * xi @ p.inertia @ xi
    return turning - p.weight * a[2]

top = co.System(co.SO3(), lagrangian, …)
run = co.simulate(top, start, dt=0.02, …)"""


def lagrangian(xi, a, p):
    return 0.5 * xi @ p.inertia @ xi - p.weight * a[2]


def explicit(xi, R):
    """Energy and vertical momentum of the same top by Runge and Kutta's method of order 4, step by step."""
    inverse, up = np.linalg.inv(INERTIA), np.array([0.0, 0.0, 1.0])

    def slope(y):
        mu, a = y[:3], y[3:]
        xi = inverse @ mu
        return np.concatenate([np.cross(mu, xi) + WEIGHT * np.cross(a, up), np.cross(a, xi)])

    y, found = np.concatenate([INERTIA @ xi, R.T @ up]), []
    for _ in range(round(DURATION / DT) + 1):
        mu, a = y[:3], y[3:]
        found.append([0.5 * mu @ inverse @ mu + WEIGHT * a[2], mu @ a])
        k1 = slope(y)
        k2 = slope(y + DT / 2 * k1)
        k3 = slope(y + DT / 2 * k2)
        y = y + DT / 6 * (k1 + 2 * k2 + 2 * k3 + slope(y + DT * k3))
    return np.abs(np.array(found) / found[0] - 1).T


def draw() -> None:
    """Run and draw."""
    top = co.System(co.SO3(), lagrangian, advected=co.Defining(), parameters={"inertia": INERTIA, "weight": WEIGHT})
    start = top.state(g=co.attitude.zyx(0, 0, 0.6), xi=[0, 0, 20], a0=[0, 0, 1])
    run = co.simulate(top, start, dt=DT, duration=DURATION)
    data = run.dataset
    momentum = data.kelvin_noether.values.reshape(len(data.time), -1)[:, -1]
    figure = style.canvas(style.PAGE, 2.5)
    figure.get_layout_engine().set(wspace=0.06)
    write, path, kept = figure.subplots(1, 3, width_ratios=[1.2, 0.7, 1.35])
    write.axis("off")
    write.text(0.0, 0.98, "You write the reduced Lagrangian", weight="bold", va="top")
    write.text(0.0, 0.82, TEXT, family="monospace", fontsize=6.2, va="top", linespacing=1.5)
    write.text(
        0.0, 0.3, "ℓ(ξ, a): ξ the body velocity on SO(3),\na the direction of up in the body", va="top", fontsize=7
    )
    axis = data.R.values[: round(20 / DT), :, 2]
    path.plot(axis[:, 0], axis[:, 1], color=style.COLOURS[0], linewidth=0.7)
    path.set(aspect="equal", title="the top's axis from above", xticks=[], yticks=[])

    def change(values):
        return np.abs(values / values[0] - 1)

    rows = [(change(momentum), "vertical momentum", 2), (change(data.energy.values), "energy", 0)]
    energy, spatial = explicit(np.array([0.0, 0.0, 20.0]), co.attitude.zyx(0, 0, 0.6))
    rows += [(energy, "energy, Runge–Kutta 4", 1), (spatial, "momentum, Runge–Kutta 4", 4)]
    for values, label, colour in rows:
        kept.semilogy(data.time, np.maximum(values, 1e-17), color=style.COLOURS[colour], linewidth=0.6, label=label)
    kept.set(xlabel="time (s)", title="relative change from the start", ylim=(1e-17, 1e4))
    kept.set(yticks=10.0 ** np.arange(-16, 1, 4))
    kept.legend(fontsize=6, loc="upper left", ncols=2, columnspacing=0.8, handlelength=1.2)
    style.save(figure, Path(__file__).with_suffix(".png"), dpi=150)


if __name__ == "__main__":
    with style.style():
        draw()
