"""The figures of an audit: error against step, and energy error over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coadjoint.audit.findings import Audit, Cell
from coadjoint.plotting.style import COLOURS, DASHES, PAGE, canvas, legend, style

BINS = 50
MAP = "Cayley"


def order_figure(audit: Audit) -> Figure:
    """Error at the end against h, a panel a system."""

    def draw(axes: Axes, cell: Cell, look: dict) -> None:
        if cell.convergence is None:
            return
        h, error, fitted, _ = cell.convergence
        shown = np.isfinite(error) & (error > 0)
        axes.loglog(h[shown], error[shown], lw=0.8, label=cell.method, **look)
        axes.loglog(h[fitted], error[fitted], "o", ms=2.2, color=look["color"])

    return _panels(audit, draw, "step $h$ (s)", "relative error at the end")


def energy_figure(audit: Audit) -> Figure:
    """The largest energy error of each fiftieth of the long runs against time, a panel a system."""

    def draw(axes: Axes, cell: Cell, look: dict) -> None:
        if cell.long_run is None:
            return
        times = [part[-1] for part in np.array_split(cell.long_run.times, BINS)]
        largest = np.array([part.max() for part in np.array_split(cell.long_run.energy_error, BINS)])
        axes.semilogy(times, np.maximum(largest, 1e-17), lw=0.9, label=cell.method, **look)

    kept = Audit(tuple(cell for cell in audit.cells if cell.long_run is not None), audit.seconds)
    return _panels(kept, draw, "time $t$ (s)", "relative energy error")


def _panels(audit: Audit, draw: Callable[[Axes, Cell, dict], None], across: str, up: str) -> Figure:
    systems = list(dict.fromkeys(cell.system for cell in audit.cells))
    looks = _looks(list(dict.fromkeys(cell.method for cell in audit.cells)))
    maps = {cell.map for cell in audit.cells}
    chosen = MAP if MAP in maps else sorted(maps)[0]
    columns = 2 if len(systems) == 4 else min(len(systems), 3)
    lines = -(-len(systems) // columns)
    with style():
        figure = canvas(PAGE, 0.6 + 2.0 * lines)
        panels = figure.subplots(lines, columns, squeeze=False).ravel()
        for axes, system in zip(panels, systems, strict=False):
            axes.set_title(system)
            for cell in audit.cells:
                if cell.system == system and cell.map == chosen:
                    draw(axes, cell, looks[cell.method])
        for axes in panels[len(systems) :]:
            axes.set_axis_off()
        for axes in panels[max(len(systems) - columns, 0) : len(systems)]:
            axes.set_xlabel(across)
        for axes in panels[: len(systems) : columns]:
            axes.set_ylabel(up)
        handles, labels = panels[0].get_legend_handles_labels()
        legend(figure, handles, labels)
        figure.draw_without_rendering()
    return figure


def _looks(methods: Sequence[str]) -> dict[str, dict]:
    """A colour and a line style for every method."""
    return {
        method: {"color": COLOURS[i % len(COLOURS)], "linestyle": DASHES[(i // len(COLOURS)) % len(DASHES)]}
        for i, method in enumerate(methods)
    }
