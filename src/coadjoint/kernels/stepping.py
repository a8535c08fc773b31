"""The LLVM function that runs a plan: the loop over steps, Newton's loop in each stage, records and extrema.

    void step(parameters, h, state, records, save_every, record_out, monitor_out, extrema, status)

Arrays of numbers have a last axis for the lanes. `state` is read and written; `status` is (steps, code, iterations,
iterations_max) by lanes. A lane that has failed, and in Newton's loop a lane that has settled, waits unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from llvmlite import ir

from coadjoint.kernels.emitter import DOUBLE, WHOLE, Emitter, outer
from coadjoint.kernels.expression import Node
from coadjoint.kernels.gauss import gauss
from coadjoint.kernels.increments import Increment
from coadjoint.kernels.plan import Plan, StagePlan
from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, TOLERANCE, Code

NAME = "step"
POINTER = DOUBLE.as_pointer()


@dataclass
class _Outcome:
    """What a stage leaves behind: whether each lane is well, Newton's iterations and the code of its failure."""

    sound: Any
    iterations: Any
    code: Any


def assemble(plan: Plan, width: int = 1) -> str:
    """The module as LLVM assembly."""
    return str(_Stepper(plan, width).module)


class _Stepper:
    def __init__(self, plan: Plan, width: int) -> None:
        self.plan, self.width = plan, width
        self.module = ir.Module(name="coadjoint")
        whole = WHOLE.as_pointer()
        signature = ir.FunctionType(
            ir.VoidType(), [POINTER, POINTER, POINTER, WHOLE, WHOLE, POINTER, POINTER, POINTER, whole]
        )
        function = ir.Function(self.module, signature, name=NAME)
        for argument in function.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        self.arguments = function.args
        self.builder = b = ir.IRBuilder(function.append_basic_block("entry"))
        self.emit = Emitter(self.module, b, width)
        self.counter = WHOLE if width == 1 else ir.VectorType(WHOLE, width)
        self._function()

    # Memory: arrays of lanes.

    def load(self, pointer: Any, index: Any, kind: Any = None) -> Any:
        """Element `index` of an array of numbers (or of `kind`) with lanes."""
        return self.builder.load(self._place(pointer, index, kind), align=8)

    def store(self, value: Any, pointer: Any, index: Any) -> None:
        self.builder.store(value, self._place(pointer, index, value.type), align=8)

    def _place(self, pointer: Any, index: Any, kind: Any) -> Any:
        kind = kind if kind is not None else self.emit.number
        index = WHOLE(index) if isinstance(index, int) else index
        typed = self.builder.bitcast(pointer, kind.as_pointer())
        return self.builder.gep(typed, [index])

    def variable(self, kind: Any, value: Any = None) -> Any:
        """A local variable; LLVM keeps it in a register."""
        with self.builder.goto_entry_block():
            place = self.builder.alloca(kind)
        if value is not None:
            self.builder.store(value, place)
        return place

    def counts(self, value: int) -> Any:
        if self.width == 1:
            return WHOLE(value)
        return ir.Constant(self.counter, [WHOLE(value)] * self.width)

    def any(self, mask: Any) -> Any:
        """Whether the mask holds in any lane."""
        if self.width == 1:
            return mask
        bits = self.builder.bitcast(mask, ir.IntType(self.width))
        return self.builder.icmp_unsigned("!=", bits, ir.IntType(self.width)(0))

    # The loop over steps.

    def _function(self) -> None:
        b, plan = self.builder, self.plan
        p, h, s, records, every, self.record_out, self.monitor_out, self.extrema, status = self.arguments
        for i, node in enumerate(plan.parameters):
            self.emit.bind(node, self.load(p, i))
        self.emit.bind(plan.h, self.load(h, 0))
        self.state = [self.variable(self.emit.number, self.load(s, i)) for i in range(len(plan.state))]
        zero = self.counts(0)
        self.steps, self.total = self.variable(self.counter, zero), self.variable(self.counter, zero)
        self.most = self.variable(self.counter, zero)
        self.code = self.variable(self.counter, zero)
        self.alive = self.variable(self.emit.truth, self.emit.bit(True))
        self.done, self.row = self.variable(WHOLE, WHOLE(0)), self.variable(WHOLE, WHOLE(0))
        self.due = self.variable(WHOLE, WHOLE(0))
        number = b.mul(records, every)
        self.every = every
        self.emit.values(outer(self._roots(), self._varying()))
        loop, end = b.append_basic_block("loop"), b.append_basic_block("end")
        b.cbranch(b.icmp_signed(">", number, WHOLE(0)), loop, end)
        b.position_at_end(loop)
        with self.emit.scope():
            self._step()
        done = b.add(b.load(self.done), WHOLE(1))
        b.store(done, self.done)
        b.cbranch(b.and_(b.icmp_signed("<", done, number), self.any(b.load(self.alive))), loop, end)
        b.position_at_end(end)
        for i, place in enumerate(self.state):
            self.store(b.load(place), s, i)
        for i, place in enumerate((self.steps, self.code, self.total, self.most)):
            self.store(b.load(place), status, i)
        b.ret_void()

    def _roots(self) -> list[Node]:
        plan = self.plan
        roots = [*plan.record, *plan.monitors, *plan.certificates.values()]
        for stage in plan.stages:
            roots += [*stage.guess, *stage.solution, stage.chart, *stage.after]
            for increment in stage.increments():
                roots += [*increment.delta, increment.safe]
        return roots

    def _varying(self) -> set[Node]:
        symbols = set(self.plan.state)
        for stage in self.plan.stages:
            symbols.update(stage.unknowns, stage.solution)
        return symbols

    def _step(self) -> None:
        b, plan = self.builder, self.plan
        for node, place in zip(plan.state, self.state, strict=True):
            self.emit.bind(node, b.load(place))
        iterations = self.counts(0)
        well: Any = None
        code = self.counts(0)
        for stage in plan.stages:
            outcome = _Stage(self, stage).run()
            iterations = b.add(iterations, outcome.iterations)
            code = outcome.code if well is None else b.select(well, outcome.code, code)
            well = outcome.sound if well is None else b.and_(well, outcome.sound)
        after = self.emit.values(plan.stages[-1].after)
        well = b.and_(b.load(self.alive), well)
        if self.width > 1:
            self._finish(after, well, code, iterations)
            return
        # One trajectory: a failed step leaves everything as it is and ends the loop.
        fine, failed, on = (b.append_basic_block(name) for name in ("fine", "failed", "on"))
        b.cbranch(well, fine, failed).set_weights([1 << 20, 1])
        b.position_at_end(failed)
        b.store(code, self.code)
        b.store(self.emit.bit(False), self.alive)
        b.branch(on)
        b.position_at_end(fine)
        self._finish(after, None, code, iterations)
        b.branch(on)
        b.position_at_end(on)

    def _finish(self, after: list[Any], well: Any, code: Any, iterations: Any) -> None:
        """Record, observe and take the new state, in the lanes that are well."""
        b = self.builder
        alive = b.load(self.alive)
        self._observe(well)

        def keep(value: Any, place: Any) -> None:
            b.store(value if well is None else b.select(well, value, b.load(place)), place)

        for value, place in zip(after, self.state, strict=True):
            keep(value, place)
        keep(b.add(b.load(self.steps), self.counts(1)), self.steps)
        keep(b.add(b.load(self.total), iterations), self.total)
        most = b.load(self.most)
        keep(b.select(b.icmp_signed(">", most, iterations), most, iterations), self.most)
        if well is not None:
            newly = b.and_(alive, b.xor(well, self.emit.bit(True)))
            b.store(b.select(newly, code, b.load(self.code)), self.code)
            b.store(well, self.alive)

    # Records and monitors.

    def _observe(self, well: Any) -> None:
        b, plan = self.builder, self.plan
        observed = self.emit.values(plan.monitors)
        for i, value in enumerate([*observed, *self.emit.values(plan.certificates.values())]):
            self._extremum(value, i, well)
        due = b.load(self.due)
        before, now, on = b.block, b.append_basic_block("record"), b.append_basic_block("recorded")
        b.cbranch(b.icmp_signed("==", due, WHOLE(0)), now, on)
        b.position_at_end(now)
        row = b.load(self.row)
        with self.emit.scope():
            for values, out in ((self.emit.values(plan.record), self.record_out), (observed, self.monitor_out)):
                start = b.mul(row, WHOLE(len(values)))
                for i, value in enumerate(values):
                    self.store(value, out, b.add(start, WHOLE(i)))
        b.store(b.add(row, WHOLE(1)), self.row)
        b.branch(on)
        b.position_at_end(on)
        left = b.phi(WHOLE)
        left.add_incoming(due, before)
        left.add_incoming(self.every, now)
        b.store(b.sub(left, WHOLE(1)), self.due)

    def _extremum(self, value: Any, i: int, well: Any) -> None:
        """extrema[2i] and [2i + 1]: the least and the greatest value so far."""
        b = self.builder
        for place, order in ((2 * i, "<"), (2 * i + 1, ">")):
            old = self.load(self.extrema, place)
            better = b.fcmp_ordered(order, value, old)
            better = better if well is None else b.and_(better, well)
            self.store(b.select(better, value, old), self.extrema, place)


