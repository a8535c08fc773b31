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

Path = tuple[Array, Array, Scalar, Scalar, Scalar]
"""t, and at its end f; −1, 0 or 1 for each thruster at its lowest thrust, free, at its highest; s; pieces; steps."""


def bounded(A: np.ndarray, f0: Array, low: np.ndarray, high: np.ndarray) -> Array:
    """f, (n,), of A, (m, n), f₀, (n,), and limits low ≤ 0 ≤ high, (n,)."""
    bottom, top, aim = jnp.asarray(low), jnp.asarray(high), jax.lax.stop_gradient(f0)

    def goes_on(path: Path) -> Array:
        return (path[2] < 1) & (path[3] < PIECES * A.shape[1])

    def onward(path: Path) -> Path:
        # A piece and a step share one solution of linear equations: machine code has them once.
        t, at, s, pieces, steps = path
        free, along = at == 0, goes_on(path)
        f = _within(t, at, bottom, top)
        g = jnp.where(free, A.T @ (A @ (s * aim - f)), 0.0)
        right = A @ jnp.where(along, jnp.where(free, 0.0, aim), g)
        x = A.T @ _solved(A, free, jnp.where(along, EPSILON, FINE), right)
        d = aim + x
        nearest = jnp.where(jnp.where(free, d, at) > 0, top, bottom)
        meets = jnp.where(free, d != 0, at * d < 0)
        far = jnp.where(meets, jnp.maximum((nearest - t) / jnp.where(meets, d, 1.0), 0.0), 2.0)
        part = jnp.minimum(jnp.min(far), 1 - s)
        hit = (far <= part * (1 + TIES) + 1e-3 * TIES) & (s + part < 1)
        piece = jnp.where(hit, nearest, t + part * d)
        step = jnp.clip(f + jnp.where(free, g - x, 0.0) / FINE, bottom, top)
        now = jnp.where(along & hit, jnp.where(free, jnp.sign(d), 0.0), at)
        more = jnp.where(along, 1.0, 0.0)
        return jnp.where(along, piece, step), now, jnp.where(along, s + part, s), pieces + more, steps + 1 - more

    room = jnp.where(aim == 0, 1.0, jnp.where(aim > 0, top, bottom) / jnp.where(aim == 0, 1.0, aim))
    first, none = jnp.minimum(jnp.min(room), 1.0), jnp.zeros(())
    start = (first * aim, jnp.zeros_like(aim), first, none, none)
    t, at, *_ = while_loops.keep_loop(
        lambda path: (first < 1) & (goes_on(path) | (path[4] < REFINEMENTS)), onward, start
    )
    free = at == 0
    return while_loops.with_slope(_within(t, at, bottom, top), jnp.where(free, least_squares(A, f0, free), 0.0))


def least_squares(A: np.ndarray, f0: Array, free: Array) -> Array:
    """f of least |A (f − f₀)|², (n,), over the free thrusters, the others 0; the others' entries mean nothing."""
    return f0 + A.T @ _solved(A, free, FINE, A @ jnp.where(free, 0.0, f0))


def _within(t: Array, at: Array, bottom: Array, top: Array) -> Array:
    """f of t: at its limits, and clipped to them."""
    return jnp.where(at == 0, jnp.clip(t, bottom, top), jnp.where(at > 0, top, bottom))


def _solved(A: np.ndarray, free: Array, epsilon: Array | float, right: Array) -> Array:
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
