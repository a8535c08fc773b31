"""The process noise that an identification estimates: its strength, its course and the uncertainty of both."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import stats

from coadjoint.identification.fit import Fit
from coadjoint.identification.least_squares import Estimates
from coadjoint.identification.process_noise import Knots, posterior, wander_errors
from coadjoint.identification.process_noise_model import NAME
from coadjoint.identification.unknowns import _arrays
from coadjoint.mechanics.system import System


class ProcessNoise(NamedTuple):
    """One component of process noise: its standard deviation, in its `unit`, "" if unknown, its correlation time, s,
    and its values at the times of the log, smoothed over the complete log; NaN where the log is not fitted.

    `errors`: standard deviations of `values` at the estimated strength. `deviation_interval`,
    `correlation_time_interval`: (low, high) at the level of the identification, from the curvature of the restricted
    likelihood by the logarithms; 0 to infinity at the ends of the search range, as for the time of a random walk and
    for a vanishing deviation.
    """

    deviation: float
    correlation_time: float
    values: np.ndarray
    errors: np.ndarray
    deviation_interval: tuple[float, float]
    correlation_time_interval: tuple[float, float]
    unit: str


def wandered(fit: Fit, place: Estimates, level: float) -> dict[str, ProcessNoise]:
    """The course of each component, from the knots of all segments, and its uncertainty."""
    knots, wander, samples = fit.shooting.knots, fit.wander, fit.shooting.samples
    given = fit.normal_equations(place)
    if knots is None or wander is None or given is None:
        return {}
    covariance = posterior(given, knots, wander).covariance
    errors, half = np.sqrt(np.einsum("sxx->sx", covariance)), stats.norm.isf((1 - level) / 2)
    strength = wander_errors(given, knots, fit.longest_time, wander)
    at = np.clip((samples.steps_away * samples.h / knots.spacing + 1e-9).astype(int), 0, knots.count - 1)
    rows, units, found = samples.rows, _units(fit.shooting.unknowns.system, knots), {}
    for c, label in enumerate(knots.labels):
        along = np.full((2, len(fit.log)), np.nan)
        for row, x in zip(along, (place.own[:, fit.shooting.size :], errors), strict=True):
            row[rows[rows >= 0]] = x.reshape(len(x), knots.count, -1)[np.arange(len(x))[:, None], at, c][rows >= 0]
        s, tau = float(wander.deviation[c]), float(wander.time[c])
        of_s, of_tau = (
            (float(value * np.exp(-half * error)), float(value * np.exp(half * error)))
            for value, error in ((s, strength.deviation[c]), (tau, strength.time[c]))
        )
        found[label] = ProcessNoise(s, tau, along[0], along[1], of_s, of_tau, units[c])
    return found


def _units(system: System, knots: Knots) -> list[str]:
    """The unit of each component, as the system knows it."""
    assert system.parameters is not None
    first = _arrays(system.parameters).get(NAME, (-6, None))[0]
    pushed = dict(enumerate(["N"] * 3 + ["N m"] * 3, start=first))
    told = dict(system.units)
    places = dict(zip(knots.component.tolist(), knots.places.tolist(), strict=True))
    units = [pushed.get(places[c]) or told.get(label.partition("[")[0], "") for c, label in enumerate(knots.labels)]
    return ["" if unit == "1" else unit for unit in units]
