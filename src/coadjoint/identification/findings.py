"""What an identification found, how sure it is, and what is doubtful about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from coadjoint.identification.fit import Fit
from coadjoint.identification.fitting import Fitted
from coadjoint.identification.gaps import gaps
from coadjoint.identification.least_squares import reduced
from coadjoint.identification.log import Log
from coadjoint.identification.misfit import Misfit, misfits, sentences
from coadjoint.identification.sensing import SENSORS
from coadjoint.identification.smoothing import noise as rough_noise
from coadjoint.identification.tied import SIGN
from coadjoint.identification.wandering import ProcessNoise, wandered, without
from coadjoint.mechanics.system import System

SINGULAR = 1e-6
"""Directions with this singular value or less are not determined at all; 1 is a parameter that no start can undo."""

COARSE = 0.3
"""How many standard errors a shift by the step size must reach for a warning."""

ALIKE, VAGUE, COLOURED = 0.98, 0.5, 0.2
"""|correlation| of two parameters, interval over estimate, lag-one correlation of residuals, that give a warning."""

STRONGEST = 3
"""How many names a sentence on parameters that cannot be separated holds."""

WILD, SWALLOWED = 20.0, 0.7
"""Residuals over the noise between neighbouring samples, and over the signal's own spread, that give a warning."""


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
    `system` has the values that were found. `correlation_times` of coloured noise, s, by column; 0 where it is white.
    `process_noise`: what wandered, by name. `innovations`: measured less simulated, less what the coloured noise before
    and what wandered tell, over the noise; NaN where nothing was measured. `misfits`: columns whose innovations follow
    a command. `whiteness`: their lag-one correlation.
    `warnings`: sentences on what the log does not tell. `residuals` and `simulated`: columns at the log's times.
    """

    system: System
    log: Log
    estimates: dict[str, Estimate]
    correlation: np.ndarray
    singular_values: np.ndarray
    noise: dict[str, float]
    correlation_times: dict[str, float]
    process_noise: dict[str, ProcessNoise]
    innovations: dict[str, np.ndarray]
    misfits: tuple[Misfit, ...]
    assumed: tuple[str, ...]
    whiteness: dict[str, float]
    simulated: dict[str, np.ndarray]
    segments: int
    dt: float
    level: float
    iterations: int
    warnings: tuple[str, ...]

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of this name, or of the equal parameters that it is one of."""
        tied = (label for label in self.estimates if name in label.split(SIGN))
        return self.estimates[name if name in self.estimates else next(tied, name)]

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

    def plot_innovations(self, columns: Any = None) -> Any:
        """Autocorrelation and histogram of the innovations of each column, against those of white normal noise; a
        matplotlib Figure."""
        from coadjoint.identification.figures import autocorrelation_and_histogram

        return autocorrelation_and_histogram(self, columns)


class Spread(NamedTuple):
    """How sure the coordinates of parameters are.

    `hidden`: those that are not determined. `values`, `V`: singular values and directions of the Jacobian with columns
    of length one, of which those `lost` are too small.
    """

    covariance: np.ndarray
    error: np.ndarray
    hidden: np.ndarray
    values: np.ndarray
    V: np.ndarray
    lost: np.ndarray

    @property
    def correlation(self) -> np.ndarray:
        variance = np.diag(self.covariance)
        finite = np.sqrt(np.where(variance > 0, variance, 1.0))
        return self.covariance / np.outer(finite, finite)


def judged(found: Fitted, level: float) -> Identification:
    """Estimates with their intervals, from the Jacobian at the solution."""
    fit, sigma, shooting = found.fit, found.sigma, found.fit.shooting
    spread, names = _spread(found.solution.jacobian, fit.own), shooting.channels.names
    estimates = _estimates(found, spread, level)
    place = found.solution.place
    predicted = fit.predict(place)
    assert predicted is not None
    off = fit.differences(predicted, place.shared)
    surprise = fit.surprise(place, predicted)
    whiteness = {n: _lag_one(surprise[..., i], fit.there[..., i]) for i, n in enumerate(names)}
    rms = np.sqrt(np.sum(off**2, axis=(0, 1)) / np.maximum(fit.there.sum(axis=(0, 1)), 1))
    correlation, hidden = spread.correlation, spread.hidden
    warnings = [*_hidden(estimates, hidden, spread.V, spread.lost), *_vague(estimates)]
    warnings += _alike(estimates, correlation, hidden) + _coloured(whiteness, fit.there, names)
    warnings += _missed(fit.log, names, rms, found.estimated)
    warnings += _misjudged(names, rms, sigma, found.estimated) + _coarse(estimates, found.shift, shooting.samples.h)
    innovations = _by_rows(fit, np.where(fit.there, -surprise, np.nan))
    missed = misfits(fit.log, innovations)
    return Identification(
        system=without(shooting.unknowns.replaced(fit.split(place.shared)[0])),
        log=fit.log,
        estimates=estimates,
        correlation=correlation,
        singular_values=spread.values,
        noise=dict(zip(names, map(float, sigma), strict=True)),
        correlation_times={names[i]: float(fit.times[i]) for i in fit.sensing.coloured},
        process_noise=wandered(fit, place.own),
        innovations=innovations,
        misfits=missed,
        assumed=tuple(n for n, own in zip(names, found.estimated, strict=True) if not own),
        whiteness=whiteness,
        simulated=_by_rows(fit, fit.shown(predicted, place.shared)),
        segments=shooting.runs,
        dt=shooting.samples.h,
        level=level,
        iterations=found.trips,
        warnings=(*fit.log.notes, *gaps(fit.log, shooting.samples), *sentences(missed), *warnings),
    )


