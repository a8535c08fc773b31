"""The Laplacian of the sphere on matrices (Hoppe and Yau), inverted diagonal by diagonal."""

from __future__ import annotations

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint.arrays import Array
from coadjoint.kernels.run.xla_function import XlaFunction
from coadjoint.models.fluids.laplacian_sweep import emit_sweep


def tridiagonal(size: int, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Δ_N on the mth diagonal: its diagonal (N − m,) and off-diagonal (N − m − 1,); eigenvalues −l(l + 1), l ≥ m."""
    i = np.arange(size - m, dtype=float)
    diagonal = -((size - 1) * (2 * i + 1 + m) - 2 * i * (i + m))
    i = i[1:]
    return diagonal, np.sqrt((i + m) * (size - i - m) * i * (size - i))


@lru_cache(maxsize=16)
def _factors(size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Multipliers, 1/pivots and off-diagonals of all diagonals, (N, N): a column holds diagonals m and m − N.

    The singular one, m = 0, is held at its first entry.
    """
    diagonal, above = np.zeros((2, size, size))
    for m in range(size):
        parts = [tridiagonal(size, m), *([tridiagonal(size, size - m)] if m else [])]
        diagonal[:, m] = np.concatenate([part[0] for part in parts])
        ends = np.cumsum([len(part[0]) for part in parts])
        for (_, off), end in zip(parts, ends, strict=True):
            above[end - len(off) - 1 : end - 1, m] = off
    diagonal[0, 0] -= 1.0
    lower, pivots = np.zeros((2, size, size))
    pivots[0] = diagonal[0]
    for i in range(1, size):
        lower[i] = above[i - 1] / pivots[i - 1]
        pivots[i] = diagonal[i] - lower[i] * above[i - 1]
    return lower, 1 / pivots, above


def skewed(rows: Array) -> Array:
    """The matrix (N, N) with entries R[i, (i + j) mod N]: the diagonals of R (N, N) as columns, without a gather."""
    size = rows.shape[0]
    twice = jnp.concatenate([jnp.concatenate([rows, rows], axis=1).reshape(-1), jnp.zeros(size)])
    return twice.reshape(size, 2 * size + 1)[:, :size]


def straight(columns: Array) -> Array:
    """The inverse of `skewed`, (N, N) of columns (N, N)."""
    size = columns.shape[0]
    twice = jnp.concatenate([columns, columns], axis=1).reshape(-1)
    return twice[size:].reshape(size, 2 * size - 1)[:, :size]


def _swept(rows: Array, lower: Array, inverse: Array, above: Array) -> tuple[Array]:
    """ψ by rows (N, N) of ω by rows (N, N) and of `_factors`, by one loop forward over all diagonals and one back."""
    size = rows.shape[0]
    right = skewed(rows)
    right = right - np.eye(1, size) * jnp.mean(right[:, 0])

    def forward(last, row):
        now = row[0] - row[1] * last
        return now, now

    def backward(last, row):
        now = (row[0] - row[1] * last) * row[2]
        return now, now

    nothing = jnp.zeros(size)
    _, found = lax.scan(forward, nothing, (right, lower))
    _, found = lax.scan(backward, nothing, (found, above, inverse), reverse=True)
    return (straight(found - np.eye(1, size) * jnp.mean(found[:, 0])),)


_sweep = XlaFunction("sweep", emit_sweep, _swept)


def _solved(rows: Array) -> Array:
    factors = _factors(rows.shape[0])
    return (_sweep if rows.dtype == float else _swept)(rows, *factors)[0]


def _applied(rows: Array) -> Array:
    size = rows.shape[0]
    diagonal, above = np.zeros((2, size, size))
    for m in range(size):
        for part, begin in ((tridiagonal(size, m), 0), (tridiagonal(size, size - m), size - m)):
            end = begin + len(part[0])
            diagonal[begin:end, m] = part[0]
            above[begin : end - 1, m] = part[1]
    columns = skewed(rows)
    zero = jnp.zeros((1, size))
    after, before = jnp.concatenate([columns[1:], zero]), jnp.concatenate([zero, (above * columns)[:-1]])
    return straight(diagonal * columns + above * after + before)


def laplacian(size: int, omega: Array) -> Array:
    """Δ_N ω, both coordinates (N²,) on U(N)."""
    return _applied(omega.reshape(size, size)).reshape(-1)


def inverse_laplacian(size: int, omega: Array) -> Array:
    """ψ with Δ_N ψ = ω less its mean, and of mean 0, both coordinates (N²,) on U(N): N tridiagonal systems in one pass.

    The coordinates of U(N) by rows are a matrix whose diagonals are those of W, real parts above and imaginary ones
    below, so that Δ_N acts on them as on W.
    """

    def solve(_, right):
        return _solved(right)

    rows = lax.custom_linear_solve(_applied, omega.reshape(size, size), solve, symmetric=True)
    return rows.reshape(-1)


@jax.custom_jvp
def dirichlet(omega: Array) -> Array:
    """−½⟨ω, Δ_N⁻¹ω⟩, one number, of coordinates (N²,); its gradient −Δ_N⁻¹ω takes one solution."""
    size = round(np.sqrt(omega.shape[0]))
    return -0.5 * omega @ inverse_laplacian(size, omega)


@dirichlet.defjvp
def _dirichlet_slope(primals, tangents):
    (omega,), (along,) = primals, tangents
    psi = inverse_laplacian(round(np.sqrt(omega.shape[0])), omega)
    return -0.5 * omega @ psi, -psi @ along
