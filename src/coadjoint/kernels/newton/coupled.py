"""Newton's method for links that act on each other in pairs: coloured derivatives and block elimination."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint.kernels.newton.layout import LinkOrder, layout
from coadjoint.kernels.newton.solver import Root, parts_of, sizes_of
from coadjoint.kernels.program import FLOOR, MAX_UNKNOWNS, STALLED, TOLERANCE, Code

SETTLED = 1e-13
"""Iterations with factors of another point converge linearly: they stop after an increment of this size, relative."""

RENEWED = 8
"""Iterations after which the factors are computed anew."""

MOST = 60
"""The most iterations of a step."""


class Factors(NamedTuple):
    """S_i⁻¹, S_i⁻¹L_i, S_i⁻¹U_i of a block tridiagonal matrix, (M, b, b) each, with S_i = D_i − L_i S_{i−1}⁻¹U_{i−1}.

    h: the length of the stage that they were computed for; 0 of none.
    """

    inverse: Any
    lower: Any
    upper: Any
    h: Any


class _ChordIterate(NamedTuple):
    unknowns: jax.Array
    iterations: jax.Array
    settled: jax.Array
    sizes: jax.Array
    together: jax.Array
    factors: Factors
    age: jax.Array


@dataclass(frozen=True)
class Coupled:
    """N links whose equations have unknowns of the link itself and of those it is paired with.

    The Jacobian is found by colours · b directional derivatives, where b is the number of a link's unknowns: of a chain
    three colours, whatever N. It is block tridiagonal in the order of `layout`, a ring folded in two, and is factored
    and solved block by block. The factors serve all iterations and are carried over to the next step; they are renewed
    after 8 iterations, where increments grow, and for another h.

    count: N. sizes: how many unknowns a link has in each part of z, whose parts hold the links one after the other.
    pairs: the links that act on each other.
    """

    count: int
    sizes: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]

    @property
    def native(self) -> bool:
        """Whether there are so few unknowns that native code eliminates them all."""
        return self.count * sum(self.sizes) <= MAX_UNKNOWNS

    @property
    def layout(self) -> LinkOrder:
        """Order and colours of the links."""
        return layout(self.count, self.pairs)

    @property
    def words(self) -> str:
        """What was chosen, for cards and messages."""
        plan, b = self.layout, sum(self.sizes)
        links = "1 link" if plan.width == 1 else f"{plan.width} links"
        return (
            f"{self.count} links with {len(self.pairs)} pairs: {plan.colours * b} directional derivatives in "
            f"{plan.colours} colours, {plan.rows} block rows of {links}, {plan.width * b} unknowns each"
        )

    def nothing(self) -> Factors:
        """Factors of the shapes that are carried, of no matrix."""
        blocks = np.zeros((self.layout.rows, *2 * (self.layout.width * sum(self.sizes),)))
        return Factors(blocks, blocks, blocks, np.zeros(()))

    def by_links(self, z: jax.Array) -> jax.Array:
        """Unknowns or equations (m,) as (N, b)."""
        ends = np.cumsum([0, *(self.count * size for size in self.sizes)])
        parts = [jnp.reshape(z[a:b], (self.count, -1)) for a, b in pairwise(ends) if b > a]
        return parts[0] if len(parts) == 1 else jnp.concatenate(parts, axis=1)

    def end_to_end(self, rows: jax.Array) -> jax.Array:
        """(N, b) as unknowns or equations (m,)."""
        ends = np.cumsum([0, *self.sizes])
        parts = [jnp.reshape(rows[:, a:b], -1) for a, b in pairwise(ends) if b > a]
        return parts[0] if len(parts) == 1 else jnp.concatenate(parts)

    def in_blocks(self, z: jax.Array) -> jax.Array:
        """Unknowns or equations (m,) in the order of the blocks, (M, w·b)."""
        plan, rows = self.layout, self.by_links(z)
        source = np.full(plan.rows * plan.width, self.count)
        source[plan.position] = np.arange(self.count)
        if not np.array_equal(source, np.arange(self.count)):
            rows = jnp.concatenate([rows, jnp.zeros_like(rows[:1])])[source]
        return rows.reshape(plan.rows, -1)

    def out_of_blocks(self, rows: jax.Array) -> jax.Array:
        """(M, w·b) as unknowns or equations (m,)."""
        return self.end_to_end(rows.reshape(-1, sum(self.sizes))[self.layout.position])

    def blocks(self, pushed: Callable[[jax.Array], jax.Array]) -> jax.Array:
        """L, D and U of v ↦ J v, (3, M, w·b, w·b)."""
        plan, b = self.layout, sum(self.sizes)
        coloured = (jnp.arange(plan.colours)[:, None] == plan.colour).astype(float)
        seeds = coloured[:, None, :, None] * jnp.eye(b)[None, :, None, :]
        flat = jax.vmap(self.end_to_end)(seeds.reshape(-1, self.count, b))
        found = jax.vmap(self.by_links)(jax.vmap(pushed)(flat)).reshape(plan.colours, b, self.count, b)
        columns = jnp.transpose(found, (0, 2, 3, 1)).reshape(plan.colours * self.count, b, b)
        columns = jnp.concatenate([columns, jnp.zeros((1, b, b)), jnp.eye(b)[None]])
        placed = jnp.transpose(columns[plan.place], (0, 1, 2, 4, 3, 5))
        return placed.reshape(3, plan.rows, plan.width * b, plan.width * b)

    def factors(self, pushed: Callable[[jax.Array], jax.Array], h: jax.Array) -> Factors:
        """The factors of v ↦ J v, by elimination from the first block to the last."""
        lower, diagonal, upper = self.blocks(pushed)

        def eliminate(before: jax.Array, row: tuple[jax.Array, ...]) -> tuple[jax.Array, tuple[jax.Array, ...]]:
            L, D, U = row
            inverse = jnp.linalg.inv(D - L @ before)
            behind = inverse @ U
            return behind, (inverse, inverse @ L, behind)

        _, (inverse, left, right) = lax.scan(eliminate, jnp.zeros_like(upper[0]), (lower, diagonal, upper))
        return Factors(inverse, left, right, jnp.asarray(h))

    def solve(self, factors: Factors, right: jax.Array) -> jax.Array:
        """x with J x = right, both (m,)."""
        known = jnp.einsum("mij,mj->mi", factors.inverse, self.in_blocks(right))

        def ahead(before: jax.Array, row: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
            value = row[1] - jnp.sum(row[0] * before, axis=1)
            return value, value

        start = jnp.zeros_like(known[0])
        _, forward = lax.scan(ahead, start, (factors.lower, known), unroll=UNROLLED)
        _, solved = lax.scan(ahead, start, (factors.upper, forward), reverse=True, unroll=UNROLLED)
        return self.out_of_blocks(solved)

    def jacobian_solve(self, function: Callable[[jax.Array], jax.Array], z: jax.Array, right: jax.Array) -> jax.Array:
        """x with (∂function/∂z) x = right at z, all (m,)."""
        pushed = jax.linearize(function, z)[1]
        return self.solve(self.factors(pushed, jnp.ones(())), right)

    def root(
        self,
        residual: Callable[[jax.Array], jax.Array],
        guess: jax.Array,
        h: jax.Array,
        blocks: tuple[int, ...],
        carried: Any = (),
    ) -> Root:
        """residual(z) = 0 from `guess`, both (m,): z ← z − J⁻¹r with the J that the factors are of.

        It stops as `newton.solver.solve` does, with `SETTLED` in place of TOLERANCE. Derivatives of the result follow
        from the implicit function theorem, with factors of the J at the solution.
        """
        before = lax.stop_gradient(carried if carried != () else jax.tree.map(jnp.asarray, self.nothing()))

        def settle(function, start):
            end = self._iterated(function, start, h, blocks, before)
            good = jnp.all(jnp.isfinite(end.unknowns))
            code = jnp.where(end.settled, int(Code.CONVERGED), int(Code.NOT_CONVERGED))
            code = jnp.where(good, code, int(Code.NOT_FINITE))
            # Factors that led nowhere are not used again.
            kept = end.factors._replace(h=jnp.where(code == 0, end.factors.h, 0.0))
            return end.unknowns, (end.iterations.astype(float), code.astype(float), kept)

        def tangent_solve(linear, right):
            return self.jacobian_solve(linear, jnp.zeros_like(right), right)

        unknowns, (iterations, code, kept) = lax.custom_root(residual, guess, settle, tangent_solve, has_aux=True)
        return Root(unknowns, iterations.astype(int), code.astype(int), kept if carried != () else ())

    def _iterated(self, function, start, h, blocks, before: Factors) -> _ChordIterate:
        floor, parts = FLOOR / jnp.abs(h), parts_of(blocks)

        def renewed(z: jax.Array) -> Factors:
            return self.factors(jax.linearize(function, z)[1], h)

        def advance(it: _ChordIterate) -> _ChordIterate:
            z = it.unknowns
            due = (it.age >= RENEWED) | (it.factors.h != h)
            factors = lax.cond(due, renewed, lambda z: it.factors, z)
            increment = self.solve(factors, -function(z))
            new = z + increment
            sizes, scales = sizes_of(increment, parts), sizes_of(new, parts)
            limit = SETTLED * scales + floor
            together = jnp.max(sizes) <= TOLERANCE * jnp.max(scales) + floor
            stalled = together & it.together & (sizes > STALLED * it.sizes)
            finite = jnp.all(jnp.isfinite(sizes))
            fresh = due | (it.age == 0)
            # Old factors that lead away are renewed where the iteration started; new ones fail.
            lost = ~finite | (jnp.max(sizes / jnp.maximum(it.sizes, floor)) > 1.0) & ~together & (it.iterations > 0)
            again = lost & ~fresh
            settled = (jnp.all((sizes <= limit) | stalled) & ~again) | (~finite & fresh)
            age = jnp.where(again, RENEWED, jnp.where(due, 0, it.age) + 1)
            return _ChordIterate(
                jnp.where(again, jnp.where(finite, z, start), new),
                it.iterations + 1,
                settled,
                sizes,
                together,
                factors,
                age,
            )

        nothing = jnp.asarray(0)
        first = _ChordIterate(
            start, nothing, jnp.asarray(False), sizes_of(start, parts), jnp.asarray(False), before, nothing
        )
        return lax.while_loop(lambda i: ~i.settled & (i.iterations < MOST), advance, first)


UNROLLED = 8
"""How many blocks are solved in one turn of the loop."""
