"""Inputs over time against their bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coadjoint import checks
from coadjoint.errors import ArgumentError, shown
from coadjoint.plotting.components import WIDTH, component_legend
from coadjoint.plotting.entries import Entry, tell_apart
from coadjoint.plotting.style import COLOURS, canvas, time_axis

_PANEL, _MARGIN = 1.2, 0.6
_BOUND = {"color": "#888888", "linewidth": 0.8, "linestyle": (0, (4, 3)), "zorder": 0}
_KIND = "inputs_"


def inputs(runs: Sequence[Entry], bounds: Mapping[str, object]) -> Figure:
    """A panel for each input, with a colour for each of its numbers, and dashed bounds."""
    names = _names(runs)
    checks.all_known(checks.mapping(bounds, "bounds", "a dictionary of name → (lower, upper)"), names, "input", "A run")
    figure = canvas(WIDTH, _MARGIN + _PANEL * len(names))
    column = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(column, names, strict=True):
        own = [run for run in runs if _KIND + name in run.dataset]
        for run in own:
            _draw(axes, run, name, getattr(bounds.get(name), "course", "held"))
        for side in _limits(bounds.get(name), name, own[0].values(_KIND + name).shape[1:]):
            axes.axhline(side, **_BOUND)
        unit = own[0].unit(_KIND + name)
        axes.set_ylabel(name.replace("_", " ") + (f" ({unit})" if unit else ""))
        axes.margins(y=0.08)
        component_legend(axes, _numbers(own[0].values(_KIND + name)))
    time_axis(column, [run.time for run in runs])
    tell_apart(figure, runs)
    return figure


def _names(runs: Sequence[Entry]) -> list[str]:
    held = [str(one) for run in runs for one in run.dataset.data_vars]
    found = dict.fromkeys(one.removeprefix(_KIND) for one in held if one.startswith(_KIND))
    if not found:
        raise ArgumentError("There are no inputs to draw: the run has none.")
    return list(found)


def _draw(axes: Axes, run: Entry, name: str, course: str) -> None:
    values = run.values(_KIND + name)
    kind = "default" if course == "linear" else "steps-post"
    for component, series in enumerate(values.reshape(len(values), -1).T):
        kept = run.thin(series)
        colour = COLOURS[component % len(COLOURS)]
        axes.plot(run.time[kept], series[kept], color=colour, drawstyle=kind, **{"linewidth": 0.9, **run.line})


def _numbers(values: np.ndarray) -> list[str]:
    """The names of the numbers of an input, by their indices from 1."""
    return [",".join(str(i + 1) for i in index) for index in np.ndindex(*values.shape[1:])]


def _limits(bound: object, name: str, shape: tuple[int, ...]) -> list[float]:
    """The finite bounds of an input of a shape, each once."""
    if bound is None:
        return []
    sides = (getattr(bound, "lower", None), getattr(bound, "upper", None)) if hasattr(bound, "lower") else bound
    try:
        low, high = (np.broadcast_to(np.asarray(side, float), shape) for side in sides)  # pyright: ignore[reportGeneralTypeIssues]
        found, ordered = np.unique([low, high]), bool(np.all(low <= high))
    except (TypeError, ValueError):
        raise ArgumentError(f"Argument `bounds` must give `{name}` (lower, upper), but gives {shown(bound)}.") from None
    if not ordered:
        raise ArgumentError(f"The lower bounds of `{name}` in `bounds` must not exceed the upper ones: {shown(bound)}.")
    return [float(side) for side in found if np.isfinite(side)]
