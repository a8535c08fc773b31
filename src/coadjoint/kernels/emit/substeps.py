"""The loop over the substeps of a composed step, as LLVM instructions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from llvmlite import ir

from coadjoint.kernels.emit.emitter import DOUBLE, INT64, Emitter, Value
from coadjoint.kernels.emit.plan import Inner, StepPlan


@dataclass
class Done:
    """A completed step: its status, the state after it, and its observations.

    `record`, `course` and `monitors` emit their values where they are needed.
    """

    well: Value
    code: Value
    iterations: Value
    after: list[Value]
    record: Callable[[], list[Value]]
    course: Callable[[], list[Value]]
    monitors: Callable[[], list[Value]]
    certificates: list[ir.Value]


def substeps(
    emit: Emitter, plan: StepPlan, inner: Inner, kept: list[Value], stages: Callable[[Value], Done], idle: Value
) -> Done:
    """The stages over every substep; record and monitors are those of the first one, put into the variables `kept`."""
    b = emit.builder
    table, course = constant_table(emit.module, inner.fractions), _Course(emit, plan)
    start = emit.values(inner.start)
    before, head, end = b.block, b.append_basic_block("substep"), b.append_basic_block("substeps")
    b.branch(head)
    b.position_at_end(head)
    number, state = b.phi(INT64), [b.phi(emit.number) for _ in start]
    well, code, iterations = b.phi(emit.truth), b.phi(emit.counter), b.phi(emit.counter)
    certificates = [b.phi(emit.number) for _ in plan.certificates]
    with emit.scope():
        emit.bind(inner.h, b.fmul(emit.values([plan.h])[0], _broadcast(emit, b.load(b.gep(table, [INT64(0), number])))))
        for symbol, value in zip(inner.state, state, strict=True):
            emit.bind(symbol, value)
        done = stages(idle if emit.width == 1 else b.or_(idle, b.xor(well, emit.bit(True))))
        with b.if_then(b.icmp_signed("==", number, INT64(0))), emit.scope():
            for value, place in zip([*done.record(), *done.monitors()], kept, strict=True):
                b.store(value, place)
        course.store(number, done.course())
        largest = [emit.intrinsic("maximum", x, y) for x, y in zip(certificates, done.certificates, strict=True)]
    code_now, well_now = b.select(well, done.code, code), b.and_(well, done.well)
    sum_now, following = b.add(iterations, done.iterations), b.add(number, INT64(1))
    more = b.and_(b.icmp_signed("<", following, INT64(len(inner.fractions))), emit.any(well_now))
    back = b.block
    b.cbranch(more, head, end)
    nothing = [emit.constant(-math.inf)] * len(certificates)
    carried = [(number, INT64(0), following), (well, emit.bit(True), well_now), (code, emit.counts(0), code_now)]
    carried += [(iterations, emit.counts(0), sum_now), *zip(state, start, done.after, strict=True)]
    for phi, value, again in [*carried, *zip(certificates, nothing, largest, strict=True)]:
        phi.add_incoming(value, before)
        phi.add_incoming(again, back)
    b.position_at_end(end)
    for symbol, value in zip(inner.after, done.after, strict=True):
        emit.bind(symbol, value)
    seen = [b.load(place) for place in kept]
    size = len(plan.record)
    record, monitors = (lambda: seen[:size]), (lambda: seen[size:])
    return Done(well_now, code_now, sum_now, done.after, record, course.load, monitors, largest)


class _Course:
    """The kept numbers of all substeps in an array."""

    def __init__(self, emit: Emitter, plan: StepPlan):
        self._emit, self._count = emit, plan.course
        if self._count:
            with emit.builder.goto_entry_block():
                self._array = emit.builder.alloca(emit.number, self._count)

    def _place(self, index: Value) -> Value:
        return self._emit.builder.gep(self._array, [index])

    def store(self, number: Value, values: list[Value]) -> None:
        """Store those of a substep."""
        b = self._emit.builder
        for i, value in enumerate(values):
            b.store(value, self._place(b.add(b.mul(number, INT64(len(values))), INT64(i))))

    def load(self) -> list[Value]:
        """Those of all substeps."""
        return [self._emit.builder.load(self._place(INT64(i))) for i in range(self._count)]


def constant_table(module: ir.Module, values: tuple[float, ...]) -> ir.Value:
    """Numbers in the module."""
    kind = ir.ArrayType(DOUBLE, len(values))
    table = ir.GlobalVariable(module, kind, name="substeps")
    table.global_constant, table.linkage = True, "internal"
    table.initializer = ir.Constant(kind, [ir.Constant(DOUBLE, value) for value in values])  # pyright: ignore
    return table


def _broadcast(emit: Emitter, value: ir.Value) -> ir.Value:
    """A number in every lane."""
    if emit.width == 1:
        return value
    b, lanes = emit.builder, ir.Constant(emit.number, ir.Undefined)
    for lane in range(emit.width):
        lanes = b.insert_element(lanes, value, ir.Constant(ir.IntType(32), lane))
    return lanes
