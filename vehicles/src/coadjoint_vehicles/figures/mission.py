"""A vehicle's run on one page: track and depth, angles, speeds, rates, actuators, energy, current."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from coadjoint.plotting.entries import Entry, tell_apart
from coadjoint.plotting.style import COLOURS, PAGE, canvas, time_axis
from coadjoint_vehicles.figures import actuators, motions, navigation
from coadjoint_vehicles.logs.records import VehicleRecords

_PANEL = 1.55

Draw = Callable[[Axes, Sequence[Entry]], None]


def mission(runs: Sequence[Entry], way_points: np.ndarray | None = None) -> Figure:
    """The complete run on a page."""
    left: list[Draw] = [motions.draw_speeds, motions.draw_rates]
    right: list[Draw] = [navigation.draw_depth, motions.draw_angles]
    left += [motions.draw_current] if any(VehicleRecords(run.dataset).current is not None for run in runs) else []
    right += [_actuators(names) for names in actuators.by_unit(runs)]
    for draw in [draw_energy] if VehicleRecords(runs[0].dataset).work else []:
        (left if len(left) + 2 <= len(right) else right).append(draw)
    rows = max(len(left) + 2, len(right))
    figure = canvas(PAGE, _PANEL * rows + 0.5)
    if len(runs) == 1:
        figure.suptitle(_title(runs[0]), fontsize=9)
    halves: Any = figure.subfigures(1, 2)
    # The track takes the rest of its column.
    high = rows - len(left)
    first, *column = halves[0].subplots(len(left) + 1, 1, height_ratios=[high, *[1] * len(left)])
    navigation.draw_track(first, runs, way_points)
    other = list(np.atleast_1d(halves[1].subplots(len(right), 1, sharex=True)))
    for axes, draw in [*zip(column, left, strict=True), *zip(other, right, strict=True)]:
        draw(axes, runs)
    ticks = _ticks(runs)
    for panels in (column, other):
        time_axis(panels, [run.time for run in runs])
        for axes in panels:
            axes.set_xticks(ticks)
        for axes in panels[:-1]:
            axes.tick_params(labelbottom=False)
    tell_apart(figure, runs)
    return figure


def draw_energy(axes: Axes, runs: Sequence[Entry]) -> None:
    """The energy that each part has put in since the start, in kJ where it is much."""
    largest = max(
        (np.max(np.abs(work)) for run in runs for work in VehicleRecords(run.dataset).work.values()), default=0.0
    )
    factor, unit = (1e-3, "kJ") if largest > 5000 else (1.0, "J")
    names = list(dict.fromkeys(name for run in runs for name in VehicleRecords(run.dataset).work))
    for run in runs:
        work = VehicleRecords(run.dataset).work
        for number, name in enumerate(names):
            if name in work:
                kept = run.thin(work[name])
                axes.plot(run.time[kept], factor * work[name][kept], color=COLOURS[number % len(COLOURS)], **run.line)
    axes.set_ylabel(f"energy put in ({unit})")
    motions.key(axes, [name.replace("_", " ") for name in names])


def _ticks(runs: Sequence[Entry]) -> np.ndarray:
    """The times that both columns mark: round ones within the longest run."""
    low, high = min(float(run.time[0]) for run in runs), max(float(run.time[-1]) for run in runs)
    found = np.asarray(MaxNLocator(nbins=6, steps=[1, 2, 3, 5, 6, 10]).tick_values(low, high))
    return found[(found >= low) & (found <= high)]


def _actuators(names: Sequence[str]) -> Draw:
    return lambda axes, runs: actuators.draw_actuators(axes, runs, names)


def _title(run: Entry) -> str:
    attrs = run.dataset.attrs
    h = f"h = {float(attrs['dt']):g} s" if "dt" in attrs else ""
    method = str(attrs.get("method", "")).replace("()", "")
    return ", ".join(filter(None, [str(attrs.get("system", "")), method, h, f"{run.time[-1]:g} s"]))
