"""The exponential and the principal logarithm of a matrix, each by a fixed number of operations.

Native code and XLA run the same formulas.

**Exponential.** e^A − 1 is the Taylor polynomial of degree 12 at A/64, doubled six times by e^{2X} − 1 = 2Y + Y² with
Y = e^X − 1, which keeps the relative precision of Y. It is exact to round-off while |A³|^{1/3} and |A⁴|^{1/4} are at
most REACH, and NaN beyond. Powers are measured, because large nilpotent parts, such as translations, do no harm.

**Logarithm.** Six square roots bring A near 1, and the Padé approximant of order 8 of log(1 + X) completes the result,
as a sum over Gauss's nodes. The roots are taken of X = A − 1,

    √(1 + X) − 1 = X (1 + √(1 + X))⁻¹,

which keeps the relative precision of X. The root of an orthogonal matrix is the orthogonal factor of 1 + A by Newton's
iteration, which at the angle π − δ loses 1/δ of the digits; that of any other matrix is by the product form of Denman
and Beavers' iteration, which loses 1/δ². Source: N. J. Higham, *Functions of Matrices* (2008), sections 6.3, 8.3, 11.4.
"""

from __future__ import annotations

from math import factorial

import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint.arrays import Array

_DOUBLINGS = 6
_SMALL = 0.3
"""0.3¹²/13! < 1e-16: what the polynomial leaves of e^x − 1, relative to x."""
REACH = _SMALL * 2**_DOUBLINGS
"""How large A may be, 19.2: three turns, or a factor e^19."""


def exponential_minus_one(A: Array) -> Array:
    """e^A − 1 (N, N) for A (N, N), NaN beyond REACH."""
    one, x = jnp.eye(A.shape[0]), A / 2**_DOUBLINGS
    x2 = x @ x
    x3, x4 = x2 @ x, x2 @ x2

    def block(first: int, *powers: Array) -> Array:
        return sum(power / factorial(first + j) for j, power in enumerate(powers))  # type: ignore[return-value]

    y = block(1, x, x2, x3) + x4 @ (block(4, one, x, x2, x3) + x4 @ block(8, one, x, x2, x3, x4))
    for _ in range(_DOUBLINGS):
        y = 2 * y + y @ y
    within = (_norm(x3) <= _SMALL**3) & (_norm(x4) <= _SMALL**4)
    return jnp.where(within, y, jnp.nan)


def exponential(A: Array) -> Array:
    """e^A (N, N) for A (N, N), NaN beyond REACH."""
    return jnp.eye(A.shape[0]) + exponential_minus_one(A)


def _norm(A: Array) -> Array:
    """The largest sum of absolute values of a column."""
    return jnp.max(jnp.sum(jnp.abs(A), axis=0))


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
