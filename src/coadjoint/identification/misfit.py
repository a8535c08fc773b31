"""Where a model is wrong: innovations that follow what drives the vehicle, or one another.

Where model and noise are right, innovations are white: their correlation ρ with anything that was known before,
such as a command f(t − lag), has ρ√N of variance 1, and their autocorrelations ρ_k make Q = N(N + 2) Σ ρ_k²/(N − k) a
χ²:
Ljung, System Identification (1999), section 16.6; Ljung and Box (1978), On a measure of lack of fit in time series
models, Biometrika 65.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from scipy import stats

from coadjoint.identification.log import Log

LEVEL = 1e-3
"""How often a log of a model that is right is said to be missed by it, over all columns, commands and lags."""

LAGS = (0.0, 0.2, 0.5, 1.0, 2.0)
"""How long before an innovation a command was given, s."""

FOLLOWING = 20
"""Autocorrelations of Q."""

SHAPES = {
    "{}": lambda f: f,
    "|{0}|{0}": lambda f: np.abs(f) * f,
    "{}²": lambda f: f**2,
    "{}³": lambda f: f**3,
}
"""What a force may be of a command."""

FEWEST = 30
"""Innovations that a correlation needs."""


class Misfit(NamedTuple):
    """A column whose innovations correlate with a command.

    `shape`: of the command, `lag` s before; `correlation` with its sign, `score` = |correlation| √N; `following`: the
    probability of as large a Q where innovations are white.
    """

    column: str
    input: str
    shape: str
    lag: float
    correlation: float
    score: float
    following: float


def misfits(log: Log, innovations: Mapping[str, np.ndarray]) -> tuple[Misfit, ...]:
    """The columns that follow a command by more than chance, each with the command that it follows most; the clearest
    first.

    A column alone must reach LEVEL/2 over all columns and features; a feature may also do so by Σ score² over all
    columns, a χ² of as many, and then is told of the column that follows it most.
    """
    features = list(_features(log))
    known = {name: w for name, w in innovations.items() if np.isfinite(w).sum() >= FEWEST}
    if not features or not known:
        return ()
    table = [[_correlated(column, w, np.isfinite(w), feature) for feature in features] for column, w in known.items()]
    scores = np.array([[one.score for one in row] for row in table])
    least = float(stats.norm.isf(LEVEL / 4 / scores.size))
    found = [row[i] for row, i in zip(table, np.argmax(scores, axis=1), strict=True) if row[i].score > least]
    together = np.sum(scores**2, axis=0)
    best = int(np.argmax(together))
    if not found and stats.chi2.sf(together[best], len(known)) < LEVEL / 2 / len(features):
        found = [table[int(np.argmax(scores[:, best]))][best]]
    found = [one._replace(following=portmanteau(known[one.column])) for one in found]
    return tuple(sorted(found, key=lambda one: -one.score))


def sentences(found: tuple[Misfit, ...]) -> list[str]:
    """A sentence on what the model misses, and which command it goes with."""
    if not found:
        return []
    worst = found[0]
    late = f" {worst.lag:g} s before" if worst.lag else ""
    others = [m.column for m in found[1:]]
    more = f" {', '.join(others)} {'are' if len(others) > 1 else 'is'} missed, too." if others else ""
    return [
        f"The model misses {worst.column} where {worst.input} acts: what it leaves correlates with {worst.shape}{late} "
        f"({worst.correlation:+.2f}, {worst.score:.0f} times what chance does). Look at the law of {worst.input}; the "
        f"intervals hold for a model that is right.{more}"
    ]


def portmanteau(w: np.ndarray) -> float:
    """The probability of as large a Q of Ljung and Box, of innovations at equal times."""
    there = np.isfinite(w)
    left = np.where(there, w - np.mean(w[there]), 0.0)
    count, total = int(there.sum()), float(np.sum(left**2))
    lags = np.arange(1, min(FOLLOWING, count // 4) + 1)
    if not len(lags) or total == 0.0:
        return 1.0
    rho = np.array([np.sum(left[k:] * left[:-k]) for k in lags]) / total
    return float(stats.chi2.sf(count * (count + 2) * np.sum(rho**2 / (count - lags)), len(lags)))


class Feature(NamedTuple):
    """A shape of a command at a lag, at the times of the log; NaN before the first command."""

    input: str
    shape: str
    lag: float
    values: np.ndarray


def _features(log: Log) -> Iterator[Feature]:
    for name, values in log.inputs.items():
        columns = values.reshape(len(log), -1)
        for i, f in enumerate(columns.T):
            label = name if values.ndim == 1 else f"{name}[{i + 1}]"
            for lag in LAGS:
                row = np.searchsorted(log.time, log.time - lag + 1e-9, side="right") - 1
                before = np.where(row >= 0, f[np.maximum(row, 0)], np.nan)
                for text, shape in SHAPES.items():
                    yield Feature(label, text.format(label), lag, shape(before))


def _correlated(column: str, w: np.ndarray, there: np.ndarray, feature: Feature) -> Misfit:
    both = there & np.isfinite(feature.values)
    if both.sum() < FEWEST:
        return Misfit(column, feature.input, feature.shape, feature.lag, 0.0, 0.0, 1.0)
    a, b = w[both], feature.values[both]
    a, b = a - a.mean(), b - b.mean()
    follows = min(max(float(np.sum(a[1:] * a[:-1]) / max(np.sum(a**2), 1e-300)), 0.0), 0.95)
    # Innovations that follow one another correlate with anything slow by chance: of both sides what is new is taken.
    a, b = a[1:] - follows * a[:-1], b[1:] - follows * b[:-1]
    sizes = np.sqrt(np.sum(a**2) * np.sum(b**2))
    correlation = float(np.sum(a * b) / sizes) if sizes > 1e-12 * (1.0 + np.sum(feature.values[both] ** 2)) else 0.0
    score = abs(correlation) * np.sqrt(both.sum())
    return Misfit(column, feature.input, feature.shape, feature.lag, correlation, float(score), 1.0)
