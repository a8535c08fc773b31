"""Newton's loop of one stage as LLVM instructions, and the checks of its result."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from coadjoint.kernels.emit.emitter import Emitter, Value, outer
from coadjoint.kernels.emit.plan import StagePlan
from coadjoint.kernels.emit.solving import increment_values
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.newton.increments import Increment
from coadjoint.kernels.program import CONTRACTION, FLOOR, MAX_ITERATIONS, REMAINDER, STALLED, TOLERANCE, Code


@dataclass
class Outcome:
    """The outcome of a stage: the success of each lane, Newton's iterations and the code of a failure."""

    sound: Value
    iterations: Value
    code: Value


class _Iterates:
    """The variables of Newton's loop, in each lane its own: no lane depends on its neighbours.

    `at` is the point z of the matrix, `found` the newest iterate y; `sizes` are those of the last increment in each
    block. A lane is `over` when it has settled or has no iterations left. Where it is to `renew` its matrix Newton's
    increment comes next, elsewhere the chord's, which it takes no longer once `chords` is false.
    """

    def __init__(self, emit: Emitter, start: list[Value], blocks: Iterable[int], idle: Value) -> None:
        self.emit = emit
        self.found = [emit.variable(emit.number, value) for value in start]
        self.at = self.found if emit.width == 1 else [emit.variable(emit.number, value) for value in start]
        self.sizes = {g: emit.variable(emit.number, emit.constant(0.0)) for g in blocks}
        self.settled, self.over = (emit.variable(emit.truth, idle) for _ in range(2))
        self.renew, self.chords = (emit.variable(emit.truth, emit.bit(True)) for _ in range(2))
        self.count = emit.variable(emit.counter, emit.counts(0))

    def active(self, renewing: bool) -> Value:
        """The lanes that take Newton's increment, or the chord's."""
        b = self.emit.builder
        renew = b.load(self.renew)
        return b.and_(self.open(), renew if renewing else b.not_(renew))

    def open(self) -> Value:
        """The lanes that are not over."""
        return self.emit.builder.not_(self.emit.builder.load(self.over))

    @contextmanager
    def where(self, mask: Value) -> Iterator[Value]:
        """The lanes of what is done inside: one lane branches, several are selected from."""
        if self.emit.width > 1:
            yield mask
        else:
            with self.emit.builder.if_then(mask):
                yield None

    @contextmanager
    def seldom(self, mask: Value) -> Iterator[Value]:
        """`where`, but a branch that is taken if any lane needs it, laid out apart."""
        with self.emit.builder.if_then(self.emit.any(mask), likely=False):
            yield mask if self.emit.width > 1 else None


