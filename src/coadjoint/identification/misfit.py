"""Errors of a model: innovations that are correlated with inputs of the vehicle, or with one another.

Where model and noise are right, innovations are white: their correlation ρ with anything that was known before,
such as a command f(t − lag), has ρ√N of variance 1, with m commands N R² is a χ² of m, and their autocorrelations
ρ_k make Q = N(N + 2) Σ ρ_k²/(N − k) a χ²:
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
"""The rate of false alarms for a correct model, over all columns, commands and lags."""

LAGS = (0.0, 0.2, 0.5, 1.0, 2.0)
"""The lags of commands before an innovation, s."""

FOLLOWING = 20
"""Autocorrelations of Q."""

SHAPES = {
    "{}": lambda f: f,
    "|{0}|{0}": lambda f: np.abs(f) * f,
    "{}²": lambda f: f**2,
    "{}³": lambda f: f**3,
}
"""Functions of a command that a force may follow, or of its distance from its mean if it never changes sign, as a pulse
width."""

FEWEST = 30
"""The least number of innovations for a correlation."""


class Misfit(NamedTuple):
    """A column whose innovations correlate with a command, or with all commands of a part together, such as thrusters.

    `shape`: of the command, `lag` s before; `correlation` with its sign, of several commands R without one; `score`:
    |correlation| √N, for several commands the equally improbable normal deviate; `following`: the probability of as
    large a Q for white innovations.
    """

    column: str
    input: str
    shape: str
    lag: float
    correlation: float
    score: float
    following: float


def misfits(log: Log, innovations: Mapping[str, np.ndarray]) -> tuple[Misfit, ...]:
    """The columns that follow a command significantly, each with the command that it follows most; the clearest first.

    A column alone must reach LEVEL/2 over all columns and features; a feature may also do so by Σ N R² over all
    columns, a χ² of as many times its commands, and is then reported for the column that follows it most.
    """
    features = list(_features(log))
    known = {name: w for name, w in innovations.items() if np.isfinite(w).sum() >= FEWEST}
    if not features or not known:
        return ()
    pairs = [[_correlated(column, w, np.isfinite(w), feature) for feature in features] for column, w in known.items()]
    table = [[one for one, _ in row] for row in pairs]
    scores = np.array([[one.score for one in row] for row in table])
    least = float(stats.norm.isf(LEVEL / 4 / scores.size))
    found = [row[i] for row, i in zip(table, np.argmax(scores, axis=1), strict=True) if row[i].score > least]
    together = np.sum([[square for _, square in row] for row in pairs], axis=0)
    counts = len(known) * np.array([feature.values.shape[1] for feature in features])
    chances = stats.chi2.sf(together, counts)
    best = int(np.argmin(chances))
    if not found and chances[best] < LEVEL / 2 / len(features):
        found = [table[int(np.argmax(scores[:, best]))][best]]
    found = [one._replace(following=portmanteau(known[one.column])) for one in found]
    return tuple(sorted(found, key=lambda one: -one.score))


def misfit_messages(log: Log, innovations: Mapping[str, np.ndarray], found: tuple[Misfit, ...]) -> list[str]:
    """A sentence on the column that the model misses, and the command that it follows; or that the log is too short."""
    most = max((int(np.isfinite(w).sum()) for w in innovations.values()), default=0)
    if log.inputs and most < FEWEST:
        return [
            f"The log is too short to show whether the model misses effects of {' or '.join(log.inputs)}: no column "
            "holds "
            f"more than {most} samples that are fitted, and {FEWEST} are needed."
        ]
    if not found:
        return []
    worst = found[0]
    late = f" {worst.lag:g} s before" if worst.lag else ""
    others = [m.column for m in found[1:]]
    more = f" {', '.join(others)} {'are' if len(others) > 1 else 'is'} missed as well." if others else ""
    return [
        f"The model misses {worst.column} where {worst.input} acts: the innovations correlate with {worst.shape}{late} "
        f"(R = {abs(worst.correlation):.2f}, {worst.score:.0f} times the standard error). Check the law of "
        f"{worst.input}; the intervals hold for a correct model.{more}"
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
    """A shape of a command, or of several, at a lag, at the times of the log, (times, commands); NaN before the first
    command."""

    input: str
    shape: str
    lag: float
    values: np.ndarray


def _features(log: Log) -> Iterator[Feature]:
    for name, values in log.inputs.items():
        columns = values.reshape(len(log), -1)
        count = columns.shape[1]
        labels = [name] if values.ndim == 1 else [f"{name}[{i + 1}]" for i in range(count)]
        groups = [(label, [i]) for i, label in enumerate(labels)] + ([(name, list(range(count)))] if count > 1 else [])
        steady = np.all(columns > 0, axis=0) | np.all(columns < 0, axis=0)
        middle = np.where(steady, columns.mean(axis=0), 0.0)
        for lag in LAGS:
            row = np.searchsorted(log.time, log.time - lag + 1e-9, side="right") - 1
            before = np.where((row >= 0)[:, None], columns[np.maximum(row, 0)], np.nan) - middle
            for text, shape in SHAPES.items():
                shaped = shape(before)
                for label, those in groups:
                    about = _about(label, middle[those], steady[those])
                    yield Feature(label, text.format(about), lag, shaped[:, those])


def _about(label: str, middle: np.ndarray, steady: np.ndarray) -> str:
    """A command, or several, less their reference."""
    if not steady.any():
        return label
    means = "the means of those that keep their sign" if not steady.all() else "their means"
    return f"({label} − {middle[0]:.4g})" if len(middle) == 1 else f"({label} − {means})"


def _correlated(column: str, w: np.ndarray, there: np.ndarray, feature: Feature) -> tuple[Misfit, float]:
    """The misfit, and N R²."""
    both = there & np.all(np.isfinite(feature.values), axis=1)
    nothing = Misfit(column, feature.input, feature.shape, feature.lag, 0.0, 0.0, 1.0)
    if both.sum() < FEWEST:
        return nothing, 0.0
    a, b = w[both], feature.values[both]
    a, b = a - a.mean(), b - b.mean(axis=0)
    follows = min(max(float(np.sum(a[1:] * a[:-1]) / max(np.sum(a**2), 1e-300)), 0.0), 0.95)
    # Correlated innovations correlate with any slow signal by chance: both sides are whitened.
    a, b = a[1:] - follows * a[:-1], b[1:] - follows * b[:-1]
    size, sizes = np.sqrt(np.sum(a**2)), np.sqrt(np.sum(b**2, axis=0))
    moves = size * sizes > 1e-12 * (1.0 + np.sum(feature.values[both] ** 2, axis=0))
    if not moves.any():
        return nothing, 0.0
    b = b[:, moves] / sizes[moves]
    along = b.T @ a / size
    single = len(along) == 1
    square = float(along[0] ** 2 if single else along @ np.linalg.pinv(b.T @ b, rcond=1e-9, hermitian=True) @ along)
    correlation = float(along[0]) if single else float(np.sqrt(square))
    total = int(both.sum()) * square
    return nothing._replace(correlation=correlation, score=_score(total, len(along))), total


def _score(square: float, count: int) -> float:
    """The number of a normal law that is as improbable as a χ² of so many: Wilson and Hilferty (1931)."""
    if count == 1:
        return float(np.sqrt(square))
    spread = 2 / (9 * count)
    return max(float((np.cbrt(square / count) - 1 + spread) / np.sqrt(spread)), 0.0)