def _spread(J: np.ndarray, d: int) -> Spread:
    """(JᵀJ)⁻¹ with the d numbers of each start eliminated, without the directions that are not determined."""
    B, _ = reduced(J, d)
    flat = B.reshape(-1, B.shape[2])
    size = np.linalg.norm(J[..., d:].reshape(flat.shape), axis=0)
    scale = np.where(size > 0, size, 1.0)
    flat = flat / scale
    squares, V = np.linalg.eigh(flat.T @ flat)
    values, V = np.sqrt(np.maximum(squares[::-1], 0.0)), V.T[::-1]
    lost = values <= SINGULAR
    inverse = np.where(lost, 0.0, 1 / np.where(lost, 1.0, values))
    covariance = (V.T * inverse**2) @ V / np.outer(scale, scale)
    hidden = np.any(np.abs(V[lost]) > 1e-2, axis=0) | (size == 0)
    error = np.where(hidden, np.inf, np.sqrt(np.diag(covariance)))
    return Spread(covariance, error, hidden, values, V, lost)


def _estimates(found: Fitted, spread: Spread, level: float) -> dict[str, Estimate]:
    """Values with intervals by Student's t, in the coordinates that are sought and turned back."""
    shooting = found.fit.shooting
    freedom = int(found.fit.there.sum()) - shooting.size * shooting.runs - len(spread.error)
    quantile = float(stats.t.ppf(0.5 + level / 2, max(freedom, 1)))
    estimates = {}
    for unknown, x, error in zip(found.fit.each, found.solution.place.shared, spread.error, strict=True):
        numbers = (unknown.value(x), *unknown.interval(x, quantile * error), error * unknown.slope(x), unknown.prior)
        estimates[unknown.label] = Estimate(unknown.label, *map(float, numbers))
    return estimates


def _by_rows(fit: Fit, values: np.ndarray) -> dict[str, np.ndarray]:
    """Numbers (segments, samples, channels) at the times of the log, by column."""
    rows = fit.shooting.samples.rows
    found = {name: np.full(len(fit.log), np.nan) for name in fit.shooting.channels.names}
    for i, column in enumerate(found.values()):
        column[rows[rows >= 0]] = values[..., i][rows >= 0]
    return found


def _lag_one(off: np.ndarray, there: np.ndarray) -> float:
    """Σ r_i r_{i+1}/Σ r_i² over neighbours within segments."""
    both = there[:, 1:] & there[:, :-1]
    total = float(np.sum(off**2)) / max(int(there.sum()), 1)
    return float(np.sum((off[:, 1:] * off[:, :-1])[both]) / max(int(both.sum()), 1) / total) if total > 0 else 0.0


def _hidden(estimates: dict[str, Estimate], hidden: np.ndarray, V: np.ndarray, lost: np.ndarray) -> list[str]:
    names, shared = list(estimates), np.zeros(len(estimates), bool)
    found: dict[str, None] = {}
    for row in np.abs(V[lost]):
        if np.sum(row > 1e-2) > 1:
            shared |= row > 1e-2
            strongest = sorted(sorted(np.flatnonzero(row > 1e-2), key=lambda i: -row[i])[:STRONGEST])
            others = int(np.sum(row > 1e-2)) - len(strongest)
            listed = " and ".join(names[i] for i in strongest) + (f", with {others} others" if others else "")
            found[f"The log cannot separate {listed}: keep one of them at its known value."] = None
    alone = [names[i] for i in np.flatnonzero(hidden & ~shared)]
    return list(found) + [f"The log says nothing on {name}: its motion does not depend on it." for name in alone]


def _vague(estimates: dict[str, Estimate]) -> list[str]:
    """Wide intervals: relative to the value, or of one that may be zero, to which nothing is relative. Sensors may well
    be without bias and delay."""
    sentences = []
    for e in estimates.values():
        if e.name.startswith(SENSORS):
            continue
        if np.isfinite(e.standard_error) and e.low <= 0 <= e.high:
            sentences.append(f"The log does not tell {e.name} from zero: its interval is {e.low:.3g} to {e.high:.3g}.")
        elif np.isfinite(e.standard_error) and e.high - e.low > 2 * VAGUE * abs(e.value):
            half = (e.high - e.low) / 2 / abs(e.value)
            sentences.append(f"The log hardly excites {e.name}: its interval is ±{half:.0%}.")
    return sentences


def _missed(log: Log, names: tuple[str, ...], rms: np.ndarray, estimated: np.ndarray) -> list[str]:
    """Where residuals are no noise: far above what neighbouring samples have of it, or as large as the signal."""
    found = []
    for name, off, own in zip(names, rms, estimated, strict=True):
        if not own:
            continue
        turning, values = log.units.get(name) == "rad", log.columns[name][np.isfinite(log.columns[name])]
        typical = rough_noise(log, name)
        signal = float(np.std(np.unwrap(values) if turning else values))
        far = off > WILD * typical or (off > SWALLOWED * signal and off > 3 * typical) or (turning and off > 1.0)
        if far:
            found.append(f"{name} ({np.degrees(off):.3g}°)" if turning else f"{name} ({off:.3g})")
    if not found:
        return []
    return [
        f"The simulation misses {', '.join(found)} by far more than the noise between neighbouring samples: check axes "
        "and units of the log, and that every command is there; do not rely on the intervals."
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
