"""Figures of an identification: what was measured against what the simulation says, and the intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.plotting.style import COLOURS, PAGE, PlotFigure, canvas, legend, style, time_axis

if TYPE_CHECKING:
    from coadjoint.identification.findings import Identification


def measured_and_simulated(found: Identification, columns: Sequence[str] | None = None) -> PlotFigure:
    """Every column as points, with the simulation of the segments as a line; two panels a row.

    Raises ArgumentError for columns that the log does not hold.
    """
    names = list(found.simulated) if columns is None else list(columns)
    unknown = [name for name in names if name not in found.simulated]
    if unknown or not names:
        raise ArgumentError(f"The log has no column `{(unknown or [''])[0]}`; it has {', '.join(found.simulated)}.")
    rows = -(-len(names) // 2)
    with style():
        figure = canvas(PAGE, 1.15 * rows + 0.4)
        panels = figure.subplots(rows, min(2, len(names)), squeeze=False, sharex=True)
        for axes, name in zip(panels.flat, names, strict=False):
            unit = found.log.units.get(name, "")
            angle = unit.startswith("rad")
            factor = 180 / np.pi if angle else 1.0
            measured, simulated = found.log.columns[name], found.simulated[name]
            if unit == "rad":
                simulated = measured + (simulated - measured + np.pi) % (2 * np.pi) - np.pi
                # The pen is lifted where an angle goes round.
                simulated = np.where(np.abs(np.diff(simulated, append=simulated[-1:])) > np.pi, np.nan, simulated)
            axes.plot(found.log.time, factor * measured, ".", ms=1.6, color=COLOURS[5], label="measured")
            axes.plot(found.log.time, factor * simulated, "-", lw=0.8, color=COLOURS[6], label="simulated")
            shown = unit.replace("rad", "°") if angle else unit
            axes.set_ylabel(f"{name} ({shown})" if shown else name)
        for axes in list(panels.flat)[len(names) :]:
            axes.set_visible(False)
        legend(figure, *panels.flat[0].get_legend_handles_labels())
        for column in panels.T:
            time_axis(column, [found.log.time])
    return figure
