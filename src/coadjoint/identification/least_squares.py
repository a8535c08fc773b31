"""Levenberg–Marquardt for segments with separate unknowns and shared ones.

min ½ Σ_s |r_s(δ_s, φ)|²: with A_s = ∂r_s/∂δ_s and B_s = ∂r_s/∂φ, δ_s is eliminated from the normal equations,
(Σ_s B_sᵀB_s − B_sᵀA_s(A_sᵀA_s)⁻¹A_sᵀB_s) dφ = −Σ_s(B_sᵀ − B_sᵀA_s(A_sᵀA_s)⁻¹A_sᵀ) r_s.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from coadjoint.arrays import PyTree

TRIPS = 100
"""Simulations, those that were not accepted among them."""

SETTLED = 1e-3
"""The iteration ends where the next step is below this part of every standard error."""

DROP = 1e-10
"""It also ends where the sum of squares falls by less than this part of itself."""

STATIONARY = 0.05
"""This holds only if one Gauss–Newton step without damping is below this part of every standard error."""

ROUGH = 1e-2
"""The same for a rough start."""

FARTHEST = 1.0
"""The largest change of a shared unknown in one iteration; larger steps are damped more."""

FORGOTTEN = 1e-8
"""Its root: the standard error of a number of a start relative to that in segments that know it best, beyond which it
counts as forgotten."""

UNSEEN = 1e-12
"""Relative to the largest column of a segment: a shorter one is round-off, of a start that the log does not
determine."""


class Estimates(NamedTuple):
    """φ (m,) and δ (segments, d)."""

    shared: np.ndarray
    own: np.ndarray


class LeastSquares(Protocol):
    def residual(self, place: Estimates) -> tuple[np.ndarray, PyTree] | None:
        """r, (segments, rows), and the data that `jacobian` needs; None if the simulation fails."""
        ...

    def jacobian(self, place: Estimates, way: Any) -> np.ndarray:
        """∂r/∂(δ, φ), (segments, rows, d + m)."""
        ...


class Solution(NamedTuple):
    """The solution; `squares` = |r|²."""

    place: Estimates
    residual: np.ndarray
    jacobian: np.ndarray
    squares: float
    trips: int
    converged: bool


def least_squares(
    problem: LeastSquares,
    start: Estimates,
    accepted: Callable[[Any], None] | None = None,
    roughly: bool = False,
    blind: np.ndarray | None = None,
) -> Solution | None:
    """The least sum of squares from `start`; None where there is no residual at the start.

    `roughly`: for a start only, up to a part ROUGH of the sum of squares. `blind`: of `step`.
    """
    first = problem.residual(start)
    if first is None:
        return None
    place, (r, way) = start, first
    J = problem.jacobian(place, way)
    damping, squares, converged, trip = 1e-3, float(np.vdot(r, r)), False, 0
    while trip < TRIPS and not converged and damping <= 1e12:
        shared, own, errors = step(J, r, place.own.shape[1], damping, blind)
        if np.max(np.abs(shared), initial=0.0) > FARTHEST:
            damping = max(4 * damping, 1e-6)
            continue
        trip += 1
        trial = Estimates(place.shared + shared, place.own + own)
        found = problem.residual(trial)
        better = np.inf if found is None else float(np.vdot(found[0], found[0]))
        small = bool(np.all(np.abs(shared) < SETTLED * errors))
        if not better <= squares:
            if small and damping <= 1e-4 and better <= squares * (1 + 1e-9):
                converged = stationary(J, r, place.own.shape[1], blind)
            damping = max(4 * damping, 1e-6)
            continue
        assert found is not None
        converged = (small and damping <= 1e-2) or (
            squares - better <= (ROUGH if roughly else DROP) * squares and damping <= 1e-2
        )
        place, (r, way), squares = trial, found, better
        if accepted is not None:
            accepted(way)
        damping = max(damping / 10, 1e-12)
        J = problem.jacobian(place, way)
        # Damping that is small against a parameter's column may be large against its part outside the span of the
        # starts.
        converged = converged and (roughly or stationary(J, r, place.own.shape[1], blind))
    # If only a kink or round-off prevents steps from being accepted, the iteration has ended as well.
    converged = converged or (not roughly and stationary(J, r, place.own.shape[1], blind))
    return Solution(place, r, J, squares, trip, converged)


def stationary(J: np.ndarray, r: np.ndarray, d: int, blind: np.ndarray | None = None) -> bool:
    """Whether the next Gauss–Newton step is far inside the standard errors."""
    shared, _, errors = step(J, r, d, 0.0, blind)
    return bool(np.all(np.abs(shared) < STATIONARY * errors))


def step(
    J: np.ndarray, r: np.ndarray, d: int, damping: float, blind: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(dφ, dδ, standard errors of φ) of the damped normal equations; J (segments, rows, d + m), r (segments, rows).

    `blind`: which segments have no samples at their start (segments,). Later ones have forgotten parts of it, along
    which a step would go far: it is damped by FORGOTTEN of what other segments know of the same number.
    """
    H = J.swapaxes(1, 2) @ J
    g = np.einsum("srk,sr->sk", J, r)
    diagonal = np.einsum("skk->sk", H)
    own = diagonal[:, :d]
    own = np.where(own > UNSEEN**2 * np.max(diagonal, axis=1, keepdims=True), own, 1.0)
    held = (damping + 1e-13) * own
    if blind is not None:
        held = np.where(blind[:, None], np.maximum(held, (damping + FORGOTTEN) * np.max(own, axis=0)), held)
    steep = H[:, :d, :d] + np.einsum("sk,kj->skj", held, np.eye(d))
    right = np.concatenate([H[:, :d, d:], g[:, :d, None]], axis=2)
    solved = np.linalg.solve(steep, right)
    across = H[:, d:, :d]
    S = np.sum(H[:, d:, d:] - across @ solved[..., :-1], axis=0)
    b = np.sum(g[:, d:] - np.einsum("sij,sj->si", across, solved[..., -1]), axis=0)
    scale = np.sum(diagonal[:, d:], axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    S = 0.5 * (S + S.T) + np.diag(1e-13 * scale)
    shared = -np.linalg.solve(S + np.diag(damping * scale), b)
    # Of the undamped equations: with little information in the log, a large step may be insignificant.
    errors = np.sqrt(np.abs(np.diag(np.linalg.inv(S))))
    return shared, -(solved[..., -1] + solved[..., :-1] @ shared), errors


def reduced(J: np.ndarray, d: int) -> tuple[np.ndarray, np.ndarray]:
    """(B̃, h): ∂r/∂φ without the part that the segments' own unknowns can absorb, (segments, rows, m), and the share of
    each residual that they absorb, (segments, rows): the diagonal of A(AᵀA)⁻¹Aᵀ."""
    A, B = J[..., :d], J[..., d:]
    size = np.linalg.norm(A, axis=1, keepdims=True)
    A = np.where(size > UNSEEN * np.max(size, axis=2, keepdims=True), A / np.where(size > 0, size, 1.0), 0.0)
    # Columns of length one: round-off in dependent ones is far below the 1e-12 that is added.
    L = np.linalg.cholesky(A.swapaxes(1, 2) @ A + 1e-12 * np.eye(d))
    Q = np.linalg.solve(L, A.swapaxes(1, 2)).swapaxes(1, 2)
    for _ in range(2):
        B = B - Q @ (Q.swapaxes(1, 2) @ B)
    return B, np.sum(Q**2, axis=2)


def freedom(J: np.ndarray, there: np.ndarray, d: int) -> np.ndarray:
    """The number of samples of each channel less the degrees of freedom of the fit."""
    B, taken = reduced(J, d)
    flat = B.reshape(-1, B.shape[2])
    flat = flat / np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
    C = np.linalg.pinv(flat.T @ flat, rcond=1e-12, hermitian=True)
    taken = taken + np.sum((flat @ C) * flat, axis=1).reshape(taken.shape)
    taken = taken[:, : there[0].size].reshape(there.shape)
    return np.sum(np.where(there, 1 - taken, 0.0), axis=(0, 1))
