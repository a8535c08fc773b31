"""The trajectory of the body: the path in space on the left, its coordinates over time on the right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from coadjoint.errors import ArgumentError
from coadjoint.plotting.entries import Entry, require
from coadjoint.plotting.registries import points_down
from coadjoint.plotting.style import COLOURS, COLUMN, PAGE, canvas, legend, time_axis

_SENTENCE = (
    "There is no position to draw: `trajectory` needs additional dynamics q, or a group with translations; "
    "draw `attitude` or `velocities` instead."
)


def trajectory(runs: Sequence[Entry], variable: str | None, z_down: bool | None) -> Figure:
    """The path in three or two dimensions, and every coordinate over time.

    `variable` names the position where there are several; by default q, or x of a group of rigid motions. With
    `z_down` the z axis is drawn pointing down, as in the frames of ships and underwater vehicles, by default where all
    runs are of vehicles.
    """
    z_down = all(points_down(run.dataset) for run in runs) if z_down is None else z_down
    names = [_position(run, variable) for run in runs]
    sizes = {run.values(name).shape[1] for run, name in zip(runs, names, strict=True)}
    if len(sizes) > 1:
        raise ArgumentError(f"Runs in one figure need positions of one dimension, but they have {sorted(sizes)}.")
    size = sizes.pop()
    paths = [(run, run.values(name)) for run, name in zip(runs, names, strict=True)]
    unit = runs[0].unit(names[0])
    labels = [f"${c}$" for c in "xyz"[:size]] if size in (2, 3) else [f"${names[0]}_{{{i + 1}}}$" for i in range(size)]
    if size not in (2, 3):
        figure = canvas(COLUMN, 1.2 * size + 0.5)
        _coordinates(figure, figure, paths, labels, unit, z_down=False)
        return figure
    figure = canvas(PAGE, 3.3)
    halves: Any = figure.subfigures(1, 2, width_ratios=(1.15, 1))
    left, right = halves
    (_space if size == 3 else _plane)(left, paths, labels, unit, z_down)
    _coordinates(figure, right, paths, labels, unit, z_down and size == 3)
    return figure


def _position(run: Entry, variable: str | None) -> str:
    if variable is not None:
        require(run, [variable], f"There is no variable `{variable}` to draw.")
        if run.dataset[variable].ndim != 2:
            raise ArgumentError(f"The variable `{variable}` holds no positions over time, (nodes, components).")
        return variable
    parts = [str(name) for name in run.dataset.data_vars if str(name).startswith("q_")]
    return require(run, ["q", *parts, "x"], _SENTENCE)


def _space(figure: SubFigure, paths: list, labels: list[str], unit: str, z_down: bool) -> None:
    axes: Any = figure.add_subplot(projection="3d")
    for run, path in paths:
        axes.plot(*path[run.thin(path)].T, **run.look)
    for _, path in paths[:1]:
        axes.plot(*path[:1].T, "o", color=COLOURS[-1], markersize=3)
    for letter, label in zip("xyz", labels, strict=True):
        getattr(axes, f"set_{letter}label")(_with_unit(label, unit), labelpad=1 if letter == "z" else -4)
        getattr(axes, f"{letter}axis").set_major_locator(MaxNLocator(4))
        getattr(axes, f"{letter}axis").set_pane_color((1, 1, 1, 0))
        axes.tick_params(axis=letter, pad=2 if letter == "z" else -2, labelsize=7)
    axes.set_box_aspect((1, 1, 1), zoom=0.94)
    axes.view_init(elev=22, azim=-58)
    if z_down:  # with y: without, the picture would be a mirror image, and a turn to starboard one to port
        axes.invert_zaxis()
        axes.invert_yaxis()


def _plane(figure: SubFigure, paths: list, labels: list[str], unit: str, z_down: bool) -> None:
    axes = figure.add_subplot()
    for run, path in paths:
        axes.plot(*path[run.thin(path)].T, **run.look)
    for _, path in paths[:1]:
        axes.plot(*path[:1].T, "o", color=COLOURS[-1], markersize=3)
    axes.set_xlabel(_with_unit(labels[0], unit))
    axes.set_ylabel(_with_unit(labels[1], unit))
    axes.set_aspect("equal", adjustable="datalim")


def _coordinates(figure: Figure, part: Figure | SubFigure, paths, labels: list[str], unit: str, z_down: bool) -> None:
    column = np.atleast_1d(part.subplots(len(labels), 1, sharex=True))
    for component, (axes, label) in enumerate(zip(column, labels, strict=True)):
        for run, path in paths:
            kept = run.thin(path[:, component])
            axes.plot(run.time[kept], path[kept, component], label=run.label, **run.look)
        axes.set_ylabel(_with_unit(label, unit))
        axes.yaxis.set_major_locator(MaxNLocator(5))
    if z_down:
        column[-1].invert_yaxis()
    time_axis(column, [run.time for run, _ in paths])
    legend(figure, *column[0].get_legend_handles_labels())


def _with_unit(label: str, unit: str) -> str:
    return f"{label} ({unit})" if unit else label
