"""The structure of fixed-point equations: z ← z − r(z), without a Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.kernels.newton.solver import Root
from coadjoint.kernels.program import Code

MOST, MOST_OF_TANGENTS = 100, 1000
"""The most iterations, of equations, where a contraction by 0.7 comes to round-off with these, and of derivatives."""

ROUND_OFF = 1e-11
"""A residual below this, relative to the unknowns, that no longer shrinks is round-off."""

SHRINKS = 0.95
"""The largest factor by which two iterations in turn reduce the residual if they converge."""

LEAST = 0.1
"""The smallest factor by which r is assumed to shrink once more, where it shrank faster."""

AGEING = 1.25
"""The factor by which a carried rate grows in a step with one iteration, which measures none."""

FEW = 2048
"""The largest count of numbers whose maximum is found in one pass without vector instructions."""

OF_TANGENTS = 1e-14
"""The tolerance of derivatives, whatever that of the equations."""


def sizes(x: Array, y: Array) -> tuple[Array, Array]:
    """|x|∞ and |y|∞ of numbers (m,) both: of few in one pass, which XLA does not split, unlike that of one alone."""
    if x.size > FEW:
        return jnp.max(jnp.abs(x)), jnp.max(jnp.abs(y))

    def larger(first, second):
        return jnp.maximum(first[0], second[0]), jnp.maximum(first[1], second[1])

    return lax.reduce((jnp.abs(x), jnp.abs(y)), (jnp.zeros((), x.dtype), jnp.zeros((), y.dtype)), larger, (0,))


def largest(x: Array, rows: tuple[int, int]) -> Array:
    """|x|∞ of every copy of every field, (fields, copies), of numbers (m,)."""
    return jnp.max(jnp.abs(jnp.reshape(x, (*rows, -1))), axis=2)


def scales(z: Array, rows: tuple[int, int]) -> Array:
    """The scales of errors of unknowns z, (m,), by (fields, copies): a copy of a field is compared with itself.

    The first field, which the others drive, is compared with all fields of its copy; 0 is compared with 1.
    """
    found = jnp.asarray(largest(z, rows))
    found = found.at[0].set(jnp.max(found, axis=0)) if rows[0] > 1 else found
    return jnp.where(found > 0, found, 1.0)


class _Iterate(NamedTuple):
    unknowns: Array
    iterations: Array
    settled: Array
    size: Array
    shrinks: Array
    stalled: Array
    found: Any


@dataclass(frozen=True)
class FixedPoint:
    """Equations r(z) = z − G(z) with a contraction G: z ← z − r(z) until the next |r|∞ would be ≤ tolerance·|z|∞.

    Convergence is linear: where r shrank by ρ, the next r is ρr, which is not computed for its size alone, and the
    error left is 1/(1 − ρ) times the tolerance. Of the first iteration ρ is that of the step before, in proportion to
    h: ρ/|h|, 1/s, is carried over, and grows by a quarter in each step that measures none. Iterations of which two
    in turn leave 0.95 of r or more, once that is below 1e-11 of z, have met round-off and end as well. Derivatives
    follow from the implicit function theorem: linear equations with ∂r/∂z = 1 − ∂G, and with its transpose, are solved
    by the same iteration to 1e-14, whatever the tolerance; where that does not converge they are NaN.

    rows: how many fields, and copies of each, the unknowns are, which are compared each with its own size (`scales`).
    finds: whether residual(z) is a pair of r and a PyTree of further results at z: the PyTree of the last evaluation,
    at z + r of the solution z, is `Root.found`, without derivatives. It replaces the results at the solution and is off
    by as much as r shrinks once, so that the next |r|∞ must then be half of the tolerance.
    """

    tolerance: float = 1e-14
    rows: tuple[int, int] = (1, 1)
    finds: bool = False
    native = False
    limit = f"{MOST} iterations of a fixed point"

    @property
    def many_small(self) -> bool:
        """Of one field, whose results the options of XLA leave as they are to the last bit; of more they do not."""
        return self.rows[0] == 1

    @property
    def words(self) -> str:
        """The method, for certificates and messages."""
        return f"fixed-point iteration to {self.tolerance:g} of the unknowns, no Jacobian"

    def root(
        self,
        residual: Callable[[Array], PyTree],
        guess: Array,
        h: Scalar,
        blocks: tuple[int, ...],
        carried: PyTree = (),
    ) -> Root:
        """residual(z) = 0 from `guess`, both (m,); blocks have no part in it. carried: ρ/|h|, one number, or ()."""
        evaluated = residual if self.finds else lambda z: (residual(z), ())
        length = lax.stop_gradient(jnp.abs(h))
        expected = (
            jnp.asarray(1.0) if isinstance(carried, tuple) else jnp.minimum(lax.stop_gradient(carried) * length, 1.0)
        )

        def settle(_, start):  # its argument is the residual alone
            end = self._iterated(evaluated, start, expected=expected)
            how = jnp.where(end.settled, Code.CONVERGED, Code.NOT_CONVERGED)
            code = jnp.where(jnp.all(jnp.isfinite(end.unknowns)), how, Code.NOT_FINITE)
            return end.unknowns, (end.iterations.astype(float), code.astype(float), end.shrinks, end.found)

        def linear_solve(linear, right):
            return FixedPoint(OF_TANGENTS).solution(lambda z: linear(z) - right, right, MOST_OF_TANGENTS)

        def tangent_solve(linear, right):
            return lax.custom_linear_solve(linear, right, linear_solve, transpose_solve=linear_solve)

        unknowns, (iterations, code, shrinks, found) = lax.custom_root(
            lambda z: evaluated(z)[0], guess, settle, tangent_solve, has_aux=True
        )
        # A rate that a single iteration did not measure grows, so that it is measured again some steps later.
        shrinks = jnp.where(iterations > 1, shrinks, jnp.minimum(AGEING * shrinks, 1.0))
        kept = () if isinstance(carried, tuple) else lax.stop_gradient(shrinks / length)
        return Root(unknowns, iterations.astype(int), code.astype(int), kept, lax.stop_gradient(found))

    def solution(self, residual: Callable[[Array], Array], start: Array, most: int = MOST) -> Array:
        """z with residual(z) = 0 from `start`, both (m,), without derivatives; NaN where the iteration diverges."""
        end = self._iterated(lambda z: (residual(z), ()), start, most)
        return jnp.where(end.settled, end.unknowns, jnp.nan)

    def _size(self, off: Array, z: Array) -> Array:
        """The largest |r|∞/|z|∞ of a copy of a field, one number."""
        if self.rows == (1, 1):
            off_by, scale = sizes(off, z)
            return off_by / jnp.where(scale > 0, scale, 1.0)
        return jnp.max(largest(off, self.rows) / scales(z, self.rows))

    def _iterated(
        self,
        evaluated: Callable[[Array], tuple[Array, PyTree]],
        start: Array,
        most: int = MOST,
        expected: Array | float = 1.0,
    ) -> _Iterate:
        """evaluated: z ↦ r and further results. expected: the assumed reduction of r by the first iteration."""

        def advance(iterate: _Iterate) -> _Iterate:
            off, found = evaluated(iterate.unknowns)
            z = iterate.unknowns - off
            size = self._size(off, z)
            stalled = (size > SHRINKS * iterate.size) & (size <= ROUND_OFF)
            shrank = jnp.where(size < iterate.size, size / iterate.size, 1.0)
            shrinks = jnp.where(iterate.iterations > 0, shrank, iterate.shrinks)
            # A NaN compares false and would never end the loop.
            small = size * jnp.maximum(shrinks, LEAST) <= (0.5 if self.finds else 1.0) * self.tolerance
            settled = small | (stalled & iterate.stalled) | ~jnp.isfinite(size)
            return _Iterate(z, iterate.iterations + 1, settled, size, shrinks, stalled, found)

        no, shapes = jnp.asarray(False), jax.eval_shape(lambda z: evaluated(z)[1], start)
        nothing = jax.tree.map(lambda shape: jnp.zeros(shape.shape, shape.dtype), shapes)
        return lax.while_loop(
            lambda i: ~i.settled & (i.iterations < most),
            advance,
            _Iterate(start, jnp.asarray(0), no, jnp.asarray(jnp.inf), jnp.asarray(expected), no, nothing),
        )
