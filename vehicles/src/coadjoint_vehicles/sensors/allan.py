"""Allan deviations: of readings, and those that errors of a data sheet have in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError, shown
from coadjoint_vehicles.sensors.errors import Channel, Errors


def allan_deviation(values: object, rate: float, times: object) -> np.ndarray:
    """σ(τ) of readings of a constant, (len(times), m), from all overlapping pairs of neighbouring means over τ.

        σ²(τ) = ½ ⟨(ȳ_{k+n} − ȳ_k)²⟩, τ = n/rate

    values: (k, m), or (k,). rate: of readings, 1/s, one number. times: the τ, (…,) s, each rounded to a multiple of
    1/rate.
    Raises ArgumentError for readings that are not finite, for a τ that is shorter than the time between two readings,
    and for fewer readings than two means need. Source: IEEE Std 952-1997, annex C.
    """
    y = np.asarray(values, dtype=float)
    if y.ndim not in (1, 2) or not np.all(np.isfinite(y)):
        raise ArgumentError("An Allan deviation is one of finite readings (k,) or (k, m), but some are not.")
    y, rate = y[:, None] if y.ndim == 1 else y, _rate(rate)
    total = np.concatenate([np.zeros((1, y.shape[1])), np.cumsum(y - y.mean(axis=0), axis=0)])
    found = []
    for tau in _times(times):
        n = round(tau * rate) if tau * rate > 1 - 1e-9 else 0
        if n < 1:
            raise ArgumentError(
                f"An Allan deviation of readings at {rate:g}/s begins at {1 / rate:g} s, but is asked at {tau:g} s."
            )
        if 2 * n >= len(total):
            raise ArgumentError(
                f"An Allan deviation at {tau:g} s needs more than {2 * n / rate:g} s of readings, but there are "
                f"{len(y) / rate:g} s."
            )
        change = (total[2 * n :] - 2 * total[n:-n] + total[: -2 * n]) / n
        found.append(np.sqrt(0.5 * np.mean(change**2, axis=0)))
    return np.array(found)


def expected_allan_deviation(errors: Errors, channel: Channel, rate: float, times: object) -> np.ndarray:
    """σ(τ) of the errors of a channel, (len(times), m): white noise, Gauss–Markov bias and random walk.

        σ² = N²/τ + (2σ_b²T/τ)(1 − (T/2τ)(3 − 4e^{−τ/T} + e^{−2τ/T})) + K²τ/3, T = bias_time

    rate: of readings, 1/s, one number. times: τ, (…,) s. Raises ArgumentError unless these are positive. Source: IEEE
    Std 952-1997, annex C.
    """
    tau, size, rate = _times(times)[:, None], len(channel.components), _rate(rate)
    variance = errors.white(rate, size) ** 2 / (rate * tau) + errors.of("random_walk", size) ** 2 * tau / 3
    if errors.bias_time is not None:
        T = float(errors.bias_time)
        shape = 1 - T / (2 * tau) * (3 - 4 * np.exp(-tau / T) + np.exp(-2 * tau / T))
        variance = variance + 2 * errors.wandering(size) ** 2 * T / tau * shape
    return np.sqrt(variance)


def _times(times: object) -> np.ndarray:
    found = np.atleast_1d(np.asarray(times, dtype=float))
    if found.ndim != 1 or not np.all(np.isfinite(found) & (found > 0)):
        raise ArgumentError(f"The times of an Allan deviation must be positive numbers of seconds, not {shown(times)}.")
    return found


def _rate(rate: Any) -> float:
    number = not isinstance(rate, bool) and np.ndim(rate) == 0 and np.asarray(rate).dtype.kind in "iuf"
    checks.expect(number and 0 < rate < np.inf, rate, "The rate of readings", "a positive number, 1/s")
    return float(rate)
