"""The LLVM module of a stepper: commands in, some steps, observations out, by one call for many members.

    int64 online(context, first, last, steps)

does so for the groups of lanes first ≤ group < last, and returns their `StatusFlag`. `context` are eight
addresses and counts, `CONTEXT`. Parameters and states have axes (group, number, lane); `status` is (steps, code,
iterations, iterations_max) of each lane, int64, and accumulates from call to call: a lane whose code is not 0 waits,
and its commands with it; `Code.ABSENT` is that of a lane without a member. Commands and observations have axes (member,
number), where member = group · lanes + lane; limits (2, command, lane) are the same in all lanes. The steps are those
of `kernels.emit.stepping`, instruction by instruction, so that they give the same numbers; elementary functions of
lanes are those of `kernels.emit.lanes`, which agree to round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from llvmlite import ir
from llvmlite.ir.instructions import LoadInstr

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit.emitter import INT64
from coadjoint.kernels.emit.lanes import LaneEmitter
from coadjoint.kernels.emit.newton_loop import finite
from coadjoint.kernels.emit.plan import StepPlan
from coadjoint.kernels.emit.stepping import POINTER, StepFunction
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.program import StatusFlag
from coadjoint.kernels.trace.tracer import Tracer, flat

NAME = "online"
CONTEXT = ("parameters", "parameter_stride", "h", "state", "status", "commands", "observations", "limits")
"""The contents of `context`: addresses, and the stride between the parameters of two groups, 0 if shared."""

SELDOM, ALWAYS = 1 << 13, 1 << 18
"""From how many steps on `StatusFlag.DUE` is said at powers of two, and from where at multiples of this one."""


class Observing(NamedTuple):
    """Observations of a state: symbols of parameters and state, and the expressions of the observations."""

    parameters: list[Expr]
    state: list[Expr]
    values: list[Expr]


def observed(function: Callable[[Any, Any], tuple[Any, ...]], parameters: PyTree, state: PyTree) -> Observing:
    """Trace function(parameters, state) → arrays. Untraceable names what the language lacks."""
    tracer = Tracer()
    p, s = tracer.symbols("p", parameters), tracer.symbols("s", state)
    return Observing(flat(p), flat(s), flat(tracer.trace(function, p, s)))


def assemble(plan: StepPlan, watched: Observing, commanded: Sequence[int], width: int) -> str:
    """The module as LLVM assembly; `commanded` are the numbers of the state that the commands set, in their order."""
    return str(_Online(plan, watched, commanded, width).module)


class _Online(StepFunction):
    """The step that continues from its status and records nothing, and the loop over groups around it."""

    emitter = LaneEmitter

    def __init__(self, plan: StepPlan, watched: Observing, commanded: Sequence[int], width: int) -> None:
        self.commanded = list(commanded)
        super().__init__(plan, width)
        self.step = self.module.globals["step"]
        # A separate function is compiled as that of a run is.
        self.step.attributes.add("noinline")
        observe = self._observe_function(watched)
        self._entry(observe, len(plan.parameters), len(plan.state), len(watched.values))

    # Differences from the step of a run.

    def _begin(self, status: ir.Value) -> None:
        kind, b = self.emit.counter, self.builder
        self.status = status
        rows = [self.load(status, i, kind) for i in range(4)]
        self.steps, self.code, self.total, self.most = (self.emit.variable(kind, row) for row in rows)
        well = b.icmp_signed("==", b.load(self.code), self.emit.counts(0))
        self.alive = self.emit.variable(self.emit.truth, well)

    def _opens(self, wanted: Any) -> Any:
        return self.builder.and_(wanted, self.emit.any(self.builder.load(self.alive)))

    def _held(self, number: int) -> ir.Value:
        """A command is loaded at every step, like a signal that is evaluated there, so that LLVM treats both alike."""
        if number not in self.commanded:
            return super()._held(number)
        b = self.builder
        load = _VolatileLoad(b.block, self._place(self.arguments[2], number, self.emit.number))
        load.align = 8  # pyright: ignore[reportAttributeAccessIssue]
        b._insert(load)
        return load

    def _observe(self, done: object, observed: list[Any], well: object) -> None:
        pass

    # Around it.

    def _observe_function(self, watched: Observing) -> ir.Function:
        """int64 observe(parameters, state, observations): the observations of a group, whether all are finite."""
        kind = ir.FunctionType(INT64, [POINTER, POINTER, POINTER])
        function = ir.Function(self.module, kind, name="observe")
        function.linkage = "internal"
        self.builder = b = ir.IRBuilder(function.append_basic_block("entry"))
        self.emit = emit = self.emitter(self.module, b, self.width)
        p, s, out = function.args
        for pointer, symbols in ((p, watched.parameters), (s, watched.state)):
            for i, node in enumerate(symbols):
                emit.bind(node, self.load(pointer, i))
        values = emit.values(watched.values)
        for i, value in enumerate(values):
            for lane in range(self.width):
                self._number(out, lane * len(values) + i).store(_lane(b, value, lane, self.width))
        bad = b.xor(finite(emit, values), emit.bit(True))
        b.ret(b.select(emit.any(bad), INT64(StatusFlag.NOT_FINITE), INT64(0)))
        return function

    def _entry(self, observe: ir.Function, parameters: int, numbers: int, observations: int) -> None:
        whole = INT64.as_pointer()
        entry = ir.Function(self.module, ir.FunctionType(INT64, [whole, INT64, INT64, INT64]), name=NAME)
        context, first, last, steps = entry.args
        self.builder = b = ir.IRBuilder(entry.append_basic_block("entry"))
        self.emit = self.emitter(self.module, b, self.width)
        given = {name: b.load(b.gep(context, [INT64(i)])) for i, name in enumerate(CONTEXT)}
        array = {name: b.inttoptr(given[name], POINTER) for name in CONTEXT if name != "parameter_stride"}
        before, head, end = b.block, b.append_basic_block("groups"), b.append_basic_block("end")
        b.cbranch(b.icmp_signed("<", first, last), head, end)
        b.position_at_end(head)
        group, summary = b.phi(INT64), b.phi(INT64)
        p = b.gep(array["parameters"], [b.mul(group, given["parameter_stride"])])
        s = b.gep(array["state"], [b.mul(group, INT64(numbers * self.width))])
        status = b.gep(b.bitcast(array["status"], whole), [b.mul(group, INT64(4 * self.width))])
        commands = b.gep(array["commands"], [b.mul(group, INT64(len(self.commanded) * self.width))])
        out = b.gep(array["observations"], [b.mul(group, INT64(observations * self.width))])
        clipped = self._command(s, commands, array["limits"], status)
        taken = self.load(status, 0, self.emit.counter)
        nowhere = ir.Constant(POINTER, None)
        b.call(self.step, [p, array["h"], s, INT64(1), steps, nowhere, nowhere, nowhere, status])
        now = b.or_(summary, b.call(observe, [p, s, out]))
        failed = b.icmp_signed(">", self.load(status, 1, self.emit.counter), self.emit.counts(0))
        for flag, lanes in (
            (StatusFlag.FAILED, failed),
            (StatusFlag.CLIPPED, clipped),
            (StatusFlag.DUE, self._due(taken, status)),
        ):
            now = b.or_(now, b.select(self.emit.any(lanes), INT64(flag), INT64(0)))
        following = b.add(group, INT64(1))
        back = b.block
        b.cbranch(b.icmp_signed("<", following, last), head, end)
        for phi, value, again in ((group, first, following), (summary, INT64(0), now)):
            phi.add_incoming(value, before)
            phi.add_incoming(again, back)
        b.position_at_end(end)
        result = b.phi(INT64)
        result.add_incoming(INT64(0), before)
        result.add_incoming(now, back)
        b.ret(result)

    def _command(self, s: object, commands: ir.Value, limits: Any, status: object) -> Any:
        """Put the commands of a group into its states, in the lanes that go on; those with one beyond its limits."""
        b, emit = self.builder, self.emit
        beyond = emit.bit(False)
        well = b.icmp_signed("==", self.load(status, 1, emit.counter), emit.counts(0))
        for column, number in enumerate(self.commanded):
            places = [lane * len(self.commanded) + column for lane in range(self.width)]
            given = _lanes(b, [self._number(commands, place).load() for place in places], emit.number)
            self.store(b.select(well, given, self.load(s, number)), s, number)
            for sign, row in (("<", 0), (">", 1)):
                end = self.load(limits, row * len(self.commanded) + column)
                beyond = b.or_(beyond, b.fcmp_ordered(sign, given, end))
        return b.and_(well, beyond)

    def _due(self, taken: ir.Value, status: object) -> Any:
        """The lanes whose count of steps, `taken` before, has come to one of those of `StatusFlag.DUE`."""
        b, counts = self.builder, self.emit.counts
        now = self.load(status, 0, self.emit.counter)
        changed = b.xor(taken, now)
        power = b.or_(b.icmp_unsigned(">", changed, taken), b.icmp_unsigned(">=", changed, counts(ALWAYS)))
        return b.and_(power, b.icmp_unsigned(">=", now, counts(SELDOM)))

    def _number(self, pointer: ir.Value, index: int) -> _Number:
        return _Number(self.builder, self.builder.gep(pointer, [INT64(index)]))


class _Number(NamedTuple):
    """A single number in memory."""

    builder: ir.IRBuilder
    place: PyTree

    def load(self) -> Any:
        return self.builder.load(self.place, align=8)

    def store(self, value: ir.Value) -> None:
        self.builder.store(value, self.place, align=8)


def _lane(builder: ir.IRBuilder, value: ir.Value, lane: int, width: int) -> ir.Value:
    return value if width == 1 else builder.extract_element(value, ir.Constant(ir.IntType(32), lane))


def _lanes(builder: ir.IRBuilder, numbers: list[ir.Value], kind: ir.Type) -> ir.Value:
    """Numbers side by side."""
    if len(numbers) == 1:
        return numbers[0]
    lanes = ir.Constant(kind, ir.Undefined)
    for lane, number in enumerate(numbers):
        lanes = builder.insert_element(lanes, number, ir.Constant(ir.IntType(32), lane))
    return lanes


class _VolatileLoad(LoadInstr):
    """A load that the compiler does not move."""

    def descr(self, buf: list[str]) -> None:
        plain: list[str] = []
        super().descr(plain)
        buf.append(plain[0].replace("load ", "load volatile ", 1))
