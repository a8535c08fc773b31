"""Thrusts within limits: bounded least squares along a path, in loops that an allocation within the limits skips.

For a matrix A, (m, n), and f₀ = A⁺y the thrusts with least |A (f − f₀)|² within l ≤ f ≤ u, of several the least |f|.
The path is f(s) for the wrench s y, from the s at which the first thruster reaches its limit to 1, the optimum with the
regularisation ε |f − s f₀|²:

    f = clip(t, l, u),    t = s f₀ + Aᵀλ,    ε λ = A (s f₀ − f),

along which t is piecewise linear: from piece to piece thrusters reach a limit or leave it. At its end steps of the
proximal point method, f ← f + (ε 1 + D AᵀA D)⁻¹ D AᵀA (f₀ − f) over the free thrusters D, remove ε. The derivative by
f₀ is that of the least squares over the free thrusters.
Source: Härkegård (2002) for the problem, Osborne, Presnell and Turlach (2000), IMA J. Numer. Anal. 20, for such paths.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.extending import while_loops

EPSILON = 1e-6
"""ε of the path, where the largest singular value of A is that of its rows of weight 1."""
FINE = 1e-9
"""ε of the steps at its end and of the derivative."""
TIES = 1e-10
"""Thrusters that reach their limits within this part of a piece do so together."""
REFINEMENTS = 3
PIECES = 5
"""Pieces of the path for each thruster; one that needs more stops at the optimum for a part of the wrench."""

Path = tuple[Array, Array, Scalar, Scalar]
"""t; −1, 0 or 1 for each thruster at its lowest thrust, free, at its highest; s; the number of pieces."""


def bounded(A: np.ndarray, f0: Array, low: np.ndarray, high: np.ndarray) -> Array:
    """f, (n,), of A, (m, n), f₀, (n,), and limits low ≤ 0 ≤ high, (n,)."""
    bottom, top, aim = jnp.asarray(low), jnp.asarray(high), jax.lax.stop_gradient(f0)

    def piece(path: Path) -> Path:
        t, at, s, count = path
        free = at == 0
        d = aim + A.T @ _solved(A, free, EPSILON, A @ jnp.where(free, 0.0, aim))
        nearest = jnp.where(jnp.where(free, d, at) > 0, top, bottom)
        meets = jnp.where(free, d != 0, at * d < 0)
        far = jnp.where(meets, jnp.maximum((nearest - t) / jnp.where(meets, d, 1.0), 0.0), 2.0)
        step = jnp.minimum(jnp.min(far), 1 - s)
        hit = (far <= step * (1 + TIES) + 1e-3 * TIES) & (s + step < 1)
        moved = jnp.where(hit, nearest, t + step * d)
        return moved, jnp.where(hit, jnp.where(free, jnp.sign(d), 0.0), at), s + step, count + 1

    room = jnp.where(aim == 0, 1.0, jnp.where(aim > 0, top, bottom) / jnp.where(aim == 0, 1.0, aim))
    first, none = jnp.minimum(jnp.min(room), 1.0), jnp.zeros(())
    start = (first * aim, jnp.zeros_like(aim), first, none)
    t, at, s, _ = while_loops.keep_loop(lambda path: (path[2] < 1) & (path[3] < PIECES * A.shape[1]), piece, start)

    def refined(end: tuple[Array, Scalar]) -> tuple[Array, Scalar]:
        (f, count), free = end, at == 0
        g = jnp.where(free, A.T @ (A @ (s * aim - f)), 0.0)
        rest = jnp.where(free, A.T @ _solved(A, free, FINE, A @ g), 0.0)
        return jnp.clip(f + (g - rest) / FINE, bottom, top), count + 1

    free = at == 0
    f = jnp.where(free, jnp.clip(t, bottom, top), jnp.where(at > 0, top, bottom))
    f, _ = while_loops.keep_loop(lambda end: (first < 1) & (end[1] < REFINEMENTS), refined, (f, none))
    slope = f0 + A.T @ _solved(A, free, FINE, A @ jnp.where(free, 0.0, f0))
    return while_loops.with_slope(f, jnp.where(free, slope, 0.0))


def _solved(A: np.ndarray, free: Array, epsilon: float, right: Array) -> Array:
    """x with (ε 1 + A D Aᵀ) x = right."""
    gram = epsilon * np.eye(len(A)) + (A * free) @ A.T
    L = jax.lax.linalg.cholesky(jnp.asarray(gram), symmetrize_input=False)
    below = jax.lax.linalg.triangular_solve(L, right[:, None], left_side=True, lower=True)
    return jax.lax.linalg.triangular_solve(L, below, left_side=True, lower=True, transpose_a=True)[:, 0]


def independent(A: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """(rows, columns) of a matrix that no other rows and columns share; columns of zeros are left out."""
    found: list[tuple[np.ndarray, np.ndarray]] = []
    waiting = np.any(A != 0, axis=0)
    while np.any(waiting):
        columns = np.arange(A.shape[1]) == np.argmax(waiting)
        while True:
            rows = np.any(A[:, columns] != 0, axis=1)
            more = np.any(A[rows] != 0, axis=0)
            if np.array_equal(more, columns):
                break
            columns = more
        found.append((np.flatnonzero(rows), np.flatnonzero(columns)))
        waiting &= ~columns
    return found