class StageLoop:
    """Emits Newton for one stage and checks its outcome."""

    def __init__(self, emit: Emitter, stage: StagePlan, idle: Value) -> None:
        # Newton does not wait for idle lanes: those of members that failed before.
        self.emit, self.stage, self.b, self.idle = emit, stage, emit.builder, idle

    def run(self) -> Outcome:
        b, emit, scheme = self.b, self.emit, self.stage.scheme
        (h,) = emit.values([self.stage.h])
        self.floor = b.fdiv(emit.constant(FLOOR), emit.intrinsic("fabs", h))
        self.z = dict(enumerate(emit.values(self.stage.guess)))
        if scheme.first is not None:
            delta = increment_values(emit, scheme.first)
            for (i, symbol), d in zip(scheme.settled.items(), delta, strict=True):
                self.z[i] = d if self.stage.guess[i].is_constant(0.0) else b.fadd(self.z[i], d)
                emit.bind(symbol, self.z[i])
        settled, iterations = emit.bit(True), emit.counts(1)
        if scheme.loop is not None and scheme.chord is not None:
            settled, iterations = self._loop(scheme.loop, scheme.chord)
            for i in scheme.looped:
                emit.bind(self.stage.solution[i], self.z[i])
        return self._judge(list(self.z.values()), settled, iterations)

    def _loop(self, newton: Increment, chord: Increment) -> tuple[Value, Value]:
        """The loop over the unknowns that are not settled: whether they have settled, and the iterations."""
        b, emit, scheme = self.b, self.emit, self.stage.scheme
        symbols = [self.stage.unknowns[i] for i in scheme.looped]
        kept = _roots(chord)
        emit.values(outer([*_roots(newton), *kept], {*symbols, *scheme.iterate}))
        groups = [g for g, members in enumerate(self.stage.blocks) if any(i in members for i in scheme.looped)]
        lanes = _Iterates(emit, [self.z[i] for i in scheme.looped], groups, self.idle)
        names = ("newton", "newton.again", "chord", "chord.again", "solved")
        renewed, again, chords, on, end = map(b.append_basic_block, names)
        b.branch(renewed)
        b.position_at_end(renewed)
        with emit.scope():
            active = None if emit.width == 1 else lanes.active(True)
            keep(emit, zip(lanes.at, map(b.load, lanes.found), strict=True), active)
            for symbol, at in zip(symbols, lanes.at, strict=True):
                emit.bind(symbol, b.load(at))
            emit.values(outer(kept, set(scheme.iterate)))
            dropped = b.not_(b.load(lanes.chords))
            self._newton(lanes, increment_values(emit, newton, dropped), active)
            b.cbranch(emit.any(lanes.active(False)), chords, again)
            b.position_at_end(again)
            b.cbranch(emit.any(lanes.open()), renewed, end)
            b.position_at_end(chords)
            with emit.scope():
                for symbol, found in zip(scheme.iterate, lanes.found, strict=True):
                    emit.bind(symbol, b.load(found))
                self._chord(lanes, increment_values(emit, chord), end)
                b.cbranch(emit.any(lanes.active(True)), renewed, on)
                b.position_at_end(on)
                b.cbranch(emit.any(lanes.open()), chords, end)
        b.position_at_end(end)
        self.z.update(zip(scheme.looped, [b.load(place) for place in lanes.found], strict=True))
        return b.load(lanes.settled), b.load(lanes.count)

    def _newton(self, lanes: _Iterates, delta: list[Value], active: Value) -> None:
        """Take Newton's increment in the active lanes; it settles the unknowns by `program.TOLERANCE`."""
        b, emit = self.b, self.emit
        new = [b.fadd(b.load(at), d) for at, d in zip(lanes.at, delta, strict=True)]
        sizes, scales = self._sizes(delta), self._scales(new)
        settled = emit.variable(emit.truth, self._every(self._small(size, scales[g]) for g, size in sizes.items()))
        again = b.icmp_signed(">", b.load(lanes.count), emit.counts(0))
        with lanes.seldom(b.and_(again, b.not_(b.load(settled)))):
            b.store(self._at_round_off(lanes, sizes, scales), settled)
        self._take(lanes, new, sizes, b.load(settled), b.not_(b.load(lanes.chords)), active)

    def _at_round_off(self, lanes: _Iterates, sizes: dict[int, Value], scales: dict[int, Value]) -> Value:
        """Whether each block is settled, or stalled where the unknowns together have met their tolerance twice."""
        b, emit = self.b, self.emit
        before = {g: b.load(place) for g, place in lanes.sizes.items()}
        near = self._together(before, self._scales([b.load(at) for at in lanes.at]))
        near = b.and_(near, self._together(sizes, scales))
        stalled = {g: b.fcmp_ordered(">", x, b.fmul(emit.constant(STALLED), before[g])) for g, x in sizes.items()}
        return self._every(b.or_(self._small(x, scales[g]), b.and_(near, stalled[g])) for g, x in sizes.items())

    def _chord(self, lanes: _Iterates, delta: list[Value], end: Value) -> None:
        """Take the chord's increment where it has shrunk, and renew the matrix where it did so slowly.

        Elsewhere drop it, and continue with Newton's alone. It settles the unknowns by `program.REMAINDER`; where all
        lanes settle, the loop ends without asking what each does next.
        """
        b, emit = self.b, self.emit
        new = [b.fadd(b.load(found), d) for found, d in zip(lanes.found, delta, strict=True)]
        sizes, scales = self._sizes(delta), self._scales(new)
        last = {g: b.load(lanes.sizes[g]) for g in sizes}
        fine = {g: self._negligible(size, last[g], scales[g]) for g, size in sizes.items()}
        settled = self._every(fine.values())
        active = emit.bit(True) if emit.width == 1 else lanes.active(False)
        if emit.width > 1:
            self._end(lanes, new, b.and_(active, settled), end)
        shrunk, quick = (emit.variable(emit.truth, settled) for _ in range(2))
        with lanes.seldom(b.and_(active, b.not_(settled))):
            for place, part in ((shrunk, STALLED), (quick, CONTRACTION)):
                below = {g: b.fcmp_ordered("<=", x, b.fmul(emit.constant(part), last[g])) for g, x in sizes.items()}
                b.store(self._every(b.or_(fine[g], x) for g, x in below.items()), place)
        taken = b.load(shrunk)
        with lanes.where(b.and_(active, taken)) as there:
            self._take(lanes, new, sizes, settled, b.not_(b.load(quick)), there)
        with lanes.seldom(b.and_(active, b.not_(taken))) as there:
            keep(emit, [(lanes.renew, emit.bit(True)), (lanes.chords, emit.bit(False))], there)

    def _end(self, lanes: _Iterates, new: list[Value], settled: Value, end: Value) -> None:
        """Go to the end of the loop with a new iterate if all lanes settle."""
        b, emit = self.b, self.emit
        others, last = map(b.append_basic_block, ("others", "last"))
        b.cbranch(emit.any(b.not_(settled)), others, last).set_weights([1, 1 << 6])
        b.position_at_end(last)
        count = b.add(b.load(lanes.count), emit.counts(1))
        keep(emit, zip([*lanes.found, lanes.settled, lanes.count], [*new, settled, count], strict=True), None)
        b.branch(end)
        b.position_at_end(others)

    def _take(
        self, lanes: _Iterates, new: list[Value], sizes: dict[int, Value], settled: Value, renew: Value, there: Value
    ) -> None:
        """The new iterate of some lanes, or of all (None); one that has no iterations left is over."""
        b, emit = self.b, self.emit
        count = b.add(b.load(lanes.count), emit.counts(1))
        over = b.or_(settled, b.icmp_signed(">=", count, emit.counts(MAX_ITERATIONS)))
        places = [*lanes.found, *lanes.sizes.values(), lanes.settled, lanes.over, lanes.renew, lanes.count]
        keep(emit, zip(places, [*new, *sizes.values(), settled, over, renew, count], strict=True), there)

    def _small(self, size: Value, scale: Value) -> Value:
        """Whether an increment of this size settles unknowns of this scale (`program.TOLERANCE`)."""
        b, emit = self.b, self.emit
        return b.fcmp_ordered("<=", size, b.fadd(b.fmul(emit.constant(TOLERANCE), scale), self.floor))

    def _negligible(self, size: Value, last: Value, scale: Value) -> Value:
        """Whether the chord that would follow one of this size after a last one is none (`program.REMAINDER`)."""
        b, emit = self.b, self.emit
        left = b.fadd(b.fmul(emit.constant(REMAINDER), scale), b.fmul(emit.constant(1e-3), self.floor))
        return b.fcmp_ordered("<=", b.fmul(size, size), b.fmul(last, left))

    def _together(self, sizes: dict[int, Value], scales: dict[int, Value]) -> Value:
        """Whether an increment is small for the unknowns together."""
        return self._small(self._largest(list(sizes.values())), self._largest(list(scales.values())))

    def _sizes(self, delta: list[Value]) -> dict[int, Value]:
        """The size of an increment of the looped unknowns in each block that has some."""
        of = dict(zip(self.stage.scheme.looped, delta, strict=True))
        parts = {g: [of[i] for i in members if i in of] for g, members in enumerate(self.stage.blocks)}
        return {g: self._size(values) for g, values in parts.items() if values}

    def _scales(self, looped: list[Value]) -> dict[int, Value]:
        """The size of all unknowns in each block."""
        z = {**self.z, **dict(zip(self.stage.scheme.looped, looped, strict=True))}
        return {g: self._size([z[i] for i in members]) for g, members in enumerate(self.stage.blocks)}

    def _every(self, truths: Iterable[Value]) -> Value:
        found = self.emit.bit(True)
        for truth in truths:
            found = self.b.and_(found, truth)
        return found

    def _size(self, values: list[Value]) -> Value:
        """|values|∞; a NaN may get lost here and is found when the stage is checked."""
        return self._largest([self.emit.intrinsic("fabs", v) for v in values])

    def _largest(self, sizes: list[Value]) -> Value:
        b = self.b
        while len(sizes) > 1:
            pairs = zip(sizes[::2], sizes[1::2], strict=False)
            odd = sizes[-1:] if len(sizes) % 2 else []
            sizes = [b.select(b.fcmp_ordered(">", x, y), x, y) for x, y in pairs] + odd
        return sizes[0]

    def _judge(self, z: list[Value], settled: Value, iterations: Value) -> Outcome:
        """Whether Newton settled on finite unknowns inside the chart, and the next state is finite."""
        b, emit = self.b, self.emit
        if self.stage.sound is not None:
            return self._tolerated(self.stage.sound, z, settled, iterations)
        (chart,) = emit.values([self.stage.chart])
        inside = b.fcmp_ordered("<", chart, emit.constant(1.0))
        sound = b.and_(b.and_(settled, inside), finite(emit, [*emit.values(self.stage.after), *z]))
        counts = self.emit.counts
        code = b.select(inside, counts(Code.NOT_FINITE), counts(Code.BEYOND_CHART))
        code = b.select(settled, code, counts(Code.NOT_CONVERGED))
        code = b.select(finite(emit, z), code, counts(Code.NOT_FINITE))
        return Outcome(sound, iterations, code)

    def _tolerated(self, symbol: Expr, z: list[Value], settled: Value, iterations: Value) -> Outcome:
        """A stage that may fail reports whether it did, and the step continues."""
        b, emit = self.b, self.emit
        (chart,) = emit.values([self.stage.chart])
        inside = b.fcmp_ordered("<", chart, emit.constant(1.0))
        found = b.and_(b.and_(settled, inside), finite(emit, z))
        emit.bind(symbol, b.select(found, emit.constant(1.0), emit.constant(0.0)))
        sound = finite(emit, emit.values(self.stage.after))
        return Outcome(sound, iterations, emit.counts(Code.NOT_FINITE))


