"""The adjoint of a step: cotangents of parameters, state and h from those of the record and of the next state.

With r(P, S, h, z) = 0 and S⁺ = advance(P, S, h, z): z̄ = (∂S⁺/∂z)ᵀ S̄⁺, λ = −(∂r/∂z)⁻ᵀ z̄, and S̄ = (∂S⁺/∂S)ᵀ S̄⁺ +
(∂r/∂S)ᵀ λ, likewise P̄ and h̄ (implicit function theorem). Over the stages of a step from the last to the first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from llvmlite import ir

from coadjoint.kernels.emit.emitter import DOUBLE, INT64, Emitter, Value, outer
from coadjoint.kernels.emit.plan import StepPlan
from coadjoint.kernels.emit.solving import increment_values
from coadjoint.kernels.expressions.collection import Collector
from coadjoint.kernels.expressions.differentiation import backward, forward
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import Graph, substitute
from coadjoint.kernels.newton.increments import Increment, linear_solve
from coadjoint.kernels.untraceable import TooLarge, Untraceable

NAME = "adjoint"


@dataclass(frozen=True)
class StepAdjoint:
    """Expressions of the adjoint of a step.

    `tape` are the symbols that the forward run records at every step: the state, and the unknowns of each stage.
    `systems` give the multipliers λ of the stages, last first, with the symbols that stand for them.
    """

    plan: StepPlan
    tape: list[Expr]
    record_bar: list[Expr]
    after_bar: list[Expr]
    systems: list[tuple[Increment, list[Expr]]]
    parameters_bar: list[Expr]
    h_bar: Expr
    state_bar: list[Expr]


def tape(plan: StepPlan) -> list[Expr]:
    """What the adjoint needs of every step."""
    return [*plan.state, *(node for stage in plan.stages for node in stage.solution)]


def row(plan: StepPlan) -> list[Expr]:
    """The record of a step, and behind it those numbers of the tape that are not in it."""
    recorded = set(plan.record)
    return [*plan.record, *(node for node in tape(plan) if node not in recorded)]


def adjoint(plan: StepPlan, pattern: Sequence[int]) -> StepAdjoint:
    """The adjoint of a step whose parameters are all symbols, at parameters of a `pattern` of zeros and ones, that of
    `plan.specialised`; raises Untraceable where a stage may fail."""
    if any(stage.sound is not None for stage in plan.stages):
        raise Untraceable("advance", "a stage that may fail has no derivative in native code")
    graph = plan.graph
    record_bar = [graph.symbol(f"r{i}'") for i in range(len(plan.record))]
    after_bar = [graph.symbol(f"a{i}'") for i in range(len(plan.state))]
    roots: dict[Expr, Expr] = {}
    _add(graph, roots, plan.record, record_bar)
    _add(graph, roots, plan.stages[-1].after, after_bar)
    systems = []
    changing = {*tape(plan), *record_bar, *after_bar}
    for number, stage in reversed(list(enumerate(plan.stages))):
        residual = substitute(graph, stage.residual, dict(zip(stage.unknowns, stage.solution, strict=True)))
        rows = forward(graph, residual, stage.solution)
        n = range(len(residual))
        transposed = [[rows[j].get(i, graph.zero) for j in n] for i in n]
        multipliers = [graph.symbol(f"l{number}.{i}") for i in n]
        bars = backward(graph, roots, stage.solution)
        solved = linear_solve(graph, transposed, bars, changing, stage.scheme.multipliers)
        systems.append((solved.alone(graph), multipliers))
        _add(graph, roots, residual, multipliers)
    bars = backward(graph, roots, [*plan.parameters, plan.h, *plan.state])
    count = len(plan.parameters)
    found = StepAdjoint(plan, tape(plan), record_bar, after_bar, systems, bars[:count], bars[count], bars[count + 1 :])
    known = {p: graph.constant(float(k)) for p, k in zip(plan.parameters, pattern, strict=True) if k < 2}
    try:
        collect = Collector(graph, [*plan.parameters, plan.h])
        return _rewritten(found, lambda nodes: collect(substitute(graph, nodes, known)))
    except TooLarge:
        return found


def _rewritten(found: StepAdjoint, rewrite: Callable[[list[Expr]], list[Expr]]) -> StepAdjoint:
    """The same adjoint by rewritten expressions."""
    systems = []
    for increment, multipliers in found.systems:
        matrix = [rewrite(entries) for entries in increment.jacobian]
        (safe,), delta, right = rewrite([increment.safe]), rewrite(increment.delta), rewrite(increment.right)
        systems.append((replace(increment, delta=delta, safe=safe, jacobian=matrix, right=right), multipliers))
    p, (h,), s = rewrite(found.parameters_bar), rewrite([found.h_bar]), rewrite(found.state_bar)
    return replace(found, systems=systems, parameters_bar=p, h_bar=h, state_bar=s)


def _add(graph: Graph, roots: dict[Expr, Expr], nodes: list[Expr], bars: list[Expr]) -> None:
    for node, bar in zip(nodes, bars, strict=True):
        roots[node] = graph.add(roots[node], bar) if node in roots else bar


def assemble(adjoint: StepAdjoint, places: Sequence[int], width: int) -> str:
    """LLVM assembly of the adjoint of `steps` steps from the step `first`, backwards over a tape:

        void adjoint(parameters, h, tape, first, steps, record_bars, every, parameters_bar, h_bar, state_bar)

    Rows of the tape have `width` numbers, those of `adjoint.tape` at `places`. There is a record of step 0 and of every
    `every` steps. The last three are read and written: contributions are added to the first two.
    """
    module = ir.Module(name="coadjoint")
    pointer = DOUBLE.as_pointer()
    signature = ir.FunctionType(
        ir.VoidType(), [pointer, pointer, pointer, INT64, INT64, pointer, INT64, *[pointer] * 3]
    )
    function = ir.Function(module, signature, name=NAME)
    for argument in function.args:
        if isinstance(argument.type, ir.PointerType):
            argument.add_attribute("noalias")
    p, h, rows, first, steps, record_bars, every, parameters_bar, h_bar, state_bar = function.args
    b = ir.IRBuilder(function.append_basic_block("entry"))
    emit = Emitter(module, b, 1)
    emit.keep_exact(())

    def load(nodes: list[Expr], place: ir.Value, at: Sequence[int] | None = None) -> None:
        for node, i in zip(nodes, at or range(len(nodes)), strict=True):
            emit.bind(node, b.load(b.gep(place, [INT64(i)])))

    load(adjoint.plan.parameters, p)
    load([adjoint.plan.h], h)
    emit.values(outer(_roots(adjoint), _varying(adjoint)))
    entry, loop, end = b.block, b.append_basic_block("loop"), b.append_basic_block("end")
    b.cbranch(b.icmp_signed(">", steps, INT64(0)), loop, end)
    b.position_at_end(loop)
    left = b.phi(INT64)
    left.add_incoming(steps, entry)
    row = b.sub(left, INT64(1))
    with emit.scope():
        load(adjoint.tape, b.gep(rows, [b.mul(row, INT64(width))]), places)
        load(adjoint.record_bar, _record_bars(emit, b.add(first, row), every, record_bars, len(adjoint.record_bar)))
        load(adjoint.after_bar, state_bar)
        _write(adjoint, emit, (parameters_bar, h_bar, state_bar))
    left.add_incoming(row, b.block)
    b.cbranch(b.icmp_signed(">", row, INT64(0)), loop, end)
    b.position_at_end(end)
    b.ret_void()
    return str(module)


def _record_bars(emit: Emitter, step: Value, every: Value, rows: Value, size: int) -> Value:
    """Where the cotangent of the record of a step is: in its row, or zeros for a step without."""
    b, kind = emit.builder, ir.ArrayType(DOUBLE, max(size, 1))
    zeros: Value = ir.GlobalVariable(emit.module, kind, "zeros")
    zeros.global_constant, zeros.linkage, zeros.initializer = True, "internal", ir.Constant(kind, None)
    number = b.sdiv(step, every)
    saved = b.icmp_signed("==", b.mul(number, every), step)
    return b.select(saved, b.gep(rows, [b.mul(number, INT64(size))]), b.bitcast(zeros, DOUBLE.as_pointer()))


def _write(adjoint: StepAdjoint, emit: Emitter, places: tuple[ir.Value, ir.Value, ir.Value]) -> None:
    """Solve for the multipliers and put the cotangents where they belong."""
    b = emit.builder
    for increment, multipliers in adjoint.systems:
        for symbol, value in zip(multipliers, increment_values(emit, increment), strict=True):
            emit.bind(symbol, value)
    parameters_bar, h_bar, state_bar = places
    sums = emit.values([*adjoint.parameters_bar, adjoint.h_bar])
    for i, (value, place) in enumerate(
        zip(sums, [parameters_bar] * len(adjoint.parameters_bar) + [h_bar], strict=True)
    ):
        here = b.gep(place, [INT64(i if place is parameters_bar else 0)])
        b.store(b.fadd(b.load(here), value), here)
    for i, value in enumerate(emit.values(adjoint.state_bar)):
        b.store(value, b.gep(state_bar, [INT64(i)]))


def _roots(adjoint: StepAdjoint) -> list[Expr]:
    solved = [node for increment, _ in adjoint.systems for node in (*increment.delta, increment.safe)]
    return [*solved, *adjoint.parameters_bar, adjoint.h_bar, *adjoint.state_bar]


def _varying(adjoint: StepAdjoint) -> set[Expr]:
    multipliers = [node for _, symbols in adjoint.systems for node in symbols]
    return {*adjoint.tape, *adjoint.record_bar, *adjoint.after_bar, *multipliers}
