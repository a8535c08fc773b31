"""Figures of an identification: measurements against the simulation, and innovations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from coadjoint import checks
from coadjoint.identification.log import Log
from coadjoint.plotting.style import COLOURS, PAGE, PlotFigure, canvas, legend, style, time_axis

LAGS = 30
"""The lags of an autocorrelation."""


def measured_and_simulated(
    log: Log, simulated: Mapping[str, np.ndarray], columns: Sequence[str] | None = None
) -> PlotFigure:
    """Every column as points, with the simulation of the segments as a line; two panels a row.

    Raises ArgumentError for columns that the log does not hold.
    """
    names = _names(simulated, columns)
    rows = -(-len(names) // 2)
    with style():
        figure = canvas(PAGE, 1.15 * rows + 0.4)
        panels = figure.subplots(rows, min(2, len(names)), squeeze=False, sharex=True)
        for axes, name in zip(panels.flat, names, strict=False):
            unit = log.units.get(name, "")
            angle = unit.startswith("rad")
            factor = 180 / np.pi if angle else 1.0
            measured, values = log.columns[name], simulated[name]
            if unit == "rad":
                values = measured + (values - measured + np.pi) % (2 * np.pi) - np.pi
                # The line breaks where an angle wraps.
                values = np.where(np.abs(np.diff(values, append=values[-1:])) > np.pi, np.nan, values)
            if log.breaks:  # The line breaks between runs, too.
                values = values.copy()
                values[np.array(log.breaks) - 1] = np.nan
            axes.plot(log.time, factor * measured, ".", ms=1.6, color=COLOURS[5], label="measured")
            axes.plot(log.time, factor * values, "-", lw=0.8, color=COLOURS[6], label="simulated")
            shown = unit.replace("rad", "°") if angle else unit
            axes.set_ylabel(f"{name} ({shown})" if shown else name)
        for axes in list(panels.flat)[len(names) :]:
            axes.set_visible(False)
        legend(figure, *panels.flat[0].get_legend_handles_labels())
        for column in panels.T:
            seen = [axes for axes in column if axes.get_visible()]
            time_axis(seen, [log.time])
            seen[-1].xaxis.set_tick_params(labelbottom=True)
    return figure


def autocorrelation_and_histogram(
    innovations: Mapping[str, np.ndarray], columns: Sequence[str] | None = None
) -> PlotFigure:
    """Innovations of every column: autocorrelation with the band that holds 95 % of white noise, ±1.96/√N, and
    histogram with the density of the normal distribution assumed for the noise.

    Raises ArgumentError for columns that the log does not hold.
    """
    names = _names(innovations, columns)
    with style():
        figure = canvas(PAGE, 1.1 * len(names) + 0.5)
        panels = figure.subplots(len(names), 2, squeeze=False, sharex="col")
        x = np.linspace(-4, 4, 161)
        for (left, right), name in zip(panels, names, strict=True):
            w = innovations[name]
            rho, count = autocorrelation(w, LAGS), int(np.isfinite(w).sum())
            left.axhspan(-1.96 / np.sqrt(count), 1.96 / np.sqrt(count), color=COLOURS[5], alpha=0.3, lw=0)
            left.vlines(np.arange(1, len(rho) + 1), 0, rho, color=COLOURS[0], lw=1.2)
            left.axhline(0, color=COLOURS[6], lw=0.6)
            left.set_ylabel(name)
            right.hist(np.clip(w[np.isfinite(w)], -4, 4), bins=33, range=(-4, 4), density=True, color=COLOURS[5])
            right.plot(x, np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi), color=COLOURS[6], lw=0.8)
        panels[0, 0].set_title("autocorrelation of innovations", fontsize=7.5)
        panels[0, 1].set_title("histogram, and the normal density", fontsize=7.5)
        panels[-1, 0].set_xlabel("lag (samples)")
        panels[-1, 1].set_xlabel("innovation over noise")
    return figure


def autocorrelation(w: np.ndarray, lags: int) -> np.ndarray:
    """ρ_1, ρ_2, … of innovations, over the existing pairs."""
    there = np.isfinite(w)
    left = np.where(there, w - np.mean(w[there]), 0.0)
    variance = np.sum(left**2) / max(int(there.sum()), 1)
    pairs = [(left[k:] * left[:-k], there[k:] & there[:-k]) for k in range(1, min(lags, len(w) - 1) + 1)]
    return np.array([np.sum(product) / max(int(both.sum()), 1) / (variance or 1.0) for product, both in pairs])


def _names(known: Mapping[str, np.ndarray], columns: Sequence[str] | None) -> list[str]:
    names = list(known) if columns is None else list(columns)
    checks.all_known(names or [""], known, "column", "The log")
    return names
