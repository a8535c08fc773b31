"""Newton's iterations of a chain as loops over its links.

Of a chain without joints (`link_blocks`) an iteration is a loop for the residual and the blocks of its Jacobian, one
for their factors from the first link to the last, and two for the increment, to the last link and back. The factors
then serve chords, as in `newton_loop`. Of a chain of joints it is a loop for K⁻¹r, K⁻¹G and the contributions of links
to S, one for the rows of S, block elimination to the last link and back, and a loop for the increments
(`link_elimination`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from coadjoint.kernels.emit.emitter import BIT, DOUBLE, INT64, Emitter, Value
from coadjoint.kernels.emit.link_arrays import LinkArrays, at
from coadjoint.kernels.emit.link_blocks import ChordSweep
from coadjoint.kernels.emit.link_elimination import BlockSweep
from coadjoint.kernels.emit.link_plan import LinkCode, LinkPlan
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.program import CONTRACTION, FLOOR, MAX_ITERATIONS, REMAINDER, STALLED, TOLERANCE


def unknowns(plan: LinkPlan, code: LinkCode) -> list[Expr]:
    """The symbols of z of a link."""
    slots = {a.slot: node for node, a in plan.address.items() if a.array == "z" and a.link == code.link}
    return [slots[k] for k in range(len(slots))]


class _Measured(NamedTuple):
    """The sizes of an increment, and of the unknowns after it, by kinds."""

    sizes: dict[int, Value]
    scales: dict[int, Value]


class _Iteration(ABC):
    """What both have in common: the variables of a stage, and the sizes of an increment."""

    def __init__(self, plan: LinkPlan, arrays: LinkArrays) -> None:
        self.plan, self.arrays, self.b, self.one = plan, arrays, arrays.b, arrays.one
        self.kinds = sorted(set(plan.blocks))
        self.sizes, self.scales = ({g: arrays.variables() for g in self.kinds} for _ in range(2))
        self.last = {g: self.one.variable(DOUBLE) for g in self.kinds}
        self.count = self.one.variable(INT64)
        self.together, self.settled = (self.one.variable(BIT) for _ in range(2))

    def emit(self, h: Value) -> tuple[Value, Value]:
        """From the guess in "z" to the solution there: whether it settled, and the iterations. h: of the substep."""
        b = self.b
        for place in (self.together, self.settled):
            b.store(BIT(0), place)
        for place in self.last.values():
            b.store(DOUBLE(0.0), place)
        b.store(INT64(0), self.count)
        self.floor = b.fdiv(DOUBLE(FLOOR), self.one.intrinsic("fabs", h))
        self._iterated()
        return b.load(self.settled), b.load(self.count)

    @abstractmethod
    def _iterated(self) -> None:
        """The iteration."""

    def _counted(self) -> Value:
        """Count an iteration; whether it was the last one that is allowed."""
        done = self.b.add(self.b.load(self.count), INT64(1))
        self.b.store(done, self.count)
        return self.b.icmp_signed(">=", done, INT64(MAX_ITERATIONS))

    def _small(self, size: Value, scale: Value) -> Value:
        """Whether an increment of this size settles unknowns of this scale (`program.TOLERANCE`)."""
        b = self.b
        return b.fcmp_ordered("<=", size, b.fadd(b.fmul(DOUBLE(TOLERANCE), scale), self.floor))

    def _settles(self, found: _Measured, now: Value) -> None:
        """Store whether an increment settles the unknowns; `now`: whether some together meet their tolerance."""
        b = self.b
        near, fine = b.and_(b.load(self.together), now), BIT(1)
        for g, size in found.sizes.items():
            stalled = b.fcmp_ordered(">", size, b.fmul(DOUBLE(STALLED), b.load(self.last[g])))
            fine = b.and_(fine, b.or_(self._small(size, found.scales[g]), b.and_(near, stalled)))
            b.store(size, self.last[g])
        b.store(now, self.together)
        b.store(fine, self.settled)

    def _most(self, values: list[Value]) -> Value:
        first, *others = values
        for value in others:
            first = self.b.select(self.b.fcmp_ordered(">", value, first), value, first)
        return first

    def _moved(self, increment: dict[int, list[Expr]]) -> _Measured:
        """Store the unknowns after an increment, of links by their numbers, in "y", and measure both."""
        arrays = self.arrays
        for places in (*self.sizes.values(), *self.scales.values()):
            arrays.set(places, 0.0)

        def moved(emit: Emitter, values: list[Value], link: Value, code: LinkCode) -> None:
            half = len(values) // 2
            for slot, (z, delta, kind) in enumerate(zip(values[:half], values[half:], self.plan.blocks, strict=True)):
                new = self.b.fadd(z, delta)
                arrays.store(emit, new, "y", slot, link)
                arrays.widen(emit, self.sizes[kind], [delta])
                arrays.widen(emit, self.scales[kind], [new])

        arrays.links(lambda code: [*unknowns(self.plan, code), *increment[code.link]], moved)
        found = ({g: arrays.largest(x) for g, x in part.items()} for part in (self.sizes, self.scales))
        return _Measured(*found)


class JointsNewton(_Iteration):
    """The iteration of a chain of joints, which stops by `program.TOLERANCE`.

    The equations are linear in the multipliers, whose matrix S has a condition of N²: they have settled where they
    stall while the unknowns of the bodies have met their tolerance twice in turn.
    """

    def _iterated(self) -> None:
        b = self.b
        again, end = b.append_basic_block("newton"), b.append_basic_block("solved")
        b.branch(again)
        b.position_at_end(again)
        with self.arrays.scopes():
            found = self._increment()
        now, bodies = BIT(1), sorted(set(self.plan.blocks[: self.plan.base]))
        for g in bodies:
            now = b.and_(now, self._small(found.sizes[g], self._most([found.scales[k] for k in bodies])))
        self._settles(found, now)
        over = self._counted()
        b.cbranch(b.or_(b.load(self.settled), over), end, again)
        b.position_at_end(end)

    def _increment(self) -> _Measured:
        """One increment of all unknowns."""
        arrays = self.arrays
        arrays.fill_both({"x": "solved", "q": "joints"})
        arrays.fill("t", "rows")
        self.swept()
        found = self._moved({code.link: code.increment for code in self.plan.codes})
        arrays.copied("y", "z")
        return found

    def swept(self) -> None:
        """Block elimination of the rows in "t", from the first link to the last and back, into "d"."""
        arrays, sweep = self.arrays, self.plan.sweep
        assert isinstance(sweep, BlockSweep)
        arrays.carried(at("t", sweep.rows), sweep.before, at("w", sweep.forward), arrays.forward)
        arrays.carried(at("w", sweep.here), sweep.ahead, at("d", sweep.backward), arrays.backward)


class ChordNewton(_Iteration):
    """The iteration of a chain without joints: Newton's increment, then chords by the same factors.

    They settle the unknowns by `program.TOLERANCE` and `program.REMAINDER`. Where chords shrink slowly the next
    increment is Newton's; one that has not shrunk is dropped, and the stage continues by Newton alone.
    """

    def _iterated(self) -> None:
        b, arrays = self.b, self.arrays
        chords = self.one.variable(BIT)
        b.store(BIT(1), chords)
        newton, chord, end = map(b.append_basic_block, ("newton", "chord", "solved"))
        b.branch(newton)
        b.position_at_end(newton)
        with arrays.scopes():
            arrays.fill_both({"t": "rows", "d": "residual"})
            self._factored()
            found = self._solved()
        self._settles(found, self._small(self._most(list(found.sizes.values())), self._scale(found)))
        arrays.copied("y", "z")
        over = b.or_(self._counted(), b.load(self.settled))
        on = b.append_basic_block("on")
        b.cbranch(over, end, on)
        b.position_at_end(on)
        b.cbranch(b.load(chords), chord, newton)
        b.position_at_end(chord)
        with arrays.scopes():
            arrays.fill("d", "residual")
            found = self._solved()
        self._taken(found, chords, (newton, chord, end))
        b.position_at_end(end)

    def _taken(self, found: _Measured, chords: Value, blocks: tuple[Value, Value, Value]) -> None:
        """Take the chord's increment where it has shrunk, and go on."""
        b, (newton, chord, end) = self.b, blocks
        settled = shrunk = quick = BIT(1)
        for g, size in found.sizes.items():
            last = b.load(self.last[g])
            left = b.fadd(b.fmul(DOUBLE(REMAINDER), found.scales[g]), b.fmul(DOUBLE(1e-3), self.floor))
            fine = b.fcmp_ordered("<=", b.fmul(size, size), b.fmul(last, left))
            below = [b.fcmp_ordered("<=", size, b.fmul(DOUBLE(part), last)) for part in (STALLED, CONTRACTION)]
            settled = b.and_(settled, fine)
            shrunk, quick = (b.and_(x, b.or_(fine, y)) for x, y in zip((shrunk, quick), below, strict=True))
        take, drop, on = map(b.append_basic_block, ("take", "drop", "on"))
        b.cbranch(shrunk, take, drop)
        b.position_at_end(drop)
        b.store(BIT(0), chords)
        b.branch(newton)
        b.position_at_end(take)
        together = self._small(self._most(list(found.sizes.values())), self._scale(found))
        b.store(together, self.together)
        for g, size in found.sizes.items():
            b.store(size, self.last[g])
        b.store(settled, self.settled)
        self.arrays.copied("y", "z")
        b.cbranch(b.or_(self._counted(), settled), end, on)
        b.position_at_end(on)
        b.cbranch(quick, chord, newton)

    def _scale(self, found: _Measured) -> Value:
        return self._most(list(found.scales.values()))

    @property
    def _sweep(self) -> ChordSweep:
        assert isinstance(self.plan.sweep, ChordSweep)
        return self.plan.sweep

    def _factored(self) -> None:
        """Replace the blocks in "t" by their factors."""
        arrays, sweep = self.arrays, self._sweep
        first = len(sweep.factors) - len(sweep.before)
        arrays.carried(at("t", sweep.blocks), sweep.before, at("t", sweep.factors), arrays.forward, first)

    def _solved(self) -> _Measured:
        """The increment by these factors of the residual in "d", there, and the unknowns after it in "y"."""
        arrays, sweep, m = self.arrays, self._sweep, self.plan.joint
        right, square = sweep.known[-m:], m * m
        known = [*at("t", sweep.known[:-m]), *at("d", right)]
        arrays.carried(known, sweep.behind, at("d", sweep.ahead), arrays.forward)
        here = [(node, "t", 2 * square + k) for k, node in enumerate(sweep.here[:square])]
        arrays.carried([*here, *at("d", sweep.here[square:])], sweep.beyond, at("d", sweep.back), arrays.backward)
        by_slots = {(a.link, a.slot): node for node, a in self.plan.address.items() if a.array == "d"}
        return self._moved({code.link: [by_slots[code.link, k] for k in range(m)] for code in self.plan.codes})
