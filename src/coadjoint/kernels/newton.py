"""Newton's method for the unknowns of one stage, differentiable through the implicit function theorem."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, TOLERANCE, Code


class Root(NamedTuple):
    """Where Newton ended: unknowns (m,), iterations done, and the code."""

    unknowns: jax.Array
    iterations: jax.Array
    code: jax.Array


class _Iterate(NamedTuple):
    unknowns: jax.Array
    iterations: jax.Array
    settled: jax.Array


def solve(residual: Callable[[jax.Array], jax.Array], guess: jax.Array, h: jax.Array) -> Root:
    """Solve residual(z) = 0 from `guess`: z ← z − J⁻¹ r until |δ|∞ ≤ TOLERANCE·|z|∞ + FLOOR/|h|.

    Derivatives of the result follow from the implicit function theorem, ∂z = −J⁻¹ ∂r: they cost one linear solve
    and do not depend on how Newton went.
    """

    def settle(function, start):
        def advance(iterate: _Iterate) -> _Iterate:
            z = iterate.unknowns
            increment = jnp.linalg.solve(jax.jacfwd(function)(z), -function(z))
            z = z + increment
            size = jnp.max(jnp.abs(increment), initial=0.0)
            scale = TOLERANCE * jnp.max(jnp.abs(z), initial=0.0) + FLOOR / jnp.abs(h)
            # A NaN compares false and would go on for ever: it settles here and is told apart below.
            return _Iterate(z, iterate.iterations + 1, (size <= scale) | ~jnp.isfinite(size))

        end = lax.while_loop(
            lambda i: ~i.settled & (i.iterations < MAX_ITERATIONS),
            advance,
            _Iterate(start, jnp.asarray(0), jnp.asarray(False)),
        )
        code = jnp.where(
            ~jnp.all(jnp.isfinite(end.unknowns)),
            Code.NOT_FINITE,
            jnp.where(end.settled, Code.CONVERGED, Code.NOT_CONVERGED),
        )
        # As floats: custom_root gives whole numbers tangents that its own rule refuses.
        return end.unknowns, (end.iterations.astype(float), code.astype(float))

    def tangent_solve(linear, right_side):
        return jnp.linalg.solve(jax.jacfwd(linear)(jnp.zeros_like(right_side)), right_side)

    unknowns, (iterations, code) = lax.custom_root(residual, guess, settle, tangent_solve, has_aux=True)
    return Root(unknowns, iterations.astype(int), code.astype(int))