class _Stage:
    """Emits Newton for one stage and judges its outcome."""

    def __init__(self, stepper: _Stepper, stage: StagePlan) -> None:
        self.stepper, self.stage = stepper, stage
        self.b, self.emit = stepper.builder, stepper.emit

    def run(self) -> _Outcome:
        b, emit, scheme = self.b, self.emit, self.stage.scheme
        (h,) = emit.values([self.stage.h])
        self.floor = b.fdiv(emit.constant(FLOOR), emit.intrinsic("fabs", h))
        start = emit.values(self.stage.guess)
        settled, iterations = emit.bit(False), self.stepper.counts(0)
        self.size_of_settled = emit.constant(0.0)
        if scheme.first is not None:
            delta = self._increment(scheme.first)
            start = [b.fadd(x, d) for x, d in zip(start, delta, strict=True)]
            for i, symbol in scheme.settled.items():
                emit.bind(symbol, start[i])
            self.size_of_settled = self._size([start[i] for i in scheme.settled])
            settled, iterations = self._settled(delta, [start[i] for i in scheme.looped]), self.stepper.counts(1)
        if scheme.loop is None:
            # Everything is affine: the second increment is round-off.
            again = self.stepper.counts(2)
            iterations = b.select(settled, iterations, again)
            return self._judge(start, emit.bit(True), iterations)
        found = [start[i] for i in scheme.looped]
        found, settled, iterations = self._loop(scheme.loop, found, settled, iterations)
        for i, value in zip(scheme.looped, found, strict=True):
            start[i] = value
            emit.bind(self.stage.solution[i], value)
        return self._judge(start, settled, iterations)

    def _loop(self, increment: Increment, start: list[Any], settled: Any, iterations: Any) -> tuple:
        b, emit, stepper = self.b, self.emit, self.stepper
        symbols = [self.stage.unknowns[i] for i in self.stage.scheme.looped]
        roots = [*increment.delta, increment.safe]
        if increment.safe.op != "const":
            roots += [*(x for row in increment.jacobian for x in row), *increment.right]
        emit.values(outer(roots, set(symbols)))
        before, head, end = b.block, b.append_basic_block("newton"), b.append_basic_block("solved")
        if self.stage.scheme.first is None:
            b.branch(head)
        else:
            b.cbranch(stepper.any(b.xor(settled, emit.bit(True))), head, end)
        b.position_at_end(head)
        old = [b.phi(emit.number) for _ in start]
        was, count = b.phi(emit.truth), b.phi(stepper.counter)
        trip = b.phi(WHOLE)
        with emit.scope():
            for symbol, value in zip(symbols, old, strict=True):
                emit.bind(symbol, value)
            delta = self._increment(increment)
            new = [b.fadd(x, d) for x, d in zip(old, delta, strict=True)]
            now = self._settled(delta, new)
        one = stepper.counts(1)
        counted = b.add(count, one)
        if stepper.width > 1:
            new = [b.select(was, x, y) for x, y in zip(old, new, strict=True)]
            counted, now = b.select(was, count, counted), b.or_(was, now)
        trips = b.add(trip, WHOLE(1))
        open_lanes = stepper.any(b.xor(now, emit.bit(True)))
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

    def _increment(self, increment: Increment) -> list[Any]:
        """δ, by the closed form where it is safe and with pivots otherwise."""
        b, emit = self.b, self.emit
        delta = emit.values(increment.delta)
        if increment.safe.op == "const":
            return delta
        (safe,) = emit.values([increment.safe])
        before, careful, on = b.block, b.append_basic_block("pivot"), b.append_basic_block("increment")
        unsafe = self.stepper.any(b.xor(safe, emit.bit(True)))
        b.cbranch(unsafe, careful, on).set_weights([1, 1 << 20])
        b.position_at_end(careful)
        with emit.scope():
            matrix = emit.values(x for row in increment.jacobian for x in row)
            pivoted = self._pivoted(matrix, emit.values(increment.right), safe, delta)
        careful = b.block
        b.branch(on)
        b.position_at_end(on)
        joined = []
        for quick, slow in zip(delta, pivoted, strict=True):
            phi = b.phi(emit.number)
            phi.add_incoming(quick, before)
            phi.add_incoming(slow, careful)
            joined.append(phi)
        return joined

    def _pivoted(self, matrix: list[Any], right: list[Any], safe: Any, delta: list[Any]) -> list[Any]:
        """The unsafe lanes by elimination with partial pivoting, one after the other."""
        b, n, width = self.b, len(right), self.stepper.width
        function = gauss(self.stepper.module)
        with b.goto_entry_block():
            a = b.alloca(DOUBLE, n * n)
            x = b.alloca(DOUBLE, n)
        results = list(delta)
        for lane in range(width):
            pick = (lambda v: v) if width == 1 else (lambda v, k=lane: b.extract_element(v, ir.IntType(32)(k)))
            for place, values in ((a, matrix), (x, right)):
                for i, value in enumerate(values):
                    b.store(pick(value), b.gep(place, [WHOLE(i)]))
            b.call(function, [a, x, WHOLE(n)])
            solved = [b.load(b.gep(x, [WHOLE(i)])) for i in range(n)]
            if width == 1:
                return solved
            here = pick(safe)
            place = ir.IntType(32)(lane)
            results = [
                b.insert_element(r, b.select(here, pick(r), v), place)
                for r, v in zip(results, solved, strict=True)
            ]
        return results

    def _size(self, values: list[Any], least: Any = None) -> Any:
        """|values|∞; a NaN may get lost here and is found when the stage is judged."""
        b, emit = self.b, self.emit
        sizes = [emit.intrinsic("fabs", v) for v in values]
        sizes = sizes if least is None else [least, *sizes]
        while len(sizes) > 1:
            pairs = [sizes[i : i + 2] for i in range(0, len(sizes), 2)]
            sizes = [b.select(b.fcmp_ordered(">", *p), *p) if len(p) == 2 else p[0] for p in pairs]
        return sizes[0] if sizes else emit.constant(0.0)

    def _settled(self, delta: list[Any], z: list[Any]) -> Any:
        b, emit = self.b, self.emit
        scale = b.fmul(emit.constant(TOLERANCE), self._size(z, self.size_of_settled), flags=("contract",))
        return b.fcmp_ordered("<=", self._size(delta), b.fadd(scale, self.floor, flags=("contract",)))

    def _judge(self, z: list[Any], settled: Any, iterations: Any) -> _Outcome:
        """Whether Newton settled on finite unknowns inside the chart, and the next state is finite."""
        b, emit = self.b, self.emit
        (chart,) = emit.values([self.stage.chart])
        inside = b.fcmp_ordered("<", chart, emit.constant(1.0))
        finite_after = self._finite(emit.values(self.stage.after))
        sound = b.and_(b.and_(settled, inside), finite_after)
        counts = self.stepper.counts
        code = b.select(inside, counts(Code.NOT_FINITE), counts(Code.BEYOND_CHART))
        code = b.select(settled, code, counts(Code.NOT_CONVERGED))
        code = b.select(self._finite(z), code, counts(Code.NOT_FINITE))
        return _Outcome(sound, iterations, code)

    def _finite(self, values: list[Any]) -> Any:
        """x − x is zero for a finite x and NaN otherwise."""
        b, emit = self.b, self.emit
        sums = [b.fsub(v, v) for v in values if not isinstance(v, ir.Constant)]
        while len(sums) > 1:
            pairs = [sums[i : i + 2] for i in range(0, len(sums), 2)]
            sums = [b.fadd(*p) if len(p) == 2 else p[0] for p in pairs]
        return b.fcmp_ordered("==", sums[0], emit.constant(0.0)) if sums else emit.bit(True)
