"""Process noise: an unmodelled force, or parameters, that vary randomly about their values.

x(t) is an Ornstein–Uhlenbeck process of deviation s and correlation time τ, held over knots of Δ in each segment:

    x_0 = s w_0,  x_k = a x_{k−1} + s √(1 − a²) w_k,  a = exp(−Δ/τ),  w_k independent and normal of variance 1.

The knots of every segment are separate unknowns, and w_k are residuals in addition to those of the sensors. To first
order in x this is generalised least squares with the covariance V + F P⁻¹ Fᵀ of the noise of the sensors and of the
effect of x on them, F = ∂y/∂x, P⁻¹ = cov x. s and τ maximise the restricted likelihood

    −2 log L = min Σ |r|² + Σ |w|² + log |H + P| − log |P|,  H = JᵀV⁻¹J of knots, starts and parameters:

Henderson's mixed-model equations; Harville (1977), Maximum likelihood approaches to variance component estimation,
J. Am. Stat. Assoc. 72, sections 4 and 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import optimize

KNOT, MOST = 3, 40
"""Samples that a knot lasts, and knots of a segment, at most."""

SMALLEST, LARGEST = 1e-3, 1e5
"""Bounds of s, relative to the error of the best determined knot alone."""

AT_BOUND, CURVED, FLAT = 1e-3, 1e-3, 1e-3
"""Of log s and log τ: the distance that counts as at a bound, the step of differences, and the curvature that counts as
flat."""


class Wander(NamedTuple):
    """s and τ, s, of every component."""

    deviation: np.ndarray
    time: np.ndarray


@dataclass(frozen=True)
class Knots:
    """`labels`: of the components. `places`, `component`: the numbers of the parameters that each of them moves.
    `spacing`: Δ, s; `count`: of a segment."""

    labels: tuple[str, ...]
    places: np.ndarray
    component: np.ndarray
    spacing: float
    count: int

    @property
    def size(self) -> int:
        """The number of unknowns x of a segment, knot after knot."""
        return self.count * len(self.labels)

    def roots(self, wander: Wander) -> np.ndarray:
        """L of every component, (components, knots, knots), with w = L x: P = LᵀL."""
        return np.stack([self._root(s, tau) for s, tau in zip(*wander, strict=True)])

    def _root(self, s: float, tau: float) -> np.ndarray:
        a = np.exp(-self.spacing / tau)
        new = np.sqrt(-np.expm1(-2 * self.spacing / tau))
        L = np.eye(self.count) / new - np.eye(self.count, k=-1) * a / new
        L[0, 0] = 1.0
        return L / s

    def spread(self, each: np.ndarray) -> np.ndarray:
        """Matrices (components, knots, knots) as one of all x."""
        n = len(self.labels)
        found = np.zeros((self.count, n, self.count, n))
        for c, matrix in enumerate(each):
            found[:, c, :, c] = matrix
        return found.reshape(self.size, self.size)


class Normal(NamedTuple):
    """Normal equations of the measurements, at x = 0: H (segments, q, q), g (segments, q), with columns of starts, then
    of knots `x`, which end the d unknowns of each segment, then of shared ones."""

    H: np.ndarray
    g: np.ndarray
    x: slice
    d: int


def normal_equations(J: np.ndarray, r: np.ndarray, knots: np.ndarray, x: slice, d: int) -> Normal:
    """From J and r where the knots are `knots`, (segments, size), without the residuals w."""
    H = J.swapaxes(1, 2) @ J
    g = np.einsum("srk,sr->sk", J, r) - np.einsum("skj,sj->sk", H[:, :, x], knots)
    return Normal(H, g, x, d)


def likeliest(given: Normal, knots: Knots, longest: float, begin: Wander | None = None) -> Wander:
    """s and τ of the greatest restricted likelihood; τ from Δ/2 to `longest`, s."""
    low, high = _bounds(given, knots, longest)
    n = len(knots.labels)
    if begin is None:
        begin = Wander(3 / SMALLEST * np.exp(low[:n]), np.full(n, 4 * knots.spacing))
    place = np.log(np.concatenate(begin))

    def unlikely(place: np.ndarray) -> tuple[float, np.ndarray]:
        return _unlikely(given, knots, Wander(*np.exp(place).reshape(2, n)))

    bounds = np.transpose([low, high])
    found = optimize.minimize(unlikely, np.clip(place, low, high), jac=True, bounds=bounds, method="L-BFGS-B")
    return Wander(*np.exp(found.x).reshape(2, n))


def _bounds(given: Normal, knots: Knots, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of log s and log τ; s relative to the error of the best determined knot alone."""
    n = len(knots.labels)
    seen = np.einsum("skk->k", given.H)[given.x].reshape(knots.count, n).max(axis=0)
    error = 1 / np.sqrt(np.maximum(seen / len(given.H), 1e-300))
    low, high = (
        np.concatenate([factor * error, np.full(n, time)])
        for factor, time in ((SMALLEST, knots.spacing / 2), (LARGEST, max(longest, knots.spacing / 2)))
    )
    return np.log(low), np.log(high)


