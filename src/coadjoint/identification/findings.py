"""What an identification found, how sure it is, and what is doubtful about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from coadjoint.identification.fitting import Fitted
from coadjoint.identification.least_squares import reduced
from coadjoint.identification.log import Log
from coadjoint.mechanics.system import System

SINGULAR = 1e-6
"""Directions whose singular value is this part of the largest one or less are not determined at all."""

COARSE = 0.3
"""How many standard errors of a shift by the step size are told."""

ALIKE, VAGUE, COLOURED = 0.98, 0.5, 0.2
"""|correlation| of two parameters, interval over estimate, and lag-one correlation of residuals, that are told."""


@dataclass(frozen=True)
class Estimate:
    """One parameter: what was found, its interval and standard error, and where the search began."""

    name: str
    value: float
    low: float
    high: float
    standard_error: float
    prior: float

    def covers(self, truth: float) -> bool:
        """Whether the interval holds a value."""
        return self.low <= truth <= self.high


@dataclass(frozen=True, repr=False, eq=False)
class Identification:
    """What `identify` returns; `print` it for the card.

    `estimates` by name; `correlation` (m, m) in their order; `noise` by column, those in `assumed` as given;
    `system` has the values that were found. `whiteness`: lag-one correlation of each column's residuals.
    `doubts`: sentences on what the log does not tell. `residuals` and `simulated`: columns at the log's times.
    """

    system: System
    log: Log
    estimates: dict[str, Estimate]
    correlation: np.ndarray
    singular_values: np.ndarray
    noise: dict[str, float]
    assumed: tuple[str, ...]
    whiteness: dict[str, float]
    simulated: dict[str, np.ndarray]
    segments: int
    dt: float
    level: float
    iterations: int
    doubts: tuple[str, ...]

    def __getitem__(self, name: str) -> Estimate:
        return self.estimates[name]

    def __str__(self) -> str:
        from coadjoint.identification.card import card

        return card(self)

    def __repr__(self) -> str:
        return f"<Identification of {', '.join(self.estimates)}; print it for the card>"

    @property
    def residuals(self) -> dict[str, np.ndarray]:
        """Measured less simulated; angles within half a turn."""
        found = {}
        for name, values in self.simulated.items():
            off = self.log.columns[name] - values
            found[name] = (off + np.pi) % (2 * np.pi) - np.pi if self.log.units.get(name) == "rad" else off
        return found

    def plot(self, columns: Any = None) -> Any:
        """Measured against simulated; a matplotlib Figure."""
        from coadjoint.identification.figures import measured_and_simulated

        return measured_and_simulated(self, columns)


def judged(found: Fitted, level: float) -> Identification:
    """Estimates with their intervals, from the Jacobian at the solution."""
    fit, solution, sigma = found.fit, found.solution, found.sigma
    shooting, log, d = fit.shooting, fit.log, fit.shooting.size
    J = solution.jacobian
    B, _ = reduced(J, d)
    flat = B.reshape(-1, B.shape[2])
    size = np.linalg.norm(J[..., d:].reshape(flat.shape), axis=0)
    flat = flat / np.where(size > 0, size, 1.0)
    squares, V = np.linalg.eigh(flat.T @ flat)
    values, V = np.sqrt(np.maximum(squares[::-1], 0.0)), V.T[::-1]
    lost = values <= SINGULAR
    inverse = np.where(lost, 0.0, 1 / np.where(lost, 1.0, values))
    scale = np.where(size > 0, size, 1.0)
    covariance = (V.T * inverse**2) @ V / np.outer(scale, scale)
    error = np.sqrt(np.diag(covariance))
    hidden = np.any(np.abs(V[lost]) > 1e-2, axis=0) | (size == 0)
    error[hidden] = np.inf
    freedom = int(fit.there.sum()) - d * shooting.runs - len(error)
    quantile = float(stats.t.ppf(0.5 + level / 2, max(freedom, 1)))
    estimates = {}
    for i, unknown in enumerate(shooting.unknowns.each):
        x = float(solution.place.shared[i])
        low, high = unknown.interval(x, quantile * error[i])
        spread = float(error[i]) * unknown.slope(x)
        estimates[unknown.label] = Estimate(unknown.label, unknown.value(x), low, high, spread, unknown.prior)
    finite = np.sqrt(np.where(np.diag(covariance) > 0, np.diag(covariance), 1.0))
    correlation = covariance / np.outer(finite, finite)
    names = shooting.channels.names
    told = shooting.predict(solution.place.shared, solution.place.own, fit.internal)
    assert told is not None
    off = fit.differences(told)
    whiteness = {n: _lag_one(off[..., i], fit.there[..., i]) for i, n in enumerate(names)}
    rows = shooting.samples.rows
    simulated = {n: np.full(len(log), np.nan) for n in names}
    for i, name in enumerate(names):
        simulated[name][rows[rows >= 0]] = told.values[..., i][rows >= 0]
    assumed = tuple(n for n, own in zip(names, found.estimated, strict=True) if not own)
    rms = np.sqrt(np.sum(off**2, axis=(0, 1)) / np.maximum(fit.there.sum(axis=(0, 1)), 1))
    doubts = [*_hidden(estimates, hidden, V, lost), *_vague(estimates), *_alike(estimates, correlation, hidden)]
    doubts += _coloured(whiteness, fit.there, names) + _misjudged(names, rms, sigma, found.estimated)
    doubts += _coarse(estimates, found.shift, shooting.samples.h)
    return Identification(
        system=shooting.unknowns.replaced(solution.place.shared),
        log=log,
        estimates=estimates,
        correlation=correlation,
        singular_values=values,
        noise=dict(zip(names, map(float, sigma), strict=True)),
        assumed=assumed,
        whiteness=whiteness,
        simulated=simulated,
        segments=shooting.runs,
        dt=shooting.samples.h,
        level=level,
        iterations=found.trips,
        doubts=(*log.notes, *doubts),
    )


def _lag_one(off: np.ndarray, there: np.ndarray) -> float:
    """Σ r_i r_{i+1}/Σ r_i² over neighbours within segments."""
    both = there[:, 1:] & there[:, :-1]
    total = float(np.sum(off**2)) / max(int(there.sum()), 1)
    return float(np.sum((off[:, 1:] * off[:, :-1])[both]) / max(int(both.sum()), 1) / total) if total > 0 else 0.0


def _hidden(estimates: dict[str, Estimate], hidden: np.ndarray, V: np.ndarray, lost: np.ndarray) -> list[str]:
    names = list(estimates)
    told = [
        f"The log cannot separate {' and '.join(names[i] for i in np.flatnonzero(np.abs(row) > 1e-2))}: "
        "keep one of them at its known value."
        for row in V[lost]
        if np.sum(np.abs(row) > 1e-2) > 1
    ]
    alone = [names[i] for i in np.flatnonzero(hidden) if not any(names[i] in sentence for sentence in told)]
    return told + [f"The log says nothing on {name}: its motion does not depend on it." for name in alone]


def _vague(estimates: dict[str, Estimate]) -> list[str]:
    vague = [
        e for e in estimates.values() if np.isfinite(e.standard_error) and e.high - e.low > 2 * VAGUE * abs(e.value)
    ]
    return [
        f"The log hardly excites {e.name}: its interval is ±{(e.high - e.low) / 2 / abs(e.value):.0%}." for e in vague
    ]


def _alike(estimates: dict[str, Estimate], correlation: np.ndarray, hidden: np.ndarray) -> list[str]:
    names = list(estimates)
    pairs = [(i, j) for i in range(len(names)) for j in range(i) if not (hidden[i] or hidden[j])]
    return [
        f"{names[j]} and {names[i]} are hard to tell apart: correlation {correlation[i, j]:.3f}."
        for i, j in pairs
        if abs(correlation[i, j]) > ALIKE
    ]


def _coloured(whiteness: dict[str, float], there: np.ndarray, names: tuple[str, ...]) -> list[str]:
    counts = there.sum(axis=(0, 1))
    found = [
        f"{name} ({whiteness[name]:.2f})"
        for name, count in zip(names, counts, strict=True)
        if abs(whiteness[name]) > max(COLOURED, 4 / np.sqrt(count))
    ]
    if not found:
        return []
    return [
        f"Residuals of {', '.join(found)} follow one another (lag-one correlation): the model or the noise is not as "
        "assumed, and the intervals may be too narrow."
    ]


def _misjudged(names: tuple[str, ...], rms: np.ndarray, sigma: np.ndarray, estimated: np.ndarray) -> list[str]:
    return [
        f"The noise of {name} was given as {s:.3g}, but the residuals have {r:.3g}."
        for name, r, s, own in zip(names, rms, sigma, estimated, strict=True)
        if not own and not 0.7 < r / s < 1.3
    ]


def _coarse(estimates: dict[str, Estimate], shift: np.ndarray, h: float) -> list[str]:
    """Where the step size shifts a parameter by much of its standard error."""
    if not len(shift) or not np.nanmax(shift) > COARSE:
        return []
    worst = int(np.nanargmax(shift))
    return [
        f"The step dt = {h:g} s shifts {list(estimates)[worst]} by {shift[worst]:.1f} standard errors: take a smaller "
        "one, or leave it out."
    ]
