"""From a problem to its transcription: the expressions of a step, of costs, of bounds and of both ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import chain
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.control.boundary_conditions import end_conditions, free_start_sizes, start_residual
from coadjoint.control.functions import traced
from coadjoint.control.given import given_numbers, given_values
from coadjoint.control.inputs_between import Profile, at_end, columns, first, source
from coadjoint.control.measured import Measured, Seen
from coadjoint.control.penalty import slack_of
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import End, Input, Terminal
from coadjoint.control.stage import Begun, StepGraph, numbers_of, step_graph
from coadjoint.control.step_functions import MeasuredDifference, StepColumns, functions_of
from coadjoint.control.transcription import Rows, Transcription
from coadjoint.control.within_steps import with_points
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.trace.tracer import flat
from coadjoint.mechanics.inputs import inputs_from
from coadjoint.mechanics.internal_state import require_internal
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.traced_once import tracing_once
from coadjoint.methods.method import Method
from coadjoint.simulation.arguments import require_forward, with_inputs
from coadjoint.spaces.measured import MeasuredSpace
from coadjoint.spaces.named import Named


def transcribe(
    problem: ProblemData, later: bool = False, wanted: Callable[[StepGraph], list[Expr]] | None = None
) -> Transcription:
    """The functions of a problem; raises ArgumentError and LagrangianError for ill-posed problems.

    later: whether its motion begins at the end of another one. wanted: further functions that shall depend on x alone.
    """
    with tracing_once():
        return _transcribed(problem, later, wanted)


def _transcribed(problem: ProblemData, later: bool, wanted: Callable[[StepGraph], list[Expr]] | None) -> Transcription:
    beginning = begun(problem.system, problem.start, problem.dt, problem.method, problem.inputs)
    graph = step_graph(beginning, (*problem.parameters, *problem.changing))
    reached = end_conditions(problem)
    values = given_values(problem)
    symbols = graph.tracer.symbols("given ", values)
    graph.symbols.parameters.extend(flat(symbols))
    cost = _number(graph, problem.cost, "The cost")
    final = _number(graph, problem.final_cost, "The final cost")
    path = {name: graph.of_motion(b.function, f"The constraint `{name}`") for name, b in problem.path.items()}
    end = {
        f"`{name}` at the end": graph.at_node(residual, "The end", symbols["goal"][name])
        for name, residual in reached.items()
    }
    if problem.end_function is not None:
        end = {"the end": graph.of_motion(problem.end_function, "The end")}
    within = np.inf
    if problem.terminal is not None and np.isfinite(within := problem.terminal.within):
        end["the terminal set"] = graph.of_place(partial(_level, problem.terminal), "The terminal set")
    measured = {name: _measured(graph, name, m) for name, m in problem.measured.items()}
    eta = flat(graph.tracer.symbols("start ", np.zeros(sum(free_start_sizes(problem).values()))))
    start = [] if later else _start(graph, problem, eta, symbols["start"])
    of_path, of_end = (list(chain.from_iterable(rows.values())) for rows in (path, end))
    of_start = start if problem.free_start else []
    more = wanted(graph) if wanted else []
    seen = chain.from_iterable(one.off for one in measured.values())
    terminal = [] if problem.terminal is None else graph.of_place(problem.terminal.directions, "The terminal cost")
    live = graph.needed([*cost, *final, *of_path, *of_end, *of_start, *seen, *terminal, *more])
    functions = functions_of(graph, eta, live, cost, of_path, start, of_end, final, measured)
    if problem.terminal is not None:
        functions = functions._replace(terminal=StepColumns(graph, eta, live).of_node("terminal", terminal))
    if problem.path_points:
        chosen = [(name, value) for name, value in problem.inputs.items() if isinstance(value, Input)]
        given = functions.equations, functions.path, problem.path_points, columns(chosen), at_end(chosen)
        functions = functions._replace(**dict(zip(("equations", "within"), with_points(*given), strict=True)))
    rows = [_path_rows(name, len(found), problem) for name, found in path.items()]
    ends = [_end_rows(what, np.zeros(len(found)), problem) for what, found in end.items()]
    if np.isfinite(within):
        ends[-1] = Rows("the terminal set", np.array([-np.inf]), np.array([within]))
    what = "the start" if problem.free_start else "the velocities of the start"
    begins = [Rows(what, np.zeros(len(start)), np.zeros(len(start)))] if start else []
    data = {name: _data(problem, name, one.space) for name, one in measured.items()}
    numbers = given_numbers(problem, problem.system, values)
    begin = len(numbers) - numbers_of(values["start"]).size - numbers_of(values["previous"]).size
    previous = {}
    for name in sorted(values["previous"]):
        previous[name] = slice(begin, begin + values["previous"][name].size)
        begin = previous[name].stop
    return Transcription(
        problem, beginning, graph, live, functions, rows, begins, ends, eta, data, numbers, previous, values["goal"],
        later,
    )  # fmt: skip


def _measured(graph: StepGraph, name: str, measured: Measured) -> MeasuredDifference:
    what = f"The measurement `{name}`"
    value = graph.array_of_motion(measured.function, what)
    space = measured.space_of(value, name)
    y = graph.tracer.symbols(f"measured {name} ", np.zeros(space.size))
    return MeasuredDifference(flat(traced(graph.tracer, what, space.difference, value, y)), flat(y), space)


def _data(problem: ProblemData, name: str, space: MeasuredSpace) -> Seen:
    measured = problem.measured[name]
    nodes = measured.nodes(name, float(problem.start.t), problem.dt, problem.count)
    values = np.zeros((0, space.size)) if measured.values is None else measured.values
    return Seen(nodes, *measured.seen(space, values, name), space)


def begun(system: System, start: State, h: float, method: Method, inputs: Mapping[str, object]) -> Begun:
    """The system with its commands, and the state that its method starts from; raises the errors of `co.simulate`."""
    named, t = {name: source(value) for name, value in inputs.items()}, float(start.t)
    for name, value in inputs.items():
        if isinstance(value, Profile):
            value.require(name, t)
    guesses = {name: first(v, t) for name, v in inputs.items() if isinstance(v, (Input, Profile))}
    start = start.replace(inputs=Named(**guesses)) if guesses else start
    system, start = with_inputs(system, start, inputs_from(named or None), method.start == "velocity")
    require_internal(system, start, h)
    system.check(start, method.regular)
    require_forward(system, method, start, h)
    return Begun(system, method, h, method.begin(system, start, h))


def _start(graph: StepGraph, problem: ProblemData, eta: list[Expr], values: dict[str, PyTree]) -> list[Expr]:
    """The residual at the first node: of a free start, all of it; if chosen parameters change its momenta, ξ and ν less
    the given ones."""
    if problem.free_start:
        return graph.at_node(start_residual(problem), "The start", np.array(eta, object), values)
    if not values:
        return []

    def residual(system: System, state: State, start: dict[str, PyTree]) -> PyTree:
        rest = state.nu - start["nu"]
        rest = rest if system.additional.flat else system.additional.coordinates(system.group, state.n, rest)
        return jnp.concatenate([state.xi - start["xi"], rest])

    return graph.at_node(residual, "The start", values)


def _level(terminal: Terminal, system: System, state: State) -> PyTree:
    """½ eᵀVe."""
    e = terminal.directions(system, state)
    return 0.5 * e @ jnp.asarray(terminal.cost) @ e


def _number(graph: StepGraph, function: Any, what: str) -> list[Expr]:
    if function is None:
        return [graph.tracer.graph.zero]
    found = graph.of_motion(function, what)
    if len(found) != 1:
        raise LagrangianError(f"{what} must return one number, but returns {len(found)}.")
    return found


def _path_rows(name: str, count: int, problem: ProblemData) -> Rows:
    bounds = problem.path[name]
    try:
        lower, upper = (np.broadcast_to(np.ravel(x), count) for x in (bounds.lower, bounds.upper))
    except ValueError:
        raise ArgumentError(
            f"The constraint `{name}` has {count} numbers, but bounds of the shapes {bounds.lower.shape} and "
            f"{bounds.upper.shape}."
        ) from None
    what = f"the constraint `{name}`"
    slack = None if bounds.soft is None else slack_of(bounds.soft, lower, upper, what)
    return Rows(what, lower, upper, slack, name)


def _end_rows(what: str, zeros: np.ndarray, problem: ProblemData) -> Rows:
    soft = problem.end.soft if isinstance(problem.end, End) else None
    name = f"end {what.split('`')[1]}" if "`" in what else "end"
    return Rows(what, zeros, zeros, None if soft is None else slack_of(soft, zeros, zeros, what), name)
