"""Coloured noise: a Gauss–Markov process of the first order, whitened by its prediction errors.

Of noise e with standard deviation σ and correlation time τ, E e(t)e(t + Δ) = σ² exp(−|Δ|/τ), sampled at times t_i,
w_i = (e_i − a_i e_{i−1})/√(1 − a_i²), a_i = exp(−(t_i − t_{i−1})/τ), are independent with standard deviation σ,
for any missing samples. τ maximises the restricted likelihood, which accounts for the noise that the fit absorbs:

    −2 log L = N log σ² + Σ log(1 − a_i²) + Σ w_i²/σ² + log |JᵀV⁻¹J|:

Harville (1977), Maximum likelihood approaches to variance component estimation, J. Am. Stat. Assoc. 72, section 4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import optimize

SHORTEST, LONGEST = 0.2, 2.0
"""The range of correlation times: from this part of the time between samples to so many segments."""


class Neighbours(NamedTuple):
    """Of every sample, (segments, samples, channels): the previous one of the channel, and the time since then, s;
    infinite for the first of a segment and if there is none."""

    before: np.ndarray
    between: np.ndarray


class Channel(NamedTuple):
    """One channel at the solution of least squares: differences (segments, samples), their derivatives
    (segments, samples, columns), its neighbours, and its number of samples less the degrees of freedom of the fit."""

    off: np.ndarray
    slopes: np.ndarray
    near: Neighbours
    freedom: float


def neighbours(time: np.ndarray, there: np.ndarray) -> Neighbours:
    """time: (segments, samples), s; there: (segments, samples, channels), whether it was measured."""
    number = np.where(there, np.arange(there.shape[1])[:, None], -1)
    last = np.maximum.accumulate(number, axis=1)
    before = np.concatenate([np.full((len(there), 1, there.shape[2]), -1), last[:, :-1]], axis=1)
    known = there & (before >= 0)
    before = np.where(known, before, 0)
    segments = np.arange(len(there))[:, None, None]
    return Neighbours(before, np.where(known, time[..., None] - time[segments, before], np.inf))


def whitened(values: np.ndarray, near: Neighbours, times: np.ndarray) -> np.ndarray:
    """w of values (segments, samples, …, channels), for correlation times τ of the channels, s; 0 of white noise."""
    if not np.any(times):
        return values
    a = following(near, times)
    spread = (slice(None), slice(None), *[None] * (values.ndim - 3))
    came = np.take_along_axis(values, np.broadcast_to(near.before[spread], values.shape), axis=1)
    return (values - a[spread] * came) / np.sqrt(1 - a[spread] ** 2)


def following(near: Neighbours, times: np.ndarray) -> np.ndarray:
    """a of every sample."""
    return np.where(times > 0, np.exp(-near.between / np.where(times > 0, times, 1.0)), 0.0)


def correlation_time(channel: Channel, others: np.ndarray, d: int, shortest: float, longest: float) -> float:
    """τ of a channel, s, between two bounds; 0 if the shortest is the most likely.

    others: JᵀV⁻¹J of all other channels, (segments, columns, columns); d of the columns are each segment's own.
    """
    near = Neighbours(channel.near.before[..., None], channel.near.between[..., None])
    scale = np.sqrt(np.maximum(np.einsum("skk->k", others), 1e-300))

    def unlikely(logarithm: float) -> float:
        times = np.array([np.exp(logarithm)])
        w = whitened(channel.off[..., None], near, times)
        J = whitened(channel.slopes[..., None], near, times)[..., 0] / scale
        variance = float(np.sum(w**2)) / channel.freedom
        H = others / np.outer(scale, scale) + J.swapaxes(1, 2) @ J / variance
        apart = np.sum(np.log(1 - following(near, times) ** 2))
        return float(np.count_nonzero(channel.off) * np.log(variance) + apart + _log_determinant(H, d))

    found = optimize.minimize_scalar(unlikely, bounds=(np.log(shortest), np.log(longest)), method="bounded")
    best = float(np.exp(found.x))
    return best if best > 1.2 * shortest else 0.0


def _log_determinant(H: np.ndarray, d: int) -> float:
    """log |H| of all segments' own columns and the shared ones, from (segments, d + m, d + m)."""
    own = H[:, :d, :d] + 1e-12 * np.einsum("skk->sk", H[:, :d, :d])[:, None, :] * np.eye(d) + 1e-300 * np.eye(d)
    S = np.sum(H[:, d:, d:] - H[:, d:, :d] @ np.linalg.solve(own, H[:, :d, d:]), axis=0)
    m = len(S)
    S = S + 1e-12 * np.diag(np.diag(np.sum(H[:, d:, d:], axis=0))) if m else S
    return float(np.sum(np.linalg.slogdet(own)[1]) + np.linalg.slogdet(S)[1])
