"""Newton's method for the unknowns of one stage, differentiable through the implicit function theorem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, STALLED, TOLERANCE, Code, Structure


class Root(NamedTuple):
    """The result of Newton's method: unknowns (m,), iterations done, the code, and the data carried over to the next
    step.

    found: further results of the structure, for `Stage.solved`.
    """

    unknowns: Array
    iterations: Array
    code: Array
    carried: PyTree = ()
    found: Any = ()


@dataclass(frozen=True)
class Dense:
    """The structure of equations that all unknowns may enter: Newton's method with the full Jacobian, `solve`.

    multipliers: whether some unknowns are not in their own equations, as the multipliers of constraints.
    """

    multipliers: bool = False

    native = True
    limit = f"{MAX_ITERATIONS} Newton iterations"
    many_small = False
    words = "Newton's method with a dense Jacobian"

    def root(
        self,
        residual: Callable[[Array], Array],
        guess: Array,
        h: Scalar,
        blocks: tuple[int, ...],
        carried: PyTree = (),
    ) -> Root:
        """residual(z) = 0 from `guess`, both (m,); see `solve`. Nothing is carried over."""
        return solve(residual, guess, h, blocks)


class DenseStage:
    """The part of a stage with such equations: nothing is carried over from one step to the next."""

    structure: Structure = Dense()

    def equations(self, parameters: PyTree, state: PyTree, h: Scalar) -> Any:
        """The function z ↦ residual(z)."""
        return partial(cast(Any, self).residual, parameters, state, h)

    def solved(self, state: PyTree, found: PyTree) -> PyTree:
        """The state, unchanged."""
        return state

    def carried(self, state: PyTree) -> PyTree:
        """()."""
        return ()

    def carry(self, after: PyTree, carried: PyTree) -> PyTree:
        """The state, unchanged."""
        return after


class _Iterate(NamedTuple):
    unknowns: Array
    iterations: Array
    settled: Array
    sizes: Array
    together: Array


def parts_of(blocks: tuple[int, ...]) -> list[slice]:
    """The slice of each block of unknowns; all unknowns where there are no blocks."""
    ends = np.cumsum(blocks)
    return [slice(end - size, end) for size, end in zip(blocks, ends, strict=True) if size] or [slice(None)]


def sizes_of(vector: Array, parts: list[slice]) -> jax.Array:
    """The largest entry in size of each part of a vector."""
    return jnp.stack([jnp.max(jnp.abs(vector[part])) for part in parts])


def solve(residual: Callable[[Array], Array], guess: Array, h: Scalar, blocks: tuple[int, ...]) -> Root:
    """Solve residual(z) = 0 from `guess`: z ← z − J⁻¹ r until |δ_b|∞ ≤ TOLERANCE·|z_b|∞ + FLOOR/|h| in every block.

    `blocks` are the sizes of the blocks of unknowns; `program.TOLERANCE` states the rule for blocks at round-off.
    Derivatives of the result follow from the implicit function theorem, ∂z = −J⁻¹ ∂r: they cost one linear solve
    and do not depend on the course of the iteration.
    """
    parts = parts_of(blocks)

    def settle(function, start):
        floor = FLOOR / jnp.abs(h)

        def advance(iterate: _Iterate) -> _Iterate:
            z = iterate.unknowns
            increment = jnp.linalg.solve(jax.jacfwd(function)(z), -function(z))
            z = z + increment
            sizes, scales = sizes_of(increment, parts), sizes_of(z, parts)
            together = jnp.max(sizes) <= TOLERANCE * jnp.max(scales) + floor
            stalled = together & iterate.together & (sizes > STALLED * iterate.sizes)
            settled = jnp.all((sizes <= TOLERANCE * scales + floor) | stalled)
            # A NaN compares false and would never end the loop: it counts as settled here and is distinguished below.
            settled = settled | ~jnp.all(jnp.isfinite(sizes))
            return _Iterate(z, iterate.iterations + 1, settled, sizes, together)

        end = lax.while_loop(
            lambda i: ~i.settled & (i.iterations < MAX_ITERATIONS),
            advance,
            _Iterate(start, jnp.asarray(0), jnp.asarray(False), sizes_of(start, parts), jnp.asarray(False)),
        )
        code = jnp.where(
            ~jnp.all(jnp.isfinite(end.unknowns)),
            Code.NOT_FINITE,
            jnp.where(end.settled, Code.CONVERGED, Code.NOT_CONVERGED),
        )
        # As floats: custom_root gives integers tangents that its own rule rejects.
        return end.unknowns, (end.iterations.astype(float), code.astype(float))

    def tangent_solve(linear, right_side):
        return jnp.linalg.solve(jax.jacfwd(linear)(jnp.zeros_like(right_side)), right_side)

    unknowns, (iterations, code) = lax.custom_root(residual, guess, settle, tangent_solve, has_aux=True)
    return Root(unknowns, iterations.astype(int), code.astype(int))
