"""The exponential of a matrix with a fixed number of operations, so that native code and XLA run the same formula.

e^A − 1 is the Taylor polynomial of degree 12 at A/64, doubled six times by e^{2X} − 1 = 2Y + Y² with Y = e^X − 1, which
keeps the relative precision of Y. It is exact to round-off while |A³|^{1/3} and |A⁴|^{1/4} are at most REACH, and NaN
beyond. Powers are measured, because large nilpotent parts, such as translations, do no harm.
"""

from __future__ import annotations

from math import factorial
from typing import Any

import jax.numpy as jnp

Array = Any

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