def _roots(increment: Increment) -> list[Expr]:
    """The expressions that `increment_values` may emit."""
    roots = [*increment.delta, increment.safe]
    if not increment.always_safe:
        roots += [*(x for row in increment.jacobian for x in row), *increment.right]
    return roots


def keep(emit: Emitter, given: Iterable[tuple[Value, Value]], lanes: Value) -> None:
    """Store values, (place, value) each, in some lanes, or in all (None).

    A branch decides whether all lanes take them, so that what reads them need not wait for the mask.
    """
    b, given = emit.builder, list(given)
    if lanes is None:
        for place, value in given:
            b.store(value, place)
        return
    with b.if_else(emit.any(b.not_(lanes)), likely=False) as (some, all_of_them):
        with some:
            for place, value in given:
                b.store(b.select(lanes, value, b.load(place)), place)
        with all_of_them:
            keep(emit, given, None)


def finite(emit: Emitter, values: Iterable[Value]) -> Value:
    """Whether the sum is finite, not so if a term is infinite or NaN, or where terms near 1e308 overflow."""
    b = emit.builder
    sums = list({id(v): v for v in values}.values())
    while len(sums) > 1:
        pairs = zip(sums[::2], sums[1::2], strict=False)
        sums = [b.fadd(x, y) for x, y in pairs] + (sums[-1:] if len(sums) % 2 else [])
    if not sums:
        return emit.bit(True)
    return b.fcmp_ordered("<", emit.intrinsic("fabs", sums[0]), emit.constant(math.inf))
