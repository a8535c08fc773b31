"""The stage of a film of any system: its path in space or its axes on a sphere, and its coordinates over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from coadjoint.plotting.decimation import thin
from coadjoint.plotting.entries import Entry, require
from coadjoint.plotting.style import COLOURS, PAGE, canvas, time_axis

MOST = 8
"""The most runs of a film."""
PLACES = ("q", "x", "n")
SERIES = (*PLACES, "euler_angles", "mu", "xi", "pi", "discrete_energy")
"""Variables over time, of which the first one that a run has is shown."""


def stage(runs: Sequence[Entry]) -> tuple[Figure, list[_Trace]]:
    """A figure with what stands still, and the traces that move."""
    figure = canvas(PAGE, 3.3)
    shown = runs[:MOST]
    place = next((name for name in PLACES if all(_dimension(run, name) in (2, 3) for run in shown)), "")
    turned = not place and all(_rotates(run) for run in shown)
    series = next((name for name in SERIES if all(name in run.dataset for run in shown)), "")
    name = require(shown[0], [series or "mu"], "There is nothing over time to animate in this run.")
    halves: Any = figure.subfigures(1, 2) if place or turned else [None, figure]
    traces = [trace for run in shown for trace in _in_space(halves[0], run, place, turned)] if place or turned else []
    axes = halves[1].subplots()
    time_axis([axes], [run.time for run in shown])
    axes.set_ylabel(f"{name} ({shown[0].unit(name)})" if shown[0].unit(name) else name)
    for run in shown:
        rows = run.values(name).reshape(len(run.time), -1)
        for column, colour in zip(rows.T, _colours(run, len(shown)), strict=False):
            traces.append(_Trace(figure, axes, run.time, np.stack([run.time, column], axis=1), colour))
    return figure, traces


def _colours(run: Entry, runs: int) -> Sequence[str]:
    """The colours of the components of one run; of several each has its own colour."""
    return COLOURS if runs == 1 else [COLOURS[run.place % len(COLOURS)]] * len(COLOURS)


def _dimension(run: Entry, name: str) -> int:
    return run.values(name).shape[1] if name in run.dataset and run.values(name).ndim == 2 else 0


def _rotates(run: Entry) -> bool:
    return "R" in run.dataset and run.values("R").shape[1:] in ((2, 2), (3, 3))


def _in_space(figure: Any, run: Entry, place: str, turned: bool) -> list[_Trace]:
    """The path of a place, or those of the tips of the axes of a rotation."""
    paths = [run.values(place)] if place else list(np.moveaxis(run.values("R"), 2, 0))
    size = paths[0].shape[1]
    axes: Any = figure.axes[0] if figure.axes else figure.add_subplot(projection="3d" if size == 3 else None)
    if turned:
        getattr(axes, "set_box_aspect", axes.set_aspect)((1, 1, 1) if size == 3 else 1)
        axes.set(xlim=(-1, 1), ylim=(-1, 1), **({"zlim": (-1, 1)} if size == 3 else {}))
    elif size == 2:
        axes.set_aspect("equal", adjustable="datalim")
    for letter in "xyz"[:size]:
        getattr(axes, f"set_{letter}label")(f"${letter}$")
        getattr(axes, f"{letter}axis").set_major_locator(MaxNLocator(4))
    colours = COLOURS if turned else [COLOURS[run.place % len(COLOURS)]]
    return [
        _Trace(axes.figure, axes, run.time, path, colour, spoke=turned)
        for path, colour in zip(paths, colours, strict=False)
    ]


class _Trace:
    """A pale curve, bright up to now, with a dot, and a spoke from the origin if it turns."""

    def __init__(self, figure: Any, axes: Any, time: np.ndarray, points: np.ndarray, colour: str, spoke: bool = False):
        self.axes, self.time, self.points, self.spoke = axes, time, points, spoke
        self.kept = thin(*points.T)
        axes.plot(*points[self.kept].T, color=colour, alpha=0.25)
        empty = [[]] * points.shape[1]
        (self.path,) = axes.plot(*empty, color=colour, animated=True)
        (self.dot,) = axes.plot(*empty, "o-", color=colour, markersize=4, markevery=[-1], animated=True)

    def draw(self, t: float) -> None:
        """Draw the curve up to time t; after its end all of it."""
        now = int(np.clip(np.searchsorted(self.time, t), 0, len(self.time) - 1))
        so_far = self.points[np.append(self.kept[self.kept < now], now)]
        end = np.stack([np.zeros_like(so_far[-1]), so_far[-1]]) if self.spoke else so_far[-1:]
        for line, points in ((self.path, so_far), (self.dot, end)):
            (line.set_data_3d if points.shape[1] == 3 else line.set_data)(*points.T)
            self.axes.draw_artist(line)
