"""Newton's loop of one stage as LLVM instructions, and the checks of its result."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from coadjoint.kernels.emit.emitter import INT64, Emitter, outer
from coadjoint.kernels.emit.plan import StagePlan
from coadjoint.kernels.emit.solving import increment_values
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.newton.increments import Increment
from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, STALLED, TOLERANCE, Code


@dataclass
class _Progress:
    """The last increment: its size in each group, and whether the unknowns together had settled."""

    sizes: dict[int, Any]
    together: Any


@dataclass
class Outcome:
    """The outcome of a stage: the success of each lane, Newton's iterations and the code of a failure."""

    sound: Any
    iterations: Any
    code: Any


class StageLoop:
    """Emits Newton for one stage and checks its outcome."""

    def __init__(self, emit: Emitter, stage: StagePlan, idle: Any) -> None:
        # Newton does not wait for idle lanes: those of members that failed before.
        self.emit, self.stage, self.b, self.idle = emit, stage, emit.builder, idle

    def run(self) -> Outcome:
        b, emit, scheme = self.b, self.emit, self.stage.scheme
        (h,) = emit.values([self.stage.h])
        self.floor = b.fdiv(emit.constant(FLOOR), emit.intrinsic("fabs", h))
        start = emit.values(self.stage.guess)
        settled, iterations = self.idle, self.emit.counts(0)
        self.done, progress = {}, _Progress({}, emit.bit(False))
        if scheme.first is not None:
            delta = increment_values(emit, scheme.first)
            start = [b.fadd(x, d) for x, d in zip(start, delta, strict=True)]
            for i, symbol in scheme.settled.items():
                emit.bind(symbol, start[i])
            self.done = {i: start[i] for i in scheme.settled}
            found, progress = self._settled(dict(enumerate(delta)), dict(enumerate(start)), None)
            settled = b.or_(self.idle, found)
            iterations = self.emit.counts(1)
        if scheme.loop is None:
            # Everything is affine: the second increment is round-off.
            again = self.emit.counts(2)
            iterations = b.select(settled, iterations, again)
            return self._judge(start, emit.bit(True), iterations)
        found = [start[i] for i in scheme.looped]
        found, settled, iterations = self._loop(scheme.loop, found, settled, iterations, progress)
        for i, value in zip(scheme.looped, found, strict=True):
            start[i] = value
            emit.bind(self.stage.solution[i], value)
        return self._judge(start, settled, iterations)

    def _loop(
        self, increment: Increment, start: list[Any], settled: Any, iterations: Any, progress: _Progress
    ) -> tuple:
        b, emit = self.b, self.emit
        symbols = [self.stage.unknowns[i] for i in self.stage.scheme.looped]
        roots = [*increment.delta, increment.safe]
        if not increment.always_safe:
            roots += [*(x for row in increment.jacobian for x in row), *increment.right]
        emit.values(outer(roots, set(symbols)))
        before, head, end = b.block, b.append_basic_block("newton"), b.append_basic_block("solved")
        if self.stage.scheme.first is None:
            b.branch(head)
        else:
            b.cbranch(emit.any(b.xor(settled, emit.bit(True))), head, end)
        b.position_at_end(head)
        old = [b.phi(emit.number) for _ in start]
        was, count = b.phi(emit.truth), b.phi(emit.counter)
        trip = b.phi(INT64)
        looped = self.stage.scheme.looped
        sizes = {g: b.phi(emit.number) for g in self._blocks_of(looped)} if len(self.stage.blocks) > 1 else {}
        last = _Progress(sizes, b.phi(emit.truth)) if sizes else None
        with emit.scope():
            for symbol, value in zip(symbols, old, strict=True):
                emit.bind(symbol, value)
            delta = increment_values(emit, increment)
            new = [b.fadd(x, d) for x, d in zip(old, delta, strict=True)]
            now, next_ = self._settled(dict(zip(looped, delta, strict=True)), dict(zip(looped, new, strict=True)), last)
        one = emit.counts(1)
        counted = b.add(count, one)
        if emit.width > 1:
            new = [b.select(was, x, y) for x, y in zip(old, new, strict=True)]
            counted, now = b.select(was, count, counted), b.or_(was, now)
        trips = b.add(trip, INT64(1))
        open_lanes = emit.any(b.xor(now, emit.bit(True)))
        more = b.and_(open_lanes, b.icmp_signed("<", trips, INT64(MAX_ITERATIONS)))
        back = b.block
        b.cbranch(more, head, end)
        first = 0 if self.stage.scheme.first is None else 1
        incoming = [*zip(old, start, new, strict=True), (was, settled, now), (count, iterations, counted)]
        for phi, value, again in [*incoming, (trip, INT64(first), trips)]:
            phi.add_incoming(value, before)
            phi.add_incoming(again, back)
        if last is not None:
            for g, phi in last.sizes.items():
                phi.add_incoming(progress.sizes.get(g, emit.constant(0.0)), before)
                phi.add_incoming(next_.sizes[g], back)
            last.together.add_incoming(progress.together, before)
            last.together.add_incoming(next_.together, back)
        b.position_at_end(end)
        if self.stage.scheme.first is None:
            return new, now, counted
        joined = []
        for _, value, again in incoming:
            phi = b.phi(value.type)
            phi.add_incoming(value, before)
            phi.add_incoming(again, back)
            joined.append(phi)
        return joined[:-2], joined[-2], joined[-1]

    def _size(self, values: list[Any]) -> Any:
        """|values|∞; a NaN may get lost here and is found when the stage is checked."""
        return self._largest([self.emit.intrinsic("fabs", v) for v in values])

    def _largest(self, sizes: list[Any]) -> Any:
        b = self.b
        while len(sizes) > 1:
            pairs = zip(sizes[::2], sizes[1::2], strict=False)
            odd = sizes[-1:] if len(sizes) % 2 else []
            sizes = [b.select(b.fcmp_ordered(">", x, y), x, y) for x, y in pairs] + odd
        return sizes[0]

    def _blocks_of(self, unknowns: Iterable[int]) -> list[int]:
        """The blocks that hold any of these unknowns."""
        return [g for g, members in enumerate(self.stage.blocks) if any(i in members for i in unknowns)]

    def _settled(self, delta: dict[int, Any], z: dict[int, Any], last: _Progress | None) -> tuple[Any, _Progress]:
        """Whether the increments δ of these unknowns settle them (`program.TOLERANCE`); those done before stay."""
        b, emit, z = self.b, self.emit, {**self.done, **z}

        def small(size: Any, scale: Any) -> Any:
            return b.fcmp_ordered("<=", size, b.fadd(b.fmul(emit.constant(TOLERANCE), scale), self.floor))

        scales = [self._size([z[i] for i in members]) for members in self.stage.blocks]
        sizes = {g: self._size([delta[i] for i in self.stage.blocks[g] if i in delta]) for g in self._blocks_of(delta)}
        together = small(self._largest(list(sizes.values())), self._largest(scales))
        settled = emit.bit(True)
        for g, size in sizes.items():
            fine = small(size, scales[g])
            if last is not None:
                stalled = b.fcmp_ordered(">", size, b.fmul(emit.constant(STALLED), last.sizes[g]))
                fine = b.or_(fine, b.and_(b.and_(together, last.together), stalled))
            settled = b.and_(settled, fine)
        return settled, _Progress(sizes, together)

    def _judge(self, z: list[Any], settled: Any, iterations: Any) -> Outcome:
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

    def _tolerated(self, symbol: Expr, z: list[Any], settled: Any, iterations: Any) -> Outcome:
        """A stage that may fail reports whether it did, and the step continues."""
        b, emit = self.b, self.emit
        (chart,) = emit.values([self.stage.chart])
        inside = b.fcmp_ordered("<", chart, emit.constant(1.0))
        found = b.and_(b.and_(settled, inside), finite(emit, z))
        emit.bind(symbol, b.select(found, emit.constant(1.0), emit.constant(0.0)))
        sound = finite(emit, emit.values(self.stage.after))
        return Outcome(sound, iterations, emit.counts(Code.NOT_FINITE))


def finite(emit: Emitter, values: Iterable[Any]) -> Any:
    """Whether the sum is finite, not so if a term is infinite or NaN, or where terms near 1e308 overflow."""
    b = emit.builder
    sums = list({id(v): v for v in values}.values())
    while len(sums) > 1:
        pairs = zip(sums[::2], sums[1::2], strict=False)
        sums = [b.fadd(x, y) for x, y in pairs] + (sums[-1:] if len(sums) % 2 else [])
    if not sums:
        return emit.bit(True)
    return b.fcmp_ordered("<", emit.intrinsic("fabs", sums[0]), emit.constant(math.inf))
