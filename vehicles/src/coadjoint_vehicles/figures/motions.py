"""How a vehicle moves: its angles with their set points, its speeds and rates in body axes, the current it feels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.textpath import TextPath

from coadjoint.errors import ArgumentError
from coadjoint.plotting.entries import Entry, tell_apart
from coadjoint.plotting.style import COLOURS, COLUMN, DASHES, canvas, time_axis
from coadjoint.texts import Table
from coadjoint_vehicles.figures.navigation import draw_wanted
from coadjoint_vehicles.logs.records import VehicleRecords

_LETTERS, _HANDLE, _ROOM = 7.5, 22.5, 208.0
"""Of a key, in points: the size of its letters, the space for a line and its gaps, the width of a panel."""


def speeds(runs: Sequence[Entry]) -> Figure:
    """Surge, sway and heave through the water with the set point of speed, and the rates of roll, pitch and yaw."""
    figure = canvas(COLUMN, 3.8)
    above, below = figure.subplots(2, 1, sharex=True)
    draw_speeds(above, runs)
    draw_rates(below, runs)
    finish(figure, [above, below], runs)
    return figure


def current(runs: Sequence[Entry]) -> Figure:
    """The velocity of the water where the vehicle is, north, east and down."""
    for run in runs:
        if VehicleRecords(run.dataset).current is None:
            raise ArgumentError(f"There is no current to draw: the run of {run.label} is in still water.")
    figure = canvas(COLUMN, 2.3)
    axes = figure.subplots()
    draw_current(axes, runs)
    finish(figure, [axes], runs)
    return figure


def draw_speeds(axes: Axes, runs: Sequence[Entry]) -> None:
    """Surge, sway and heave through the water on these axes."""
    for run in runs:
        log = VehicleRecords(run.dataset)
        if run is runs[0]:
            draw_wanted(axes, run, log, "speed")
        draw_components(axes, run, log.through_water)
    has_current = any(VehicleRecords(run.dataset).current is not None for run in runs)
    axes.set_ylabel("speed through\nthe water (m/s)" if has_current else "speed (m/s)")
    key(axes, ("surge $u$", "sway $v$", "heave $w$"))


def draw_rates(axes: Axes, runs: Sequence[Entry]) -> None:
    """The rates of roll, pitch and yaw, body axes, in °/s."""
    for run in runs:
        draw_components(axes, run, np.degrees(VehicleRecords(run.dataset).rates))
    axes.set_ylabel("rate (°/s)")
    key(axes, ("roll $p$", "pitch $q$", "yaw $r$"))


def draw_angles(axes: Axes, runs: Sequence[Entry]) -> None:
    """Roll, pitch and heading in degrees, the heading counted on through full turns, with its set point."""
    for run in runs:
        log = VehicleRecords(run.dataset)
        angles = np.degrees(np.column_stack([log.attitude[:, :2], np.unwrap(log.attitude[:, 2])]))
        if run is runs[0]:
            draw_wanted(axes, run, log, "heading", 180 / np.pi, angles[:, 2])
        draw_components(axes, run, angles)
    axes.set_ylabel("angle (°)")
    key(axes, ("roll", "pitch", "heading"))


def draw_current(axes: Axes, runs: Sequence[Entry]) -> None:
    """The velocity of the water in space."""
    for run in runs:
        water = VehicleRecords(run.dataset).current
        if water is not None:
            draw_components(axes, run, water)
    axes.set_ylabel("current (m/s)")
    key(axes, ("north", "east", "down"))


def draw_components(axes: Axes, run: Entry, values: np.ndarray, first: int = 0) -> None:
    """A curve for each column, a colour a component from `first` on, a line style a run."""
    for component, series in enumerate(values.T, start=first):
        kept = run.thin(series)
        axes.plot(run.time[kept], series[kept], **{"linewidth": 0.9, **run.line, **_look(component)})


def _look(component: int) -> Table:
    """The colour of a component; beyond the last colour with a dash, too."""
    round_, place = divmod(component, len(COLOURS))
    return {"color": COLOURS[place], **({"linestyle": DASHES[round_ % len(DASHES)]} if round_ else {})}


def key(axes: Axes, labels: Sequence[str]) -> None:
    """The key of components and set points above the axes, in as few lines as possible."""
    handles = [Line2D([], [], label=text, **_look(i)) for i, text in enumerate(labels)]
    others = {str(line.get_label()): line for line in axes.get_lines() if not str(line.get_label()).startswith("_")}
    axes.yaxis.get_offset_text().set_horizontalalignment("right")  # a power of ten is next to the key, not in it
    axes.legend(
        handles=[*handles, *others.values()],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=_columns([*labels, *others]),
        borderaxespad=0.1,
        handlelength=1.2,
        columnspacing=1.0,
    )


def _columns(labels: Sequence[str]) -> int:
    """The most columns of a key that stay within the width of a panel."""
    widths = [TextPath((0, 0), text, size=_LETTERS).get_extents().width + _HANDLE for text in labels]
    for count in range(len(labels), 1, -1):
        # A key is filled column by column.
        if sum(max(column) for column in np.array_split(widths, count)) <= _ROOM:
            return count
    return 1


def finish(figure: Figure, column: Sequence[Axes], runs: Sequence[Entry]) -> None:
    """The time axis, and which line style is which run where there are several."""
    time_axis(column, [run.time for run in runs])
    tell_apart(figure, runs)
