"""Thrusts that dead bands let through: those of least squares among nothing, an edge of the band and beyond it.

A thruster within its dead band is put on nothing or on an edge, and the others make up for it: with G = (AᵀA + ε 1)⁻¹
the thrusts of least |A (f − f₀)|² with f_i = c are f + (c − f_i) G_i/G_ii, and G − G_i G_iᵀ/G_ii is that of the others.
Of all thrusters and values c the best one, others within their bands rounded, is taken, and so on for those left.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.extending import while_loops
from coadjoint_vehicles.parts.bounded_thrusts import least_squares

EPSILON = 1e-9
"""ε, where the largest singular value of A is that of its rows of weight 1; and of several the least ε |f|²."""

ON_EDGE = 1e-9
"""How far beyond an edge, relative to it, a thrust still is on it."""

Choice = tuple[Array, Array, Array, Array, Scalar]
"""Thrusts, G, 1 for a thruster that has been put, the best thrusts with bands, and their squares."""


def outside(A: np.ndarray, f0: Array, f: Array, low: np.ndarray, high: np.ndarray, edges: np.ndarray) -> Array:
    """Thrusts (n,) outside of dead bands, of little |A (f − f₀)|², from those within the limits, f, (n,).

    edges: the thrusts at both edges of each band, (2, n), below and above 0; A, (m, n), low and high as in `bounded`.
    """
    count, aim = A.shape[1], A @ f0
    ends = np.where((edges >= low) & (edges <= high), edges, 0.0)
    values = jnp.asarray(np.stack([np.zeros(count), *ends]))

    def within(x: Array) -> Array:
        return (x > edges[0]) & (x < edges[1]) & (x != 0)

    def rounded(x: Array) -> Array:
        nearest = jnp.where(x > 0.5 * edges[1], ends[1], jnp.where(x < 0.5 * edges[0], ends[0], 0.0))
        return jnp.where(within(x), nearest, x)

    def squares(x: Array) -> Array:
        return jnp.sum((x @ A.T - aim) ** 2, axis=-1) + EPSILON * jnp.sum(x**2, axis=-1)

    def put(choice: Choice) -> Choice:
        x, G, done, best, least = choice
        own = jnp.where(done > 0, 1.0, jnp.diagonal(G))
        moved = jnp.clip(x + ((values - x) / own)[:, :, None] * G, low, high).reshape(-1, count)
        tried = rounded(moved)
        costs = jnp.where(jnp.tile(done, len(values)) > 0, jnp.inf, squares(tried))
        place = jnp.argmin(costs)
        chosen = jnp.arange(count) == place % count
        row = jnp.sum(jnp.where(chosen[:, None], G, 0.0), axis=0)
        pivot = jnp.sum(jnp.where(chosen, row, 0.0))
        better = costs[place] < least
        following = jnp.where(better, tried[place], best), jnp.where(better, costs[place], least)
        return moved[place], G - jnp.outer(row, row) / pivot, jnp.where(chosen, 1.0, done), *following

    def left(choice: Choice) -> Array:
        return jnp.any(within(choice[0]) & (choice[2] == 0))

    begun = rounded(f)
    inverse = jnp.asarray(np.linalg.inv(A.T @ A + EPSILON * np.eye(count)))
    _, _, _, found, _ = while_loops.keep_loop(left, put, (f, inverse, jnp.zeros(count), begun, squares(begun)))
    further = (1 + ON_EDGE) * edges
    free = ((found < further[0]) | (found > further[1])) & (found > low) & (found < high)
    return while_loops.with_slope(found, jnp.where(free, least_squares(A, f0, free), 0.0))