def wander_errors(given: Normal, knots: Knots, longest: float, wander: Wander) -> Wander:
    """Standard errors of log s and log τ, from the curvature of the restricted likelihood, cov = 2 (∂²(−2 log L))⁻¹.

    Infinite for values at a bound, such as an s next to zero or the τ of a random walk; errors of the others hold with
    these fixed. Infinite also where the likelihood is flat.
    """
    n = len(knots.labels)
    place, (low, high) = np.log(np.concatenate(wander)), _bounds(given, knots, longest)
    free = np.flatnonzero((place > low + AT_BOUND) & (place < high - AT_BOUND))
    curved, found = np.zeros((2 * n, 2 * n)), np.full(2 * n, np.inf)
    for i in free:
        pair = [place + sign * CURVED * np.eye(2 * n)[i] for sign in (1, -1)]
        slopes = [_unlikely(given, knots, Wander(*np.exp(at).reshape(2, n)))[1] for at in pair]
        curved[i] = (slopes[0] - slopes[1]) / (2 * CURVED)
    values, V = np.linalg.eigh(0.5 * (curved + curved.T)[np.ix_(free, free)])
    flat = values <= FLAT
    variances = np.sum(V**2 * np.where(flat, 0.0, 2 / np.maximum(values, FLAT)), axis=1)
    found[free] = np.where(np.any(np.abs(V[:, flat]) > CURVED, axis=1), np.inf, np.sqrt(variances))
    return Wander(*found.reshape(2, n))


class Posterior(NamedTuple):
    """The posterior at s and τ: −2 log L up to a constant, and of the knots of every segment the most likely x,
    (segments, size), and their covariance, (segments, size, size)."""

    unlikely: float
    x: np.ndarray
    covariance: np.ndarray


def posterior(given: Normal, knots: Knots, wander: Wander) -> Posterior:
    """The posterior at s and τ, with starts and shared unknowns eliminated."""
    H, g, x, d = given
    L = knots.roots(wander)
    own = H[:, :d, :d].copy()
    own[:, x, x] += knots.spread(L.swapaxes(1, 2) @ L)
    own += (1e-12 * np.einsum("skk->sk", own) + 1e-300)[:, None, :] * np.eye(d)
    solved = np.linalg.solve(
        own, np.concatenate([H[:, :d, d:], g[:, :d, None], np.eye(d)[:, x][None].repeat(len(H), 0)], 2)
    )
    m = H.shape[2] - d
    across, mine, inverse = solved[..., :m], solved[..., m], solved[..., m + 1 :]
    S = np.sum(H[:, d:, d:] - H[:, d:, :d] @ across, axis=0)
    S += np.diag(1e-12 * np.diag(np.sum(H[:, d:, d:], axis=0)) + 1e-300)
    b = np.sum(g[:, d:] - np.einsum("sij,sj->si", H[:, d:, :d], mine), axis=0)
    shared = np.linalg.solve(S, b)
    value = -np.einsum("sk,sk->", g[:, :d], mine) - b @ shared
    value += np.sum(np.linalg.slogdet(own)[1]) + np.linalg.slogdet(S)[1]
    value -= 2 * len(H) * np.sum(np.log(np.einsum("ckk->ck", L)))
    covariance = inverse[:, x] + across[:, x] @ np.linalg.solve(S, across[:, x].swapaxes(1, 2))
    return Posterior(float(value), across[:, x] @ shared - mine[:, x], covariance)


def _unlikely(given: Normal, knots: Knots, wander: Wander) -> tuple[float, np.ndarray]:
    """−2 log L up to a constant, and its derivatives by log s and log τ."""
    value, best, covariance = posterior(given, knots, wander)
    n, segments = len(knots.labels), len(best)
    moment = np.sum(best[:, :, None] * best[:, None, :] + covariance, axis=0)
    each = [moment.reshape(knots.count, n, knots.count, n)[:, c, :, c] for c in range(n)]
    L = knots.roots(wander)
    by_deviation = [2 * knots.count * segments - 2 * np.sum((one.T @ one) * m) for one, m in zip(L, each, strict=True)]
    by_time = []
    for c, (s, tau) in enumerate(zip(*wander, strict=True)):
        turned = [knots._root(s, tau * np.exp(e)) for e in (1e-5, -1e-5)]
        change = (turned[0].T @ turned[0] - turned[1].T @ turned[1]) / 2e-5
        a = np.exp(-knots.spacing / tau)
        apart = 2 * (knots.count - 1) * a**2 * knots.spacing / tau / (1 - a**2)
        by_time.append(np.sum(change * each[c]) - segments * apart)
    return value, np.array(by_deviation + by_time)


def prediction_errors(r: np.ndarray, F: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """The innovation of each sample, (segments, samples, channels), over its deviation: that of a Kalman filter whose
    state is x, (size,), with the precision P.

    r: residuals over the noise where x = 0; F: (segments, samples, size, channels), their derivatives by x.
    """
    covariance = np.repeat(np.linalg.inv(precision)[None], len(r), axis=0)
    mean, found = np.zeros(covariance.shape[:2]), np.empty_like(r)
    for i in range(r.shape[1]):
        along = F[:, i].swapaxes(1, 2)
        gain = covariance @ F[:, i]
        L = np.linalg.cholesky(np.eye(r.shape[2]) + along @ gain)
        found[:, i] = np.linalg.solve(L, (r[:, i] + np.einsum("scx,sx->sc", along, mean))[..., None])[..., 0]
        half = np.linalg.solve(L, gain.swapaxes(1, 2))
        mean -= np.einsum("scx,sc->sx", half, found[:, i])
        covariance -= half.swapaxes(1, 2) @ half
    return found
