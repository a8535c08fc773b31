"""Variables of a run over time, a panel a variable, a colour a component, a line style a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coadjoint.errors import ArgumentError
from coadjoint.plotting.entries import Entry, require
from coadjoint.plotting.style import COLOURS, COLUMN, canvas, legend, time_axis

WIDTH = 1.25 * COLUMN
"""Space for a column of text next to the panels, with the names of their components."""

_PANEL = 1.9
_LETTERS = 30
"""How many letters a label has along the height of a panel."""
_SYMBOLS = {"xi": r"\xi", "xi_spatial": r"\xi", "nu": r"\nu", "mu": r"\mu", "pi": r"\pi", "qdot": r"\dot q"}


@dataclass(frozen=True)
class Panel:
    """A variable, or the columns `part` of it, under a title."""

    name: str
    title: str
    part: slice = field(default_factory=lambda: slice(None))


def velocities(runs: Sequence[Entry]) -> Figure:
    """ξ and, where there are additional dynamics, ν, in the body frame, or in space of right-invariant systems."""
    return _body(runs, "xi", "nu", "velocity", "No velocities were recorded.")


def momenta(runs: Sequence[Entry]) -> Figure:
    """μ = ∂ℓ/∂ξ and, where there are additional dynamics, π = ∂ℓ/∂ν, in the frame of ξ."""
    return _body(runs, "mu", "pi", "momentum", "No momenta were recorded.")


def _body(runs: Sequence[Entry], first: str, second: str, what: str, sentence: str) -> Figure:
    require(runs[0], [first], sentence)
    frame = "space" if runs[0].dataset.attrs.get("invariance") == "right" else "body"
    if not _rotates(runs[0]):
        shown = [Panel(first, f"{what} ${_SYMBOLS[first]}$, {frame}")]
    else:
        shown = [Panel(first, f"angular {what}, {frame}", slice(0, 3))]
        if runs[0].values(first).shape[1] == 6:
            shown.append(Panel(first, f"linear {what}, {frame}", slice(3, 6)))
    shown += [
        Panel(name, f"{what} ${_SYMBOLS[second]}$, {frame}{_of(name, second)}") for name in _parts(runs[0], second)
    ]
    return panels(runs, shown)


def variable(runs: Sequence[Entry], name: str) -> Figure:
    """Any variable of the datasets; matrices row by row."""
    for run in runs:
        require(run, [name], f"There is no variable `{name}` to draw.")
        if run.dataset[name].dims[:1] != ("time",):
            raise ArgumentError(f"The variable `{name}` does not run over time, so it cannot be drawn.")
    return panels(runs, [Panel(name, fill(str(runs[0].dataset[name].attrs.get("long_name", name)), _LETTERS))])


def panels(runs: Sequence[Entry], shown: Sequence[Panel]) -> Figure:
    """Panels under one time axis; a run that lacks a variable is left out of its panel."""
    figure = canvas(WIDTH, _PANEL * len(shown) + 0.4)
    column = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(column, shown, strict=True):
        for run in runs:
            if panel.name in run.dataset:
                _draw(axes, run, run.values(panel.name), panel.part)
        unit = _unit(runs[0], panel)
        axes.set_ylabel(panel.title + (f"\n({unit})" if unit else ""))
        component_legend(axes, component_labels(runs[0], panel.name)[panel.part])
    time_axis(column, [run.time for run in runs])
    named = [run for run in runs if not run.label.startswith("_")]
    legend(figure, [Line2D([], [], color="#444444", **run.line) for run in named], [run.label for run in named])
    return figure


def _unit(run: Entry, panel: Panel) -> str:
    """The unit of a panel's columns; "rad/s (3), m/s (3)" holds one for every three columns."""
    units = [text.removesuffix(" (3)") for text in run.unit(panel.name).split(", ")]
    return units[min((panel.part.start or 0) // 3, len(units) - 1)] if panel.part.stop else ", ".join(units)


def component_legend(axes: Axes, labels: Sequence[str]) -> None:
    """The legend of colours by component, next to the axes."""
    if len(labels) > 1:
        handles = [Line2D([], [], color=COLOURS[i % len(COLOURS)], label=text) for i, text in enumerate(labels)]
        axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)


def component_labels(run: Entry, name: str) -> list[str]:
    """The components of a variable in mathematical text: by coordinate names, x y z in space, else numbers."""
    array = run.dataset[name]
    if array.ndim == 1:
        return [""]
    shape = array.shape[1:]
    base = name.split("_")[0]
    symbol = _SYMBOLS.get(base, base)
    if array.ndim == 2 and array.dims[1] in array.coords:
        return [str(label) for label in array[array.dims[1]].values]
    if base in ("xi", "mu") and _rotates(run):
        angular, linear = (r"\omega", "v") if base == "xi" else (r"\mu", "p")
        return [f"${s}_{c}$" for s in (angular, linear)[: shape[0] // 3] for c in "xyz"]
    if shape in ((3,), (2,)) and base in ("xi", "nu", "mu", "pi", "n", "q", "qdot", "x", "a") and _spatial(run):
        return [rf"${symbol}_{c}$" for c in "xyz"[: shape[0]]]
    numbers = [",".join(str(i + 1) for i in index) for index in np.ndindex(*shape)]
    return [rf"${symbol}_{{{number}}}$" for number in numbers]


def _spatial(run: Entry) -> bool:
    return str(run.dataset.attrs.get("group", "")).split("(")[0] in ("SO3", "SE3", "Translation")


def _rotates(run: Entry) -> bool:
    """Whether ξ is an angular velocity, with a linear one behind it on SE(3)."""
    return str(run.dataset.attrs.get("group", "")) in ("SO3()", "SE3()")


def _parts(run: Entry, name: str) -> list[str]:
    """`name`, or its parts where Q is a product of named spaces."""
    found = [str(key) for key in run.dataset.data_vars]
    return [key for key in found if key == name or key.startswith(f"{name}_")]


def _of(name: str, base: str) -> str:
    return f", {name[len(base) + 1 :]}" if name != base else ""


def _draw(axes: Axes, run: Entry, values: np.ndarray, part: slice) -> None:
    for component, series in enumerate(values.reshape(len(values), -1)[:, part].T):
        kept = run.thin(series)
        style = {"linewidth": 0.9, **run.line}
        axes.plot(run.time[kept], series[kept], color=COLOURS[component % len(COLOURS)], **style)
