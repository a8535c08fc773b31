"""The tangent of a step: derivatives of the record and of the next state along directions of parameters and state.

With r(P, S, h, z) = 0 and S⁺ = advance(P, S, h, z): δz = −(∂r/∂z)⁻¹(∂r/∂P δP + ∂r/∂S δS), and δS⁺ = ∂S⁺/∂P δP +
∂S⁺/∂S δS + ∂S⁺/∂z δz (implicit function theorem), likewise for the record. Over the stages of a step in their order.
Everything that does not depend on the direction is computed once a step, for all directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from llvmlite import ir

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit.adjoint import tape
from coadjoint.kernels.emit.emitter import DOUBLE, INT64, Emitter, outer
from coadjoint.kernels.emit.plan import StepPlan
from coadjoint.kernels.emit.solving import increment_values
from coadjoint.kernels.expressions.differentiation import directional, forward
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import substitute
from coadjoint.kernels.newton.increments import Increment, linear_solve
from coadjoint.kernels.untraceable import Untraceable

NAME = "tangent"


@dataclass(frozen=True)
class StepTangent:
    """Expressions of the tangent of a step along one direction.

    `systems` give δz of the stages, in their order, with the symbols that stand for it.
    """

    plan: StepPlan
    tape: list[Expr]
    parameters_dot: list[Expr]
    state_dot: list[Expr]
    systems: list[tuple[Increment, list[Expr]]]
    record_dot: list[Expr]
    after_dot: list[Expr]


def tangent(plan: StepPlan, active: Sequence[int]) -> StepTangent:
    """The tangent of a step along the parameters numbered `active`, which must be symbols, and along the state."""
    if any(stage.sound is not None for stage in plan.stages):
        raise Untraceable("advance", "a stage that may fail has no derivative in native code")
    graph = plan.graph
    parameters_dot = [graph.symbol(f"p{i}°") for i in active]
    state_dot = [graph.symbol(f"s{i}°") for i in range(len(plan.state))]
    along = dict(zip((plan.parameters[i] for i in active), parameters_dot, strict=True))
    along.update(zip(plan.state, state_dot, strict=True))
    changing = {*tape(plan), *parameters_dot, *state_dot}
    systems = []
    for number, stage in enumerate(plan.stages):
        residual = substitute(graph, stage.residual, dict(zip(stage.unknowns, stage.solution, strict=True)))
        rows = forward(graph, residual, stage.solution)
        n = range(len(residual))
        matrix = [[rows[i].get(j, graph.zero) for j in n] for i in n]
        symbols = [graph.symbol(f"z{number}.{i}°") for i in n]
        right = directional(graph, residual, along)
        solved = linear_solve(graph, matrix, right, changing, stage.scheme.multipliers)
        systems.append((solved.alone(graph), symbols))
        along.update(zip(stage.solution, symbols, strict=True))
        changing.update(symbols)
    record_dot = directional(graph, plan.record, along)
    after_dot = directional(graph, plan.stages[-1].after, along)
    return StepTangent(plan, tape(plan), parameters_dot, state_dot, systems, record_dot, after_dot)


def assemble(tangent: StepTangent, width: int) -> str:
    """LLVM assembly of the tangents of `steps` steps along `columns` directions, over a tape:

        void tangent(parameters, h, tape, steps, parameters_dot, columns, state_dot, record_dot)

    Arrays have a last axis of lanes; a row of `tape` continues with the record; `parameters_dot` (columns, active),
    `state_dot` (columns, state), which is read and written, and `record_dot` (steps, columns, record).
    """
    module = ir.Module(name="coadjoint")
    pointer = DOUBLE.as_pointer()
    signature = ir.FunctionType(ir.VoidType(), [pointer] * 3 + [INT64, pointer, INT64, pointer, pointer])
    function = ir.Function(module, signature, name=NAME)
    for argument in function.args:
        if isinstance(argument.type, ir.PointerType):
            argument.add_attribute("noalias")
    p, h, rows, steps, p_dot, columns, s_dot, record_dot = function.args
    b = ir.IRBuilder(function.append_basic_block("entry"))
    emit = Emitter(module, b, width)

    def place(array: Any, index: Any) -> ir.Value:
        return b.gep(b.bitcast(array, emit.number.as_pointer()), [index])

    def load(nodes: list[Expr], array: ir.Value, start: PyTree) -> None:
        for i, node in enumerate(nodes):
            emit.bind(node, b.load(place(array, b.add(start, INT64(i))), align=8))

    def store(values: list[ir.Value], array: ir.Value, start: PyTree) -> None:
        for i, value in enumerate(values):
            b.store(value, place(array, b.add(start, INT64(i))), align=8)

    def column(row: object, number: Any) -> None:
        load(tangent.parameters_dot, p_dot, b.mul(number, INT64(len(tangent.parameters_dot))))
        here = b.mul(number, INT64(len(tangent.state_dot)))
        load(tangent.state_dot, s_dot, here)
        for increment, symbols in tangent.systems:
            for symbol, value in zip(symbols, increment_values(emit, increment), strict=True):
                emit.bind(symbol, value)
        seen = b.mul(b.add(b.mul(row, columns), number), INT64(len(tangent.record_dot)))
        store(emit.values(tangent.record_dot), record_dot, seen)
        store(emit.values(tangent.after_dot), s_dot, here)

    def step(row: object) -> None:
        load(tangent.tape, rows, b.mul(row, INT64(len(tangent.tape) + len(tangent.record_dot))))
        emit.values(outer(_roots(tangent), _directions(tangent)))
        _loop(b, columns, emit, lambda number: column(row, number))

    load(tangent.plan.parameters, p, INT64(0))
    load([tangent.plan.h], h, INT64(0))
    emit.values(outer(_roots(tangent), {*tangent.tape, *_directions(tangent)}))
    _loop(b, steps, emit, step)
    b.ret_void()
    return str(module)


def _loop(b: ir.IRBuilder, count: ir.Value, emit: Emitter, body: Any) -> None:
    """body(i) for i from 0 to count."""
    before, loop, end = b.block, b.append_basic_block("loop"), b.append_basic_block("end")
    b.cbranch(b.icmp_signed(">", count, INT64(0)), loop, end)
    b.position_at_end(loop)
    index = b.phi(INT64)
    index.add_incoming(INT64(0), before)
    with emit.scope():
        body(index)
    following = b.add(index, INT64(1))
    index.add_incoming(following, b.block)
    b.cbranch(b.icmp_signed("<", following, count), loop, end)
    b.position_at_end(end)


def _roots(tangent: StepTangent) -> list[Expr]:
    roots = [*tangent.record_dot, *tangent.after_dot]
    for increment, _ in tangent.systems:
        roots += [*increment.delta, increment.safe, *increment.right, *(x for row in increment.jacobian for x in row)]
    return roots


def _directions(tangent: StepTangent) -> set[Expr]:
    symbols = [node for _, symbols in tangent.systems for node in symbols]
    return {*tangent.parameters_dot, *tangent.state_dot, *symbols}
