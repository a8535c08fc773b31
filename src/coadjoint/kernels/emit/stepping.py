"""The LLVM function that runs a plan: the loop over steps, Newton's loop in each stage, records and extrema.

    void step(parameters, h, state, records, save_every, record_out, monitor_out, extrema, status)

Arrays of numbers have a last axis for the lanes. `state` is read and written; `status` is (steps, code, iterations,
iterations_max) by lanes. A lane that has failed, and in Newton's loop a lane that has settled, waits unchanged.
"""

from __future__ import annotations

from llvmlite import ir

from coadjoint.kernels.emit import FEW_PASSES
from coadjoint.kernels.emit.emitter import DOUBLE, INT64, Emitter, Value, outer
from coadjoint.kernels.emit.newton_loop import StageLoop, finite, keep
from coadjoint.kernels.emit.plan import StepPlan
from coadjoint.kernels.emit.substeps import Done, substeps
from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.program import Code

NAME = "step"
POINTER = DOUBLE.as_pointer()


def assemble(plan: StepPlan, width: int = 1) -> str:
    """The module as LLVM assembly."""
    return str(StepFunction(plan, width).module)


class StepFunction:
    """Writes that function; `kernels.emit.online` writes one that continues where the last call ended."""

    emitter = Emitter

    def __init__(self, plan: StepPlan, width: int) -> None:
        self.plan, self.width = plan, width
        self.module = ir.Module(name="coadjoint")
        if any(stage.scheme.multipliers for stage in plan.stages):
            self.module.add_named_metadata(FEW_PASSES, ["1"])
        int64s = INT64.as_pointer()
        signature = ir.FunctionType(
            ir.VoidType(), [POINTER, POINTER, POINTER, INT64, INT64, POINTER, POINTER, POINTER, int64s]
        )
        function = ir.Function(self.module, signature, name=NAME)
        for argument in function.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        self.arguments = function.args
        self.builder = b = ir.IRBuilder(function.append_basic_block("entry"))
        self.emit = self.emitter(self.module, b, width)
        self._function()

    # Memory: arrays of lanes.

    def load(self, pointer: object, index: Value, kind: Value = None) -> Value:
        """Element `index` of an array of numbers (or of `kind`) with lanes."""
        return self.builder.load(self._place(pointer, index, kind), align=8)

    def store(self, value: Value, pointer: Value, index: Value) -> None:
        self.builder.store(value, self._place(pointer, index, value.type), align=8)

    def _place(self, pointer: Value, index: object, kind: ir.Type) -> ir.Value:
        kind = kind if kind is not None else self.emit.number
        index = INT64(index) if isinstance(index, int) else index
        typed = self.builder.bitcast(pointer, kind.as_pointer())
        return self.builder.gep(typed, [index])

    # The loop over steps.

    def _function(self) -> None:
        b, plan = self.builder, self.plan
        p, h, s, records, every, self.record_out, self.monitor_out, self.extrema, status = self.arguments
        for i, node in enumerate(plan.parameters):
            self.emit.bind(node, self.load(p, i))
        self.emit.bind(plan.h, self.load(h, 0))
        self.state = [self.emit.variable(self.emit.number, self.load(s, i)) for i in range(len(plan.state))]
        self._begin(status)
        self.done, self.row = self.emit.variable(INT64, INT64(0)), self.emit.variable(INT64, INT64(0))
        self.due = self.emit.variable(INT64, INT64(0))
        number = b.mul(records, every)
        self.every = every
        self.emit.keep_exact(reachable(self._results()))
        self.emit.values(outer(self._roots(), self._varying()))
        loop, end = b.append_basic_block("loop"), b.append_basic_block("end")
        b.cbranch(self._opens(b.icmp_signed(">", number, INT64(0))), loop, end)
        b.position_at_end(loop)
        with self.emit.scope():
            self._step()
        done = b.add(b.load(self.done), INT64(1))
        b.store(done, self.done)
        b.cbranch(b.and_(b.icmp_signed("<", done, number), self.emit.any(b.load(self.alive))), loop, end)
        b.position_at_end(end)
        for i, place in enumerate(self.state):
            self.store(b.load(place), s, i)
        for i, place in enumerate((self.steps, self.code, self.total, self.most)):
            self.store(b.load(place), status, i)
        b.ret_void()

    def _begin(self, status: ir.Value) -> None:
        """The status of a run at its beginning: no step done, every lane alive."""
        emit = self.emit
        counters = (emit.variable(emit.counter, emit.counts(0)) for _ in range(4))
        self.steps, self.total, self.most, self.code = counters
        self.alive = self.emit.variable(self.emit.truth, self.emit.bit(True))

    def _opens(self, wanted: ir.Value) -> ir.Value:
        """Whether there is a first step, if one is wanted."""
        return wanted

    def _held(self, number: int) -> ir.Value:
        """Number `number` of the state at the node where a step begins."""
        return self.builder.load(self.state[number])

    def _results(self) -> list[Expr]:
        """Expressions whose sums must not be reordered, the residuals among them."""
        plan = self.plan
        roots = [*plan.record, *plan.monitors, *plan.certificates.values(), *([] if plan.stop is None else [plan.stop])]
        roots += [] if plan.inner is None else plan.inner.start
        for stage in plan.stages:
            roots += [*stage.guess, *stage.solution, stage.chart, *stage.after]
            for increment in stage.increments():
                roots += increment.right
        return roots

    def _roots(self) -> list[Expr]:
        roots = self._results()
        for stage in self.plan.stages:
            for increment in stage.increments():
                roots += [*increment.delta, increment.safe]
        return roots

    def _varying(self) -> set[Expr]:
        symbols, inner = set(self.plan.state), self.plan.inner
        if inner is not None:
            symbols.update(inner.state, inner.after, [inner.h])
        for stage in self.plan.stages:
            symbols.update(stage.unknowns, stage.scheme.iterate, stage.solution)
            symbols.update([] if stage.sound is None else [stage.sound])
        return symbols

    def _step(self) -> None:
        b, plan = self.builder, self.plan
        for number, node in enumerate(plan.state):
            self.emit.bind(node, self._held(number))
        idle = self.emit.bit(False) if self.width == 1 else b.xor(b.load(self.alive), self.emit.bit(True))
        if plan.inner is None:
            done = self._stages(idle)
        else:
            kept = [self.emit.variable(self.emit.number) for _ in (*plan.record, *plan.monitors)]
            done = substeps(self.emit, plan, plan.inner, kept, self._stages, idle)
        code, well = done.code, done.well
        observed = done.monitors()
        stop = [] if plan.stop is None else self.emit.values([plan.stop])
        if watched := [*observed, *done.certificates, *stop]:
            # Observations are results too: they are never NaN.
            seen = finite(self.emit, watched)
            code = b.select(b.and_(well, b.xor(seen, self.emit.bit(True))), self.emit.counts(Code.NOT_FINITE), code)
            well = b.and_(well, seen)
        for value in stop:
            event = b.fcmp_ordered(">", value, self.emit.constant(0.0))
            code = b.select(b.and_(well, event), self.emit.counts(Code.STOPPED), code)
            well = b.and_(well, b.xor(event, self.emit.bit(True)))
        well = b.and_(b.load(self.alive), well)
        if self.width > 1:
            self._finish(done, observed, well, code)
            return
        # One trajectory: a failed step changes nothing and ends the loop.
        fine, failed, on = (b.append_basic_block(name) for name in ("fine", "failed", "on"))
        b.cbranch(well, fine, failed).set_weights([1 << 20, 1])
        b.position_at_end(failed)
        b.store(code, self.code)
        b.store(self.emit.bit(False), self.alive)
        b.branch(on)
        b.position_at_end(fine)
        self._finish(done, observed, None, code)
        b.branch(on)
        b.position_at_end(on)

    def _stages(self, idle: Value) -> Done:
        """The stages one after the other; lanes that are idle do not wait."""
        b, plan = self.builder, self.plan
        iterations, code = self.emit.counts(0), self.emit.counts(0)
        well: Value = None
        for stage in plan.stages:
            outcome = StageLoop(self.emit, stage, idle).run()
            iterations = b.add(iterations, outcome.iterations)
            code = outcome.code if well is None else b.select(well, outcome.code, code)
            well = outcome.sound if well is None else b.and_(well, outcome.sound)
        return Done(
            well=well,
            code=code,
            iterations=iterations,
            after=self.emit.values(plan.stages[-1].after),
            record=lambda: self.emit.values(plan.record),
            course=lambda: self.emit.values(plan.kept),
            monitors=lambda: self.emit.values(plan.monitors),
            certificates=self.emit.values(plan.certificates.values()),
        )

    def _finish(self, done: Done, observed: list[ir.Value], well: Value, code: ir.Value) -> None:
        """Record, observe and take the new state, in the lanes without failure."""
        b, emit = self.builder, self.emit
        self._observe(done, observed, well)
        most = b.load(self.most)
        most = b.select(b.icmp_signed(">", most, done.iterations), most, done.iterations)
        counted = [b.add(b.load(self.steps), emit.counts(1)), b.add(b.load(self.total), done.iterations), most]
        places = [*self.state, self.steps, self.total, self.most]
        keep(emit, zip(places, [*done.after, *counted], strict=True), well)
        if well is not None:
            with b.if_then(emit.any(b.not_(well)), likely=False):
                newly = b.and_(b.load(self.alive), b.not_(well))
                b.store(b.select(newly, code, b.load(self.code)), self.code)
                b.store(well, self.alive)

    # Records and monitors.

    def _observe(self, done: Done, observed: list[Value], well: Value) -> None:
        b = self.builder
        for i, value in enumerate([*observed, *done.certificates]):
            self._extremum(value, i, well)
        due = b.load(self.due)
        before, now, on = b.block, b.append_basic_block("record"), b.append_basic_block("recorded")
        b.cbranch(b.icmp_signed("==", due, INT64(0)), now, on)
        b.position_at_end(now)
        row = b.load(self.row)
        with self.emit.scope():
            for values, out in (([*done.record(), *done.course()], self.record_out), (observed, self.monitor_out)):
                start = b.mul(row, INT64(len(values)))
                for i, value in enumerate(values):
                    self.store(value, out, b.add(start, INT64(i)))
        b.store(b.add(row, INT64(1)), self.row)
        last = b.block  # values may hold loops, which end in blocks of their own
        b.branch(on)
        b.position_at_end(on)
        left = b.phi(INT64)
        left.add_incoming(due, before)
        left.add_incoming(self.every, last)
        b.store(b.sub(left, INT64(1)), self.due)

    def _extremum(self, value: Value, i: int, well: object) -> None:
        """extrema[2i] and [2i + 1]: the least and the greatest value so far."""
        b = self.builder
        for place, order in ((2 * i, "<"), (2 * i + 1, ">")):
            old = self.load(self.extrema, place)
            better = b.fcmp_ordered(order, value, old)
            better = better if well is None else b.and_(better, well)
            self.store(b.select(better, value, old), self.extrema, place)
