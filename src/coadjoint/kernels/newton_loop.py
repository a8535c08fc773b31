"""Newton's loop of one stage as LLVM instructions, and the judgement on what it found."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from coadjoint.kernels.emitter import WHOLE, Emitter, outer
from coadjoint.kernels.increments import Increment
from coadjoint.kernels.plan import StagePlan
from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, TOLERANCE, Code
from coadjoint.kernels.solving import increment_values


@dataclass
class Outcome:
    """What a stage leaves behind: whether each lane is well, Newton's iterations and the code of its failure."""

    sound: Any
    iterations: Any
    code: Any


class StageLoop:
    """Emits Newton for one stage and judges its outcome."""

    def __init__(self, emit: Emitter, stage: StagePlan, idle: Any) -> None:
        # Newton does not wait for idle lanes: those of members that failed before.
        self.emit, self.stage, self.b, self.idle = emit, stage, emit.builder, idle

    def run(self) -> Outcome:
        b, emit, scheme = self.b, self.emit, self.stage.scheme
        (h,) = emit.values([self.stage.h])
        self.floor = b.fdiv(emit.constant(FLOOR), emit.intrinsic("fabs", h))
        start = emit.values(self.stage.guess)
        settled, iterations = self.idle, self.emit.counts(0)
        self.size_of_settled = emit.constant(0.0)
        if scheme.first is not None:
            delta = increment_values(emit, scheme.first)
            start = [b.fadd(x, d) for x, d in zip(start, delta, strict=True)]
            for i, symbol in scheme.settled.items():
                emit.bind(symbol, start[i])
            self.size_of_settled = self._size([start[i] for i in scheme.settled])
            settled = b.or_(self.idle, self._settled(delta, [start[i] for i in scheme.looped]))
            iterations = self.emit.counts(1)
        if scheme.loop is None:
            # Everything is affine: the second increment is round-off.
            again = self.emit.counts(2)
            iterations = b.select(settled, iterations, again)
            return self._judge(start, emit.bit(True), iterations)
        found = [start[i] for i in scheme.looped]
        found, settled, iterations = self._loop(scheme.loop, found, settled, iterations)
        for i, value in zip(scheme.looped, found, strict=True):
            start[i] = value
            emit.bind(self.stage.solution[i], value)
        return self._judge(start, settled, iterations)

    def _loop(self, increment: Increment, start: list[Any], settled: Any, iterations: Any) -> tuple:
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
        trip = b.phi(WHOLE)
        with emit.scope():
            for symbol, value in zip(symbols, old, strict=True):
                emit.bind(symbol, value)
            delta = increment_values(emit, increment)
            new = [b.fadd(x, d) for x, d in zip(old, delta, strict=True)]
            now = self._settled(delta, new)
        one = emit.counts(1)
        counted = b.add(count, one)
        if emit.width > 1:
            new = [b.select(was, x, y) for x, y in zip(old, new, strict=True)]
            counted, now = b.select(was, count, counted), b.or_(was, now)
        trips = b.add(trip, WHOLE(1))
        open_lanes = emit.any(b.xor(now, emit.bit(True)))
        more = b.and_(open_lanes, b.icmp_signed("<", trips, WHOLE(MAX_ITERATIONS)))
        back = b.block
        b.cbranch(more, head, end)
        first = 0 if self.stage.scheme.first is None else 1
        incoming = [*zip(old, start, new, strict=True), (was, settled, now), (count, iterations, counted)]
        for phi, value, again in [*incoming, (trip, WHOLE(first), trips)]:
            phi.add_incoming(value, before)
            phi.add_incoming(again, back)
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

    def _size(self, values: list[Any], least: Any = None) -> Any:
        """|values|∞; a NaN may get lost here and is found when the stage is judged."""
        b, emit = self.b, self.emit
        sizes = [emit.intrinsic("fabs", v) for v in values]
        sizes = sizes if least is None else [least, *sizes]
        while len(sizes) > 1:
            pairs = zip(sizes[::2], sizes[1::2], strict=False)
            odd = sizes[-1:] if len(sizes) % 2 else []
            sizes = [b.select(b.fcmp_ordered(">", x, y), x, y) for x, y in pairs] + odd
        return sizes[0] if sizes else emit.constant(0.0)

    def _settled(self, delta: list[Any], z: list[Any]) -> Any:
        b, emit = self.b, self.emit
        scale = b.fmul(emit.constant(TOLERANCE), self._size(z, self.size_of_settled))
        return b.fcmp_ordered("<=", self._size(delta), b.fadd(scale, self.floor))

    def _judge(self, z: list[Any], settled: Any, iterations: Any) -> Outcome:
        """Whether Newton settled on finite unknowns inside the chart, and the next state is finite."""
        b, emit = self.b, self.emit
        (chart,) = emit.values([self.stage.chart])
        inside = b.fcmp_ordered("<", chart, emit.constant(1.0))
        finite = self._finite([*emit.values(self.stage.after), *z])
        sound = b.and_(b.and_(settled, inside), finite)
        counts = self.emit.counts
        code = b.select(inside, counts(Code.NOT_FINITE), counts(Code.BEYOND_CHART))
        code = b.select(settled, code, counts(Code.NOT_CONVERGED))
        code = b.select(self._finite(z), code, counts(Code.NOT_FINITE))
        return Outcome(sound, iterations, code)

    def _finite(self, values: list[Any]) -> Any:
        """Whether the sum is finite, which it is not if a term is infinite or NaN; nobody needs terms near 1e308."""
        b, emit = self.b, self.emit
        sums = list({id(v): v for v in values}.values())
        while len(sums) > 1:
            pairs = zip(sums[::2], sums[1::2], strict=False)
            sums = [b.fadd(x, y) for x, y in pairs] + (sums[-1:] if len(sums) % 2 else [])
        if not sums:
            return emit.bit(True)
        return b.fcmp_ordered("<", emit.intrinsic("fabs", sums[0]), emit.constant(math.inf))
