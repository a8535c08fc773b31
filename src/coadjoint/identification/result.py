"""The result of an identification: parameters, their uncertainty, and warnings about both."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from coadjoint.arrays import PyTree
from coadjoint.identification import diagnostics
from coadjoint.identification.equalities import SIGN
from coadjoint.identification.fit import Fit
from coadjoint.identification.fitting import Fitted
from coadjoint.identification.least_squares import reduced
from coadjoint.identification.log import Log
from coadjoint.identification.misfit import Misfit, misfit_messages, misfits
from coadjoint.identification.process_noise_estimate import ProcessNoise, wandered
from coadjoint.identification.process_noise_model import without
from coadjoint.identification.unknowns import Estimate
from coadjoint.mechanics.system import System

SINGULAR = 1e-6
"""Directions with this singular value or less are not determined at all; 1 is a parameter that no start can
compensate."""


@dataclass(frozen=True, repr=False, eq=False)
class Identification:
    """The result of `identify`; `print` shows its summary.

    `estimates` by name; `correlation` (m, m) in their order; `noise` by column, those in `assumed` as given;
    `system` has the values that were found. `correlation_times` of coloured noise, s, by column; 0 where it is white.
    `process_noise`: its components, by name. `innovations`: measured less simulated, less the prediction from previous
    coloured noise and process noise, over the noise; NaN where nothing was measured. `weights`: w of the loss,
    likewise, 1 without one. `misfits`: columns whose innovations follow a command. `whiteness`: their lag-one
    correlation. `settled`: whether the estimated noise was unchanged in the last round of least squares. `warnings`:
    sentences on problems of the log and the fit. `residuals` and `simulated`: columns at the log's times.
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
    weights: dict[str, np.ndarray]
    misfits: tuple[Misfit, ...]
    assumed: tuple[str, ...]
    whiteness: dict[str, float]
    simulated: dict[str, np.ndarray]
    segments: int
    dt: float
    level: float
    iterations: int
    settled: bool
    warnings: tuple[str, ...]

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of this name, or of the equal parameters that it is one of."""
        tied = (label for label in self.estimates if name in label.split(SIGN))
        return self.estimates[name if name in self.estimates else next(tied, name)]

    def __str__(self) -> str:
        return summary_table(self)

    def __repr__(self) -> str:
        return f"<Identification of {', '.join(self.estimates)}; print it for the summary>"

    @property
    def residuals(self) -> dict[str, np.ndarray]:
        """Measured less simulated; angles within half a turn."""
        found = {}
        for name, values in self.simulated.items():
            off = self.log.columns[name] - values
            found[name] = (off + np.pi) % (2 * np.pi) - np.pi if self.log.units.get(name) == "rad" else off
        return found

    def plot(self, columns: PyTree = None) -> Any:
        """Measured against simulated; a matplotlib Figure."""
        from coadjoint.identification.figures import measured_and_simulated

        return measured_and_simulated(self.log, self.simulated, columns)

    def plot_innovations(self, columns: PyTree = None) -> Any:
        """Autocorrelation and histogram of the innovations of each column, against those of white normal noise; a
        matplotlib Figure."""
        from coadjoint.identification.figures import autocorrelation_and_histogram

        return autocorrelation_and_histogram(self.innovations, columns)


class Spread(NamedTuple):
    """The uncertainty of the coordinates of parameters.

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
    warnings = [*diagnostics.hidden(estimates, hidden, spread.V, spread.lost), *diagnostics.vague(estimates)]
    warnings += diagnostics.alike(estimates, correlation, hidden) + diagnostics.coloured(whiteness, fit.there, names)
    warnings += diagnostics.missed(fit.log, names, rms, found.estimated)
    warnings += diagnostics.unsettled(found.unsettled) + diagnostics.misjudged(names, rms, sigma, found.estimated)
    warnings += diagnostics.coarse(estimates, found.shift, shooting.samples.h)
    warnings += diagnostics.handed_on(shooting.handed, shooting.runs)
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
        process_noise=wandered(fit, place, level),
        innovations=innovations,
        weights=_by_rows(fit, np.where(fit.there, fit.weights, np.nan)),
        misfits=missed,
        assumed=tuple(n for n, own in zip(names, found.estimated, strict=True) if not own),
        whiteness=whiteness,
        simulated=_by_rows(fit, fit.shown(predicted, place.shared)),
        segments=shooting.runs,
        dt=shooting.samples.h,
        level=level,
        iterations=found.trips,
        settled=not found.unsettled,
        warnings=(
            *fit.log.notes,
            *diagnostics.gaps(fit.log, shooting.samples),
            *misfit_messages(fit.log, innovations, missed),
            *warnings,
        ),
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
    """Values with intervals by Student's t, computed in the coordinates of the search and transformed back."""
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


def summary_table(found: Identification) -> str:
    """The summary that `print(found)` shows."""
    log = found.log
    width = max(9, *map(len, (*found.estimates, *found.process_noise)))
    lines = [
        f"Identification of {found.system.name}",
        f"  log       {len(log)} samples over {log.duration:g} s, {len(found.simulated)} columns",
        f"  fit       {found.segments} segments, dt = {found.dt:g} s, {found.iterations} iterations",
        "",
        f"  {'parameter':<{width}}  {'estimate':>11}  {f'{found.level:.0%} interval':^25}  {'before':>11}",
    ]
    for name, e in found.estimates.items():
        digits = 5 if f"{e.low:.5g}" != f"{e.high:.5g}" else 8
        value, low, high = (f"{x:.{digits}g}" for x in (e.value, e.low, e.high))
        lines.append(f"  {name:<{width}}  {value:>11}  {low:>11} .. {high:<10}  {e.prior:>11.5g}")
    lines += ["", f"  {'column':<{width}}  {'noise':>11}   {'':<10}  lag-one correlation"]
    for name, sigma in found.noise.items():
        unit = log.units.get(name, "")
        known = "given" if name in found.assumed else "estimated"
        time = found.correlation_times.get(name, 0.0)
        after = f"   over {time:.3g} s" if time else ""
        value, unit = (np.degrees(sigma), unit.replace("rad", "deg")) if unit.startswith("rad") else (sigma, unit)
        lines.append(f"  {name:<{width}}  {value:>11.4g} {unit:<6} {known:<10} {found.whiteness[name]:>6.2f}{after}")
    if found.process_noise:
        interval = f"{found.level:.0%} interval"
        lines += ["", f"  {'wanders':<{width}}  {'deviation':>11}  {interval:^25}  correlation time"]
    for name, one in found.process_noise.items():
        low, high = (f"{value:.4g} {one.unit}".rstrip() for value in one.deviation_interval)
        time = "{:.3g} s, {:.3g} .. {:.3g} s".format(one.correlation_time, *one.correlation_time_interval)
        value = f"{one.deviation:.4g} {one.unit}".rstrip()
        lines.append(f"  {name:<{width}}  {value:>11}  {low:>11} .. {high:<10}  {time}")
    for warning in found.warnings:
        lines += ["", *textwrap.wrap(warning, 100, initial_indent="  ! ", subsequent_indent="    ")]
    return "\n".join(lines)
