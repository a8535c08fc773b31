"""The principal logarithm of a matrix with a fixed number of operations, so that native code and XLA run one formula.

Six square roots bring A near 1, and the Padé approximant of order 8 of log(1 + X) does the rest, as a sum over Gauss's
nodes. The roots are taken of X = A − 1,

    √(1 + X) − 1 = X (1 + √(1 + X))⁻¹,

which keeps the relative precision of X. The root of an orthogonal matrix is the orthogonal factor of 1 + A by Newton's
iteration, which at the angle π − δ loses 1/δ of the digits; that of any other matrix is by the product form of Denman
and Beavers' iteration, which loses 1/δ². Source: N. J. Higham, *Functions of Matrices* (2008), sections 6.3, 8.3, 11.4.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import lax

Array = Any

_TURNS = (44, 12, 10, 8, 7, 6)
"""Iterations of each square root. An eigenvalue at the angle π − δ needs log₂(1/δ) of the first."""
_AGREEMENT = 1e-9
"""How far the square of the first root may be from A, relative to A."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def logarithm(A: Array, *, orthogonal: bool = False) -> Array:
    """log A (N, N) with eigenvalues of imaginary part in (−π, π), of A (N, N), which may be known to be orthogonal.

    NaN where A has none: where it is singular or has eigenvalues on the negative real axis.
    """
    one = jnp.eye(A.shape[0])
    X = A - one
    for k, turns in enumerate(_TURNS):
        root = (_orthogonal_root if orthogonal else _square_root)(one + X, turns)
        if k == 0:
            off, size = (jnp.max(jnp.abs(M), initial=0.0) for M in (root @ root - A, A))
            root = jnp.where(off <= _AGREEMENT * size, root, jnp.nan)
        X = X @ jnp.linalg.inv(one + root)
    parts = (0.5 * w * X @ jnp.linalg.inv(one + 0.5 * (1 + x) * X) for x, w in zip(_NODES, _WEIGHTS, strict=True))
    return 2 ** len(_TURNS) * sum(parts, jnp.zeros_like(X))


def _square_root(A: Array, turns: int) -> Array:
    """√A: M ↦ ½(1 + ½(M + M⁻¹)), S ↦ ½S(1 + M⁻¹) from M = S = A, where M → 1."""
    one = jnp.eye(A.shape[0])

    def turn(_: Array, both: tuple[Array, Array]) -> tuple[Array, Array]:
        M, S = both
        back = jnp.linalg.inv(M)
        return 0.5 * (one + 0.5 * (M + back)), 0.5 * S @ (one + back)

    return lax.fori_loop(0, turns, turn, (A, A))[1]


def _orthogonal_root(A: Array, turns: int) -> Array:
    """√A of an orthogonal A: Y ↦ ½(Y + Y⁻ᵀ) from Y = 1 + A."""
    return lax.fori_loop(0, turns, lambda _, Y: 0.5 * (Y + jnp.linalg.inv(Y).T), jnp.eye(A.shape[0]) + A)
