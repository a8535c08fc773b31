"""A picture of an episode: the track over ground and the depth, with the vehicle as an arrow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.markers import MarkerStyle
from matplotlib.transforms import Affine2D

from coadjoint.plotting.style import COLOURS, WANTED, canvas, style

WIDTH, HEIGHT, DOTS = 7.2, 3.4, 100
"""In inches, and dots in each."""


class PoseAt(NamedTuple):
    """Where a vehicle was: t, s; q, (3,) m; R, (3, 3)."""

    t: float
    position: np.ndarray
    rotation: np.ndarray


def picture(poses: Sequence[PoseAt], goal: np.ndarray, until: float) -> np.ndarray:
    """The track of `poses` so far, (340, 720, 3) of 0 to 255. goal: points of the task, (k, 3) m. until: s."""
    north, east, depth = np.array([pose.position for pose in poses]).T
    times, R = [pose.t for pose in poses], poses[-1].rotation
    heading, pitch = np.arctan2(R[1, 0], R[0, 0]), -np.arcsin(np.clip(R[2, 0], -1.0, 1.0))
    with style():
        figure = canvas(WIDTH, HEIGHT)
        figure.set_dpi(DOTS)
        above, side = figure.subplots(1, 2)
        above.plot(goal[:, 1], goal[:, 0], marker="+", **WANTED)
        above.set(xlabel="east (m)", ylabel="north (m)")
        for level in goal[-1:, 2]:
            side.axhline(level, **WANTED)
        side.set(xlabel="time (s)", ylabel="depth (m)", xlim=(times[0], times[0] + until))
        _draw(above, east, north, -heading)
        _draw(side, np.array(times), depth, pitch - np.pi / 2)
        ends = [_room(np.append(x, y)) for x, y in zip((east, north, depth), goal.T[[1, 0, 2]], strict=True)]
        half = max(0.5 * (high - low) for low, high in ends[:2])
        x, y = (0.5 * (low + high) for low, high in ends[:2])
        above.set(xlim=(x - half, x + half), ylim=(y - half, y + half), aspect="equal")
        side.set_ylim(ends[2][::-1])
        figure.canvas.draw()
        return np.asarray(figure.canvas.buffer_rgba())[..., :3].copy()  # pyright: ignore[reportAttributeAccessIssue]


def _draw(axes: Axes, x: np.ndarray, y: np.ndarray, turn: float) -> None:
    axes.plot(x, y, color=COLOURS[0])
    arrow = MarkerStyle([(0, 1.3), (-0.5, -0.9), (0, -0.55), (0.5, -0.9)], transform=Affine2D().rotate(turn))
    axes.plot(x[-1:], y[-1:], marker=arrow, markersize=13, color=COLOURS[0])


def _room(values: np.ndarray) -> tuple[float, float]:
    """The ends of an axis with a margin around all values."""
    middle, half = 0.5 * (values.min() + values.max()), 0.6 * (values.max() - values.min())
    return middle - max(half, 1.0), middle + max(half, 1.0)
