"""Newton's method for links that act on each other in pairs: coloured derivatives and block elimination."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.kernels.newton.layout import LinkOrder, layout
from coadjoint.kernels.newton.solver import Root, parts_of, sizes_of
from coadjoint.kernels.program import FLOOR, MAX_UNKNOWNS, STALLED, Code

SETTLED = 1e-13
"""Iterations with factors of another point converge linearly: they stop after an increment of this size, relative."""

LEFT_OVER = 1e-15
"""They also stop where their rate so far makes the next increment no larger than this, relative."""

RENEWED = 8
"""Iterations after which the factors are computed again."""

MOST = 60
"""The most iterations of a step."""

NEAR = 1e-9
"""Increments below this, relative, which do not shrink to STALLED of the one before with factors of the J at hand are
round-off."""

REFINED = 3
"""Corrections of the solution of a linear system, each for the residual of the previous one."""

UNDECLARED = 1e-8
"""The largest last correction of a linear system, relative, with which its solution counts."""

UNROLLED = 8
"""The number of blocks solved in one pass of the loop."""

WRITTEN = 270
"""Links times the square of a link's unknowns, up to which native code takes a chain of more than MAX_UNKNOWNS: 30
links on SO(3), which compile in some ten seconds."""

LOOPED = 100
"""The same above which native code prefers loops over links, whose code does not grow with them: 11 links on SO(3)."""

ALONE = 540
"""The same for links without pairs."""


class Factors(NamedTuple):
    """S_i⁻¹, S_i⁻¹L_i, S_i⁻¹U_i of a block tridiagonal matrix, (M, b, b) each, with S_i = D_i − L_i S_{i−1}⁻¹U_{i−1}.

    h: the length of the stage that they were computed for; 0 for none. changes: by how much the unknowns of the last
    two stages, (2, m), differ from where their iterations would have started without these. renewals: how many times
    factors have been computed since the start.
    """

    inverse: Any
    lower: Any
    upper: Any
    h: Any
    changes: PyTree
    renewals: Any


class _Iterate(NamedTuple):
    """age: iterations with these factors. near: whether the last increment was below NEAR. due: renew the factors.

    renewals: how many times they were renewed in this stage. resting: the blocks that have come to round-off, () where
    this is not remembered.
    """

    unknowns: Array
    iterations: Array
    settled: Array
    sizes: Array
    near: Array
    due: Array
    age: Array
    renewals: Array
    resting: Any = ()


@dataclass(frozen=True)
class Coupled:
    """N links whose equations have unknowns of the link itself and of those it is paired with.

    The Jacobian is found by colours · b directional derivatives, where b is the number of a link's unknowns: of a chain
    three colours, whatever N. It is block tridiagonal in the order of `layout`, a ring folded in two, and is factored
    and solved block by block. The factors serve all iterations and are carried over to the next step; they are renewed
    after 8 iterations, where increments grow or stall, and for another h. An iteration starts from where the unknowns
    of the last three steps point to, on a parabola in time.

    count: N. sizes: how many unknowns a link has in each part of z, whose parts hold the links one after the other.
    pairs: the links that act on each other.
    """

    count: int
    sizes: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]

    limit = f"{MOST} Newton iterations"
    many_small = True
    multipliers = False
    """Whether some unknowns are not in their own equations."""

    near = NEAR
    """Increments below this, relative, may be round-off."""

    rests = False
    """Whether a block whose increments have stalled counts as solved from then on, though others still move."""

    @property
    def native(self) -> bool:
        """Whether native code, which eliminates all unknowns, takes them: up to MAX_UNKNOWNS, and of a chain more.

        The code of a link grows as the square of its unknowns, that of a chain as their number.
        """
        b = sum(self.sizes)
        few = self.count * b <= MAX_UNKNOWNS
        return few or (self.layout.width == 1 and self.count * b**2 <= (WRITTEN if self.pairs else ALONE))

    @property
    def looped(self) -> bool:
        """Whether native code prefers loops over links, where it has them, to equations that it could write out."""
        return self.count * sum(self.sizes) ** 2 > LOOPED

    @property
    def layout(self) -> LinkOrder:
        """Order and colours of the links."""
        return layout(self.count, self.pairs)

    @property
    def words(self) -> str:
        """The method, for certificates and messages."""
        plan, b = self.layout, sum(self.sizes)
        links = "1 link" if plan.width == 1 else f"{plan.width} links"
        return (
            f"Newton's method for {self.count} links with {len(self.pairs)} pairs, {plan.colours * b} directional "
            f"derivatives in {plan.colours} colours, {plan.rows} block rows of {links}, {plan.width * b} unknowns "
            "each; factors carry over from step to step"
        )

    def nothing(self) -> Factors:
        """Factors with the carried shapes, of no matrix."""
        blocks = np.zeros((self.layout.rows, *2 * (self.layout.width * sum(self.sizes),)))
        return Factors(blocks, blocks, blocks, np.zeros(()), np.zeros((2, self.count * sum(self.sizes))), np.zeros(()))

    def by_links(self, z: Array) -> Array:
        """Unknowns or equations (m,) as (N, b)."""
        ends = np.cumsum([0, *(self.count * size for size in self.sizes)])
        parts = [jnp.reshape(z[a:b], (self.count, -1)) for a, b in pairwise(ends) if b > a]
        return parts[0] if len(parts) == 1 else jnp.concatenate(parts, axis=1)

    def end_to_end(self, rows: Array) -> Array:
        """(N, b) as unknowns or equations (m,)."""
        ends = np.cumsum([0, *self.sizes])
        parts = [jnp.reshape(rows[:, a:b], -1) for a, b in pairwise(ends) if b > a]
        return parts[0] if len(parts) == 1 else jnp.concatenate(parts)

    def in_blocks(self, z: Array) -> Array:
        """Unknowns or equations (m,) in the order of the blocks, (M, w·b)."""
        plan, rows = self.layout, self.by_links(z)
        source = np.full(plan.rows * plan.width, self.count)
        source[plan.position] = np.arange(self.count)
        if not np.array_equal(source, np.arange(self.count)):
            rows = jnp.concatenate([rows, jnp.zeros_like(rows[:1])])[source]
        return rows.reshape(plan.rows, -1)

    def out_of_blocks(self, rows: Array) -> Array:
        """(M, w·b) as unknowns or equations (m,)."""
        return self.end_to_end(rows.reshape(-1, sum(self.sizes))[self.layout.position])

    def seeds(self) -> Array:
        """The vectors v of which J v gives all of J, (colours · b, m): a unit vector at every link of a colour."""
        plan, b = self.layout, sum(self.sizes)
        coloured = (jnp.arange(plan.colours)[:, None] == plan.colour).astype(float)
        seeds = coloured[:, None, :, None] * jnp.eye(b)[None, :, None, :]
        return jax.vmap(self.end_to_end)(seeds.reshape(-1, self.count, b))

    def blocks(self, pushed: Callable[[Array], Array]) -> Array:
        """L, D and U of v ↦ J v, (3, M, w·b, w·b)."""
        return self.placed(jax.vmap(pushed)(self.seeds()))

    def placed(self, columns: Array) -> Array:
        """L, D and U of J, (3, M, w·b, w·b), of J v for the `seeds`, (colours · b, m)."""
        plan, b = self.layout, sum(self.sizes)
        found = jax.vmap(self.by_links)(columns).reshape(plan.colours, b, self.count, b)
        columns = jnp.transpose(found, (0, 2, 3, 1)).reshape(plan.colours * self.count, b, b)
        columns = jnp.concatenate([columns, jnp.zeros((1, b, b)), jnp.eye(b)[None]])
        placed = jnp.transpose(columns[plan.place], (0, 1, 2, 4, 3, 5))
        return placed.reshape(3, plan.rows, plan.width * b, plan.width * b)

    def factors(self, pushed: Callable[[Array], Array]) -> tuple[Array, Array, Array]:
        """The three arrays of `Factors` of v ↦ J v, by elimination from the first block to the last."""
        lower, diagonal, upper = self.blocks(pushed)
        if not self.pairs:
            return jnp.linalg.inv(diagonal), lower, upper

        def eliminate(before: Array, row: tuple[Array, ...]) -> tuple[Array, tuple[Array, ...]]:
            L, D, U = row
            inverse = jnp.linalg.inv(D - L @ before)
            behind = inverse @ U
            return behind, (inverse, inverse @ L, behind)

        _, (inverse, left, right) = lax.scan(eliminate, jnp.zeros_like(upper[0]), (lower, diagonal, upper))
        return inverse, left, right

    def solve(self, factors: tuple[Array, Array, Array], right: Array) -> Array:
        """x with J x = right, both (m,)."""
        inverse, lower, upper = factors
        known = jnp.einsum("mij,mj->mi", inverse, self.in_blocks(right))
        if not self.pairs:
            return self.out_of_blocks(known)

        def ahead(before: Array, row: tuple[Array, Array]) -> tuple[Array, Array]:
            value = row[1] - jnp.sum(row[0] * before, axis=1)
            return value, value

        walk = partial(lax.scan, ahead, jnp.zeros_like(known[0]), unroll=UNROLLED)
        return self.out_of_blocks(walk((upper, walk((lower, known))[1]), reverse=True)[1])

    def jacobian_solve(self, function: Callable[[Array], Array], z: Array, right: Array) -> Array:
        """x with (∂function/∂z) x = right at z, all (m,); NaN where links without a pair act on each other.

        The blocks hold J of paired links. For other links J x differs from them, so that x is corrected for the
        remainder of `right`; if the corrections do not shrink, the blocks are not J.
        """
        pushed = jax.linearize(function, z)[1]
        factors = self.factors(pushed)

        def transposed(right: Array) -> Array:
            return jax.linear_transpose(lambda given: self.solve(factors, given), right)(right)[0]

        return lax.custom_linear_solve(
            pushed,
            right,
            lambda matrix, right: _refined(matrix, lambda left: self.solve(factors, left), right),
            lambda matrix, right: _refined(matrix, transposed, right),
        )

    def root(
        self,
        residual: Callable[[Array], Array],
        guess: Array,
        h: Scalar,
        blocks: tuple[int, ...],
        carried: PyTree = (),
    ) -> Root:
        """residual(z) = 0 from `guess`, both (m,): z ← z − J⁻¹r with the J that the factors are of.

        It stops as `newton.solver.solve` does, with `SETTLED` in place of TOLERANCE, or by `LEFT_OVER`; increments
        that stall end it with factors of this stage's own J alone. Derivatives of the result follow from the implicit
        function theorem, with factors of the J at the solution; they are NaN where the pairs are not those of J.
        """
        before = lax.stop_gradient(carried if carried != () else jax.tree.map(jnp.asarray, self.nothing()))
        function, given = jax.closure_convert(residual, guess)

        @jax.custom_jvp  # lax.custom_root would trace the derivatives of every run, whether or not they are asked for
        def settle(given, start, h, before):
            end, factors = self._iterated(lambda z: function(z, *given), start, h, blocks, before)
            good = jnp.all(jnp.isfinite(end.unknowns))
            code = jnp.where(end.settled, int(Code.CONVERGED), int(Code.NOT_CONVERGED))
            code = jnp.where(good, code, int(Code.NOT_FINITE))
            change = end.unknowns - start
            earlier = jnp.where(before.h == h, before.changes[0], change)
            # Factors that failed are not used again.
            renewals = before.renewals + end.renewals
            kept = Factors(*factors, jnp.where(code == 0, h, 0.0), jnp.stack([change, earlier]), renewals)
            return end.unknowns, (end.iterations.astype(float), code.astype(float), kept)

        @settle.defjvp
        def _(primals, tangents):
            end, given = settle(*primals), primals[0]
            z = end[0]
            along = jax.jvp(lambda given: function(z, *given), (given,), (tangents[0],))[1]
            change = -self.jacobian_solve(lambda z: function(z, *given), z, along)
            return end, (change, jax.tree.map(jnp.zeros_like, end[1]))

        unknowns, (iterations, code, kept) = settle(given, guess, lax.stop_gradient(h), before)
        return Root(unknowns, iterations.astype(int), code.astype(int), kept if carried != () else ())

    def _iterated(self, function, start, h, blocks, before: Factors):
        """The end of the iteration, and the factors there."""
        floor, parts = FLOOR / jnp.abs(h), parts_of(blocks)

        def renewed(it: _Iterate, factors):
            return lax.cond(
                it.due, lambda z: self.factors(jax.linearize(function, z)[1]), lambda z: factors, it.unknowns
            )

        def advance(carry):
            it, factors = carry
            factors, renewals = renewed(it, factors), it.renewals + it.due
            fresh = renewals > 0
            age, was_near = jnp.where(it.due, 0, it.age), it.near & ~it.due
            increment = self.solve(factors, -function(it.unknowns))
            new = it.unknowns + increment
            sizes, scales = sizes_of(increment, parts), sizes_of(new, parts)
            finite = jnp.all(jnp.isfinite(sizes))
            near = jnp.max(sizes) <= self.near * jnp.max(scales) + floor
            rates = jnp.where(age > 0, sizes / jnp.maximum(it.sizes, floor), jnp.inf)
            small = (sizes <= SETTLED * scales + floor) | (jnp.maximum(rates, 1e-8) * sizes <= LEFT_OVER * scales)
            stalled = near & was_near & (rates > STALLED)
            rested = (it.resting | (stalled & fresh)) & near if self.rests else stalled & fresh
            # New factors that give NaN have failed.
            settled = jnp.all(small | rested) | (~finite & fresh & (age == 0))
            lost = (jnp.max(rates) > 1.0) & ~near & (age > 0)
            lost = lost | jnp.any(stalled & ~small) & ~fresh | ~finite
            kept = jnp.where(finite | settled, jnp.where(lost & ~near, it.unknowns, new), start)
            due = ~settled & (lost | (age + 1 >= RENEWED))
            return _Iterate(
                kept, it.iterations + 1, settled, sizes, near, due, age + 1, renewals, rested if self.rests else ()
            ), factors

        known, never = before.h == h, jnp.asarray(False)
        ahead = jnp.where(known, 2.0 * before.changes[0] - before.changes[1], 0.0)
        none = jnp.asarray(0)
        resting = jnp.zeros(len(parts), bool) if self.rests else ()
        first = _Iterate(start + ahead, none, never, sizes_of(start, parts), never, ~known, none, none, resting)
        return lax.while_loop(
            lambda carry: ~carry[0].settled & (carry[0].iterations < MOST), advance, (first, before[:3])
        )


def _refined(matrix: Callable[..., Array], solve: Callable[..., Array], right: Array) -> Array:
    """x with matrix(x) = right, both (m,), by a `solve` of nearly this matrix; NaN where that is another one."""

    def correct(_: int, found: tuple[Array, Array]) -> tuple[Array, Array]:
        correction = solve(right - matrix(found[0]))
        return found[0] + correction, jnp.max(jnp.abs(correction))

    x, last = lax.fori_loop(0, REFINED, correct, (jnp.zeros_like(right), jnp.zeros(())))
    return jnp.where(last <= UNDECLARED * jnp.max(jnp.abs(x)), x, jnp.nan)
