"""Which rows of constraints all others follow from, by the rank of A M⁻¹Aᵀ."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array

DEPENDENT = 1e-11
"""The smallest eigenvalue of A M⁻¹Aᵀ in units of its diagonal, relative to the largest, of an independent row."""

APART = 0.1
"""What rows that were taken leave of the diagonal of A M⁻¹Aᵀ, relative to it, at a row that is taken in its order."""


def rank_of(matrix: np.ndarray) -> int:
    """The rank of A M⁻¹Aᵀ (m, m), whatever the units of its rows; 0 where it is not finite."""
    if not np.all(np.isfinite(matrix)):
        return 0
    sizes = np.abs(np.linalg.eigvalsh(_scaled(np, matrix)))
    return int(np.sum(sizes > DEPENDENT * np.max(sizes, initial=0.0)))


def independent_rows(matrix: np.ndarray) -> tuple[int, ...]:
    """Rows of A M⁻¹Aᵀ (m, m) as many as its rank, each the first that does not follow from those before it.

    So a loop loses rows of the joint that closes it, and those of the tree that is left stay independent as it moves.
    Where none is left, it is the best of those that nearly follow.
    """
    left, found = _scaled(np, matrix), np.zeros(len(matrix), bool)
    for _ in range(rank_of(matrix)):
        row, left = _next(np, left)
        found[row] = True
    return tuple(np.flatnonzero(found).tolist())


def kept_rows(matrix: Array) -> Array:
    """`independent_rows` of a matrix that JAX traces: (m,), 1 at each of them, 0 at the others, without derivatives."""
    left = _scaled(jnp, jax.lax.stop_gradient(matrix))
    sizes = jnp.abs(jnp.linalg.eigvalsh(left))
    rank = jnp.sum(sizes > DEPENDENT * jnp.max(sizes))

    def more(k: Array, both: tuple[Array, Array]) -> tuple[Array, Array]:
        kept, before = both
        row, after = _next(jnp, before)
        wanted = k < rank
        return jnp.where(wanted & (jnp.arange(len(kept)) == row), 1.0, kept), jnp.where(wanted, after, before)

    return jax.lax.fori_loop(0, len(matrix), more, (jnp.zeros(len(matrix)), left))[0]


def _scaled(numbers: Any, matrix: Array) -> Array:
    """The symmetric part in units of the diagonal; numbers: the module, NumPy's or JAX's."""
    scale = 1 / numbers.sqrt(numbers.maximum(numbers.abs(numbers.diag(matrix)), np.finfo(float).tiny))
    return scale[:, None] * (0.5 * (matrix + matrix.T)) * scale


def _next(numbers: Any, left: Array) -> tuple[Array, Array]:
    """The row to take, and what it leaves of the others."""
    sizes = numbers.abs(numbers.diag(left))
    first = sizes > APART
    row = numbers.argmax(numbers.where(numbers.any(first), first, sizes))
    others = numbers.arange(len(left)) != row
    rest = left - numbers.outer(left[:, row], left[row]) / left[row, row]
    return row, numbers.where(others[:, None] & others, rest, 0.0)
