"""The energy budget: sources and sinks of the energy, and the gap in their sum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coadjoint.plotting.components import WIDTH
from coadjoint.plotting.entries import Entry, require, tell_apart
from coadjoint.plotting.style import COLOURS, canvas, time_axis

_HEIGHT = 3.6
_STORED, _WIDE = "stored", 2.4
_DARK = "#222222"


def budget(runs: Sequence[Entry]) -> Figure:
    """E − E₀ and the energy that each force has put in; below, the gap |E − E₀ − ΣW| on a logarithmic axis."""
    for run in runs:
        require(run, ["energy_budget"], "No energy budget was recorded: no force acts, or monitors=False.")
    lines = list(dict.fromkeys(name for run in runs for name in _lines(run)))
    figure = canvas(WIDTH, _HEIGHT)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    for run in runs:
        stored = run.values(require(run, ["energy", "discrete_energy"], "No energy was recorded."))
        curves = {_STORED: stored - stored[0], **{name: run.values(name) for name in _lines(run)}}
        for name, values in curves.items():
            kept = run.thin(values)
            # One force alone puts in all that is stored: its line lies on a wider one.
            wide = {"linewidth": _WIDE, "alpha": 0.5} if name == _STORED and run.crowd == 1 else {}
            above.plot(run.time[kept], values[kept], color=_colour(name, lines), **{**run.line, **wide})
        gap = np.abs(run.values("energy_budget") - run.values("energy_budget")[0])
        positive = np.flatnonzero(gap > 0)
        kept = positive[run.thin(np.log(gap[positive]))] if len(positive) else positive
        below.plot(run.time[kept], gap[kept], color=_DARK, **run.line)
    unit = runs[0].unit("energy_budget")
    above.set_ylabel("energy since the start" + (f" ({unit})" if unit else ""))
    below.set_ylabel("gap" + (f" ({unit})" if unit else ""))
    _logarithmic(below)
    shown = {_STORED: _STORED, **{name: name.removeprefix("work_").replace("_", " ") for name in lines}}
    handles = [Line2D([], [], color=_colour(name, lines), label=text) for name, text in shown.items()]
    handles[0].set_linewidth(_WIDE)
    above.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)
    time_axis([above, below], [run.time for run in runs])
    tell_apart(figure, runs)
    return figure


def _lines(run: Entry) -> list[str]:
    return [str(name) for name in run.dataset.data_vars if str(name).startswith("work_")]


def _colour(name: str, lines: Sequence[str]) -> str:
    return _DARK if name == _STORED else COLOURS[list(lines).index(name) % len(COLOURS)]


def _logarithmic(axes: Axes) -> None:
    """A logarithmic axis over a decade at least, so that a nearly constant gap does not look wild."""
    axes.set_yscale("log")
    heights = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()])
    if len(heights):
        high = 2 * np.max(heights)
        axes.set_ylim(min(np.min(heights) / 2, high / 10), high)
