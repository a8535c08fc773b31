"""MRG32k3a: random numbers in exact float64 arithmetic, bitwise identical wherever they are computed."""

from __future__ import annotations

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree

M1, M2 = 4294967087, 4294944443
FIRST, SECOND = (-810728, 1403580, 0), (-1370589, 0, 527612)
"""x_n = (1403580 x_{n−2} − 810728 x_{n−3}) mod m₁ and y_n = (527612 y_{n−1} − 1370589 y_{n−3}) mod m₂."""
BETWEEN_STREAMS = 127
"""Streams are 2¹²⁷ numbers apart."""
LARGEST_SEED = 2**53


def stream(seed: int) -> np.ndarray:
    """The state (x_0, x_1, x_2, y_0, y_1, y_2), (6,), where stream number `seed` begins; 0 begins at 12345, six times.

    Streams of different seeds are 2¹²⁷ seed numbers apart in one sequence of period 2¹⁹¹, so that they do not overlap.
    Raises ArgumentError unless the seed is an integer from 0 to 2⁵³. Source: L'Ecuyer, Simard, Chen and Kelton,
    Operations Research 50 (2002) 1073.
    """
    fits = float(seed) == int(seed) and 0 <= seed <= LARGEST_SEED
    checks.expect(fits, seed, "A seed", "a whole number from 0 to 2^53")
    found: list[int] = []
    for row, m in ((FIRST, M1), (SECOND, M2)):
        state, left, power = [12345] * 3, int(seed), 0
        while left:
            if left & 1:
                state = [sum(a * x for a, x in zip(r, state, strict=True)) % m for r in _leap(row, m, power)]
            left, power = left >> 1, power + 1
        found += state
    return np.array(found, dtype=float)


@cache
def _leap(row: tuple[int, ...], m: int, power: int) -> list[list[int]]:
    """A^(2^(127 + power)) mod m of the companion matrix A of the recurrence."""
    if power > 0:
        return _squared(_leap(row, m, power - 1), m)
    A = [[0, 1, 0], [0, 0, 1], [a % m for a in row]]
    for _ in range(BETWEEN_STREAMS):
        A = _squared(A, m)
    return A


def _squared(A: list[list[int]], m: int) -> list[list[int]]:
    return [[sum(A[i][k] * A[k][j] for k in range(3)) % m for j in range(3)] for i in range(3)]


def uniform(state: Array) -> tuple[Array, Array]:
    """(u, next state): u in (0, 1), u = ((x_n − y_n) mod m₁)/(m₁ + 1), with m₁ in the place of 0.

    All numbers before the division are integers below 2⁵³, so that nothing is rounded. Not differentiated.
    Source: L'Ecuyer, Operations Research 47 (1999) 159.
    """
    x0, x1, x2, y0, y1, y2 = jax.lax.stop_gradient(state)
    x = _modulo(FIRST[1] * x1 + FIRST[0] * x0, M1)
    y = _modulo(SECOND[2] * y2 + SECOND[0] * y0, M2)
    u = jnp.where(x > y, x - y, x - y + M1) / (M1 + 1)
    return u, jnp.stack([x1, x2, x, y1, y2, y])


def _modulo(value: Array, m: float) -> Array:
    """Of integers; the quotient may be off by one where the division is rounded."""
    rest = value - jnp.floor(value / m) * m
    rest = jnp.where(rest < 0, rest + m, rest)
    return jnp.where(rest >= m, rest - m, rest)


def normal(state: Array, count: int) -> tuple[Array, PyTree]:
    """(z, next state): z (count,) independent with mean 0 and variance 1, by Box and Muller.

    (z_1, z_2) = √(−2 ln u) (cos 2πv, sin 2πv).
    """
    found: list[Array] = []
    while len(found) < count:
        u, state = uniform(state)
        v, state = uniform(state)
        far = jnp.sqrt(-2 * jnp.log(u))
        found += [far * jnp.cos(2 * jnp.pi * v), far * jnp.sin(2 * jnp.pi * v)]
    return jnp.stack(found[:count]), state
