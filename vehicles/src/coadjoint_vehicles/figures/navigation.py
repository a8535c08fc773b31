"""Where a vehicle goes: the track seen from above, north up, and the depth, downwards, with its set point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coadjoint.plotting.entries import Entry, fewest
from coadjoint.plotting.style import COLUMN, WANTED, canvas, legend, time_axis
from coadjoint.texts import Table
from coadjoint_vehicles.logs.records import VehicleRecords


def track(runs: Sequence[Entry], way_points: np.ndarray | None = None) -> Figure:
    """The path seen from above, north up, with its start, its end and its way points."""
    figure = canvas(COLUMN, COLUMN)
    axes = figure.subplots()
    draw_track(axes, runs, way_points)
    named = [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]
    legend(figure, named, [str(line.get_label()) for line in named], fewest(runs))
    return figure


def depth(runs: Sequence[Entry]) -> Figure:
    """The depth over time, drawn downwards, and its set point."""
    figure = canvas(COLUMN, 2.3)
    axes = figure.subplots()
    draw_depth(axes, runs)
    time_axis([axes], [run.time for run in runs])
    legend(figure, *axes.get_legend_handles_labels(), fewest(runs))
    return figure


def draw_track(axes: Axes, runs: Sequence[Entry], way_points: np.ndarray | None = None) -> None:
    """The path on these axes; `way_points` (k, 2) or (k, 3), north, east, …, m, by default those of the runs."""
    logs = [VehicleRecords(run.dataset) for run in runs]
    points = logs[0].way_points if way_points is None else np.asarray(way_points, dtype=float)
    if len(points):
        start = logs[0].position[:1, :2]
        legs = np.concatenate([start, points[:, :2]])
        axes.plot(
            legs[:, 1], legs[:, 0], label="way points", marker="s", markersize=3, markevery=slice(1, None), **WANTED
        )
        for number, (north, east, *_) in enumerate(points, start=1):
            axes.annotate(str(number), (east, north), (4, 4), textcoords="offset points", fontsize=6.5)
    for run, log in zip(runs, logs, strict=True):
        path = log.position[run.thin(log.position)]
        axes.plot(path[:, 1], path[:, 0], label=_label(runs, run, "track"), **run.look)
    for log in logs:
        axes.plot(log.position[0, 1], log.position[0, 0], "o", color="black", markersize=4, zorder=3)
    ends: Table = {"marker": "x", "color": "black", "markersize": 4, "linestyle": "none", "zorder": 3}
    if not any(run.crowd > 1 for run in runs):
        for log in logs:
            axes.plot(log.position[-1, 1], log.position[-1, 0], **ends)
    axes.set(xlabel="east (m)", ylabel="north (m)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)


def draw_depth(axes: Axes, runs: Sequence[Entry]) -> None:
    """The depth on these axes, and the set point `depth` where there is one."""
    for run in runs:
        log = VehicleRecords(run.dataset)
        if run is runs[0]:
            draw_wanted(axes, run, log, "depth")
        kept = run.thin(log.depth)
        axes.plot(run.time[kept], log.depth[kept], label=_label(runs, run, "depth"), **run.look)
    axes.set_ylabel("depth (m)")
    axes.invert_yaxis()


def _label(runs: Sequence[Entry], run: Entry, alone: str) -> str:
    return alone if len(runs) == 1 else run.label


def draw_wanted(
    axes: Axes, run: Entry, log: VehicleRecords, name: str, factor: float = 1.0, near: np.ndarray | None = None
) -> None:
    """The set point `name` as steps, where the run has one of one number; of angles by full turns (°) to `near`."""
    if name not in log.set_points or log.set_points[name][0].ndim != 1:
        return
    values = factor * log.set_points[name][0]
    if near is not None:
        values = values + _turns(values, near)
    kept = run.thin(values)
    axes.step(run.time[kept], values[kept], where="post", label="set point", **WANTED)


def _turns(wanted: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """The full turns (°) from a set point to the heading reached when it ended, constant while it stays."""
    starts = np.flatnonzero(np.diff(wanted, prepend=np.nan))
    lengths = np.diff(starts, append=len(wanted))
    ends = starts + lengths - 1
    return np.repeat(360 * np.round((reached[ends] - wanted[ends]) / 360), lengths)
