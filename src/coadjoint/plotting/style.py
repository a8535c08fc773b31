"""The style of all figures: column widths, colours that colour-blind readers distinguish, no pyplot."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from coadjoint.disk import atomic_file
from coadjoint.errors import ArgumentError

COLUMN = 3.5
"""Width of a figure in one column of a journal, in inches."""
PAGE = 7.2
"""Width of a figure over both columns, in inches."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B87900", "#2B8CC4", "#000000")
"""Okabe and Ito's palette (2008) without its yellow; orange and sky blue are darkened to a contrast of 3 on white."""
DASHES = ("-", (0, (4, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
"""Line styles that distinguish curves which coincide or are printed in grey."""

WANTED: dict[str, Any] = {"color": "#555555", "linestyle": (0, (4, 2)), "linewidth": 0.8, "zorder": 1.5}
"""The style of set points and commands."""

_SETTINGS: Any = {
    "figure.dpi": 300,
    "savefig.dpi": 300,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "mathtext.fontset": "dejavusans",
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.1,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
}


class PlotFigure(Figure):
    """A matplotlib Figure that notebooks show without pyplot, outside its global state."""

    def _repr_png_(self) -> bytes:
        stream = BytesIO()
        with style():
            self.savefig(stream, format="png", dpi=150)
        return stream.getvalue()


@contextmanager
def style() -> Iterator[None]:
    """The shared settings while a figure is made or written; afterwards the user's own are restored."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        yield


def canvas(width: float, height: float) -> PlotFigure:
    """An empty figure (inches) with constrained layout."""
    figure = PlotFigure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def legend(figure: Figure, handles: Sequence[Artist], labels: Sequence[str], least: int = 2) -> None:
    """A legend above the axes, where it hides nothing, if there are at least so many curves to distinguish."""
    if len(handles) < least:
        return
    longest = max(map(len, labels))
    columns = min(max(int(figure.get_figwidth() / (0.5 + 0.065 * longest)), 1), len(handles))
    rows = -(-len(handles) // columns)
    figure.set_figheight(figure.get_figheight() + 0.16 * rows)
    figure.legend(handles, labels, loc="outside upper center", ncols=columns)


def time_axis(column: Iterable[Axes], times: Sequence[np.ndarray]) -> None:
    """One time axis under a column of panels, exactly as long as the longest run."""
    column = list(column)
    low, high = min(float(t[0]) for t in times), max(float(t[-1]) for t in times)
    if high > low:
        for axes in column:
            axes.set_xlim(low, high)
    column[-1].set_xlabel("time $t$ (s)")


def svg(figure: Figure) -> str:
    """A figure as SVG text, with letters as outlines, the same each time."""
    stream = BytesIO()
    with style(), matplotlib.rc_context({"svg.fonttype": "path", "svg.hashsalt": "coadjoint"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return stream.getvalue().decode()


def save(figure: Figure, path: str | os.PathLike[str], dpi: int | None = None) -> Path:
    """Write a figure atomically, in the format of the name's ending; raises ArgumentError, FileError.

    `dpi`: dots an inch of a picture, by default those of print.
    """
    target = Path(path)
    ending = target.suffix.lstrip(".").lower()
    known = figure.canvas.get_supported_filetypes()
    if ending not in known:
        raise ArgumentError(
            f"A figure's file must end in {', '.join('.' + name for name in sorted(known))}, but is {target.name}."
        )
    with atomic_file(target) as temporary, style(), laid_out(figure, ending == "png" and dpi in (None, figure.dpi)):
        figure.savefig(temporary, format=ending, dpi=dpi or "figure")
    return target


@contextmanager
def laid_out(figure: Figure, once: bool) -> Iterator[None]:
    """The layout, computed `once` for the files written inside; matplotlib draws everything a second time for it."""
    engine = figure.get_layout_engine()
    if engine is None or not once:
        yield
        return
    engine.execute(figure)
    figure.set_layout_engine(None)  # as the settings of `style` have it: none
    try:
        yield
    finally:
        figure.set_layout_engine(engine)
