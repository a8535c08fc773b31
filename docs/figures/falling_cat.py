"""The figure of a cat that turns over with momentum zero: bodies in seven moments, its turn, and its loop of shapes.

python docs/figures/falling_cat.py        writes docs/figures/falling_cat.png
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import catalogue, falling_cat

FRONT, REAR, DARK = "#E69F00", "#4C86B8", "#3b3b3b"
BEND = 2 * np.arccos((np.sqrt(13) - 1) / 3)  # the bend of 59.4° that turns by 180°
DURATION = 0.5

connection = co.mechanics.mechanical_connection(catalogue["falling_cat"].make())


def smooth(t, first, last):
    """From 0 at `first` to 1 at `last`."""
    s = jnp.clip((t - first) / (last - first), 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def shape(t):
    """The spine bends towards the belly, carries its bend once round, and straightens."""
    size = BEND * (smooth(t, 0.0, 0.12) - smooth(t, 0.38, 0.5))
    round_ = 2 * jnp.pi * smooth(t, 0.12, 0.38)
    return size * jnp.stack([jnp.cos(round_), jnp.sin(round_)])


def ball(centre, axes, rows=18, columns=28):
    """An ellipsoid as quadrangles (k, 4, 3): its axes are columns of a matrix."""
    u, v = np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, columns + 1)
    grid = np.stack(
        [np.outer(np.cos(u), np.ones_like(v)), np.outer(np.sin(u), np.cos(v)), np.outer(np.sin(u), np.sin(v))], -1
    )
    points = grid @ np.asarray(axes).T + centre
    return np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], 2).reshape(-1, 4, 3)


def rod(start, end, radius, final=None, columns=12, rows=5):
    """A cone from one radius to another, rounded at its end."""
    axis = (end - start) / np.linalg.norm(end - start)
    side = np.linalg.svd(axis[None])[2][1:]
    v, s = np.linspace(0, 2 * np.pi, columns + 1), np.linspace(0, 1, rows + 1)
    ring = np.cos(v)[:, None] * side[0] + np.sin(v)[:, None] * side[1]
    radii = radius + ((radius if final is None else final) - radius) * s
    points = start + s[:, None, None] * (end - start) + radii[:, None, None] * ring
    return np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], 2).reshape(-1, 4, 3)


def cat(g, x):
    """The parts of a cat: quadrangles with their colours, seen from its mass centre."""
    R, S = (np.asarray(g @ half) for half in evaluate(falling_cat.halves, x))
    joint = -0.06 * (R[:, 0] - S[:, 0])
    parts = []

    def add(quads, colour):
        parts.append((quads, to_rgb(colour)))

    def at(frame, *place):
        return joint + frame @ np.array(place)

    add(ball(at(R, 0.105, 0, 0), R * [0.15, 0.078, 0.085]), FRONT)
    add(ball(at(S, -0.105, 0, 0), S * [0.15, 0.08, 0.09]), REAR)
    head = at(R, 0.275, 0, 0.045)
    add(ball(head, R * [0.068, 0.064, 0.06]), FRONT)
    add(ball(at(R, 0.335, 0, 0.03), R * [0.025, 0.03, 0.022], 10, 14), "#f4d9a0")
    for side in (-1, 1):
        add(rod(at(R, 0.268, 0.038 * side, 0.085), at(R, 0.262, 0.05 * side, 0.145), 0.024, 0.002), FRONT)
        add(ball(at(R, 0.328, 0.03 * side, 0.062), 0.0115 * np.eye(3), 8, 10), DARK)
        for frame, where, colour in ((R, 0.17, FRONT), (S, -0.18, REAR)):
            foot = at(frame, where + 0.012, 0.052 * side, -0.20)
            add(rod(at(frame, where, 0.045 * side, -0.03), foot, 0.03, 0.02), colour)
            add(ball(foot + frame[:, 0] * 0.012, frame * [0.034, 0.024, 0.02], 10, 14), DARK)
    s = np.linspace(0, 1, 12)
    tail = np.stack([-0.25 - 0.16 * s, 0 * s, 0.02 + 0.02 * s + 0.13 * s**2], 1)
    for k in range(11):
        add(rod(at(S, *tail[k]), at(S, *tail[k + 1]), 0.017 - 0.001 * k, rows=1), REAR)
    return parts


def draw(axes, parts, place):
    """All quadrangles of a cat in one picture, the far ones first, lit from above."""
    azimuth, elevation = np.radians(-62), np.radians(12)
    c, s = np.cos(azimuth), np.sin(azimuth)
    right = np.array([-s, c, 0.0])
    towards = np.array([c * np.cos(elevation), s * np.cos(elevation), np.sin(elevation)])
    view = np.stack([right, np.cross(towards, right), towards])
    light = np.array([0.25, -0.45, 0.86])
    quads = np.concatenate([part for part, _ in parts])
    colours = np.concatenate([np.tile(colour, (len(part), 1)) for part, colour in parts])
    normals = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-300
    normals *= np.sign(normals @ towards)[:, None]
    bright = 0.62 + 0.42 * np.clip(normals @ light, -0.6, 1)
    seen = quads @ view.T
    order = np.argsort(seen[..., 2].mean(1))
    faces = np.clip(colours * bright[:, None], 0, 1)[order]
    flat = seen[order][..., :2] + place
    axes.add_collection(PolyCollection(flat, facecolors=faces, edgecolors=faces, linewidths=0.25, rasterized=True))


times = np.linspace(0.0, DURATION, 201)
upside_down = np.diag([1.0, -1.0, -1.0])
g = co.mechanics.horizontal_lift(connection, shape, upside_down, times=times)
x = evaluate(jax.vmap(shape), times)
relative = upside_down.T @ g
turn = np.degrees(np.unwrap(np.arctan2(relative[:, 2, 1], relative[:, 1, 1])))

plt.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False})
figure = plt.figure(figsize=(7.4, 4.2))
fall = figure.add_axes((0.005, 0.43, 0.99, 0.57))
moments = [0.0, 0.12, 0.2, 0.25, 0.3, 0.38, 0.5]
for k, t in enumerate(moments):
    index = round(t / DURATION * 200)
    place = np.array([0.73 * k, -1.1 * t**2 / 0.5])
    draw(fall, cat(g[index], x[index]), place)
    fall.text(place[0], place[1] - 0.47, f"{t:.2f} s\n{abs(turn[index]):.0f}°", ha="center", va="center", color="0.35")
fall.set(xlim=(-0.45, 4.8), ylim=(-1.14, 0.3), aspect="equal")
fall.axis("off")

angle = figure.add_axes((0.08, 0.105, 0.42, 0.31))
angle.plot(times, abs(turn), color="#0072B2", linewidth=1.6, label="turn about the spine")
angle.plot(times, np.degrees(np.hypot(*x.T)), color="#D55E00", linewidth=1.2, label="bend of the spine")
angle.plot(moments, np.interp(moments, times, abs(turn)), "o", color="#0072B2", markersize=3)
angle.set(xlabel="time (s)", ylabel="angle (°)", yticks=[0, 60, 120, 180], xlim=(0, DURATION), ylim=(-4, 190))
angle.grid(alpha=0.25)
angle.legend(frameon=False, loc="upper left", fontsize=7.5)

plane = figure.add_axes((0.58, 0.105, 0.30, 0.31))
side = np.linspace(-1.5, 1.5, 61)
grid = np.stack(np.meshgrid(side, side), -1)
field = connection.curvature(grid.reshape(-1, 2))[:, 0, 0, 1].reshape(61, 61)
map_ = plane.pcolormesh(np.degrees(side), np.degrees(side), field, cmap="YlGnBu", shading="gouraud", rasterized=True)
plane.plot(*np.degrees(x.T), color="#D55E00", linewidth=1.5)
low, high = np.degrees(x[[98, 102]])
plane.annotate("", high, low, arrowprops={"color": "#D55E00", "arrowstyle": "->", "lw": 1.5})
plane.set(
    xlabel="bend towards the belly (°)",
    ylabel="to the side (°)",
    aspect="equal",
    xticks=[-60, 0, 60],
    yticks=[-60, 0, 60],
)
figure.colorbar(map_, cax=figure.add_axes((0.865, 0.105, 0.012, 0.31)), label="curvature about the spine")
figure.savefig(Path(__file__).with_name("falling_cat.png"), dpi=130)
print(f"turn {abs(turn[-1]):.10f}°")
