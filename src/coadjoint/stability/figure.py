"""Growth rates against speed, and the root locus."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.plotting import style
from coadjoint.stability.analysis import Stability


def stability_figure(
    values: Sequence[float], found: Sequence[Stability], label: str = "speed (m/s)"
) -> style.PlotFigure:
    """Re λ of all modes against a value such as the speed, and λ in the complex plane.

    values, found: as many; `label` names the value. Modes above the line grow. Raises ArgumentError for none.
    """
    if not found or len(values) != len(found):
        raise ArgumentError(f"A figure of stability takes as many values as motions, got {len(values)}, {len(found)}.")
    with style.style():
        figure = style.canvas(style.PAGE, 2.9)
        growth, plane = figure.subplots(1, 2)
        roots = [(v, mode.eigenvalue) for v, one in zip(values, found, strict=True) for mode in one.modes]
        where = np.array([v for v, _ in roots])
        eigenvalues: Any = np.array([root for _, root in roots])
        real = eigenvalues.imag == 0
        for mask, marker, filled, name in ((real, "o", True, "real"), (~real, "o", False, "oscillating")):
            growth.scatter(
                where[mask], eigenvalues.real[mask], s=9, marker=marker, linewidths=0.8, label=name,
                facecolors=style.COLOURS[0] if filled else "none", edgecolors=style.COLOURS[0 if filled else 1],
            )  # fmt: skip
        growth.axhline(0, color="black", linewidth=0.7)
        growth.set(xlabel=label, ylabel="Re λ (1/s)")
        growth.legend(loc="best")
        colours = matplotlib.colormaps["viridis"]
        for sign in (1, -1):
            drawn = plane.scatter(eigenvalues.real, sign * eigenvalues.imag, c=where, s=9, cmap=colours)
        plane.axvline(0, color="black", linewidth=0.7)
        plane.set(xlabel="Re λ (1/s)", ylabel="Im λ (1/s)")
        if len(set(values)) > 1:
            figure.colorbar(drawn, ax=plane, label=label)
    return figure
