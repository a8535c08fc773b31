"""Thrusts within limits: bounded least squares along a path, in a fixed number of steps that can be traced.

For a matrix A, (m, n), and f₀ = A⁺y the thrusts with least |A (f − f₀)|² within l ≤ f ≤ u, of several the least |f|.
The path is f(s) for the wrench s y, 0 ≤ s ≤ 1, the optimum with the regularisation ε |f − s f₀|²:

    f = clip(t, l, u),    t = s f₀ + Aᵀλ,    ε λ = A (s f₀ − f),

along which t is piecewise linear: from piece to piece thrusters reach a limit or leave it. At its end steps of the
proximal point method, f ← f + (ε 1 + D AᵀA D)⁻¹ D AᵀA (f₀ − f) over the free thrusters D, remove ε.
Source: Härkegård (2002) for the problem, Osborne, Presnell and Turlach (2000), IMA J. Numer. Anal. 20, for such paths.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar

EPSILON = 1e-6
"""ε, where the largest singular value of A is that of its rows of weight 1."""
TIES = 1e-10
"""Thrusters that reach their limits within this part of a piece do so together."""
REFINEMENTS = 8
PIECES = 5
"""Pieces of the path for each thruster; one that needs more stops at the optimum for a part of the wrench."""


def bounded(A: np.ndarray, f0: Array, low: np.ndarray, high: np.ndarray) -> Array:
    """f, (n,), of A, (m, n), f₀, (n,), and limits low ≤ 0 ≤ high, (n,)."""
    E = EPSILON * np.eye(len(A))
    bottom, top = jnp.asarray(low), jnp.asarray(high)

    def gram(free: Array) -> Array:
        return E + (A * free) @ A.T

    def piece(state: tuple[Array, Array, Scalar], _: None) -> tuple[tuple[Array, Array, Scalar], None]:
        t, at, s = state  # at: −1, 0 or 1 at the lowest thrust, free, at the highest
        free = at == 0
        d = f0 + A.T @ _solved(gram(free), A @ jnp.where(free, 0.0, f0))
        nearest = jnp.where(jnp.where(free, d, at) > 0, top, bottom)
        meets = jnp.where(free, d != 0, at * d < 0)
        far = jnp.where(meets, jnp.maximum((nearest - t) / jnp.where(meets, d, 1.0), 0.0), 2.0)
        step = jnp.minimum(jnp.min(far), 1 - s)
        hit = (far <= step * (1 + TIES) + 1e-3 * TIES) & (s + step < 1)
        moved = jnp.where(hit, nearest, t + step * d)
        return (moved, jnp.where(hit, jnp.where(free, jnp.sign(d), 0.0), at), s + step), None

    zero = jnp.zeros(A.shape[1])
    (t, at, s), _ = jax.lax.scan(piece, (zero, zero, jnp.zeros(())), None, length=PIECES * A.shape[1])
    f = jnp.where(at == 0, jnp.clip(t, bottom, top), jnp.where(at > 0, top, bottom))
    free = jnp.where(at == 0, 1.0, 0.0)
    wanted, G = s * (A @ f0), gram(free)
    for _ in range(REFINEMENTS):
        g = free * (A.T @ (wanted - A @ f))
        f = jnp.clip(f + (g - free * (A.T @ _solved(G, A @ g))) / EPSILON, bottom, top)
    return f


def _solved(G: Array, right: Array) -> Array:
    """x with G x = right for a positive definite G."""
    return jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(G), True), right)


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
