"""One step of a program as expressions, ready to be emitted as machine code."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.expressions.collection import Collector
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import MAX_NODES_OF_MULTIPLIERS, Graph
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.newton.increments import Increment, Scheme, scheme
from coadjoint.kernels.newton.solver import Dense
from coadjoint.kernels.program import MAX_UNKNOWNS, Program, Stage
from coadjoint.kernels.trace.symbolic import nodes
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.kernels.untraceable import Structured, Untraceable


@dataclass(frozen=True)
class StagePlan:
    """One implicit stage: `unknowns` are Newton's symbols, `solution` the symbols of its solution.

    A settled unknown has the same symbol in Newton's loop and in the solution. `blocks` are the numbers of the
    unknowns of one kind each. `sound` is the symbol of a tolerant stage's success, None for others.
    """

    h: Expr
    blocks: list[range]
    guess: list[Expr]
    residual: list[Expr]
    unknowns: list[Expr]
    scheme: Scheme
    solution: list[Expr]
    chart: Expr
    sound: Expr | None
    after: list[Expr]

    def increments(self) -> Iterator[Increment]:
        """Those of the affine unknowns, of Newton's loop and of its chord, where there are any."""
        yield from (i for i in (self.scheme.first, self.scheme.loop, self.scheme.chord) if i is not None)


@dataclass(frozen=True)
class Inner:
    """The loop over substeps: symbols of a substep's h and of the state in it, which begins as `start`.

    `after` are the symbols of the state when all substeps are done.
    """

    fractions: tuple[float, ...]
    h: Expr
    state: list[Expr]
    start: list[Expr]
    after: list[Expr]


@dataclass(frozen=True)
class StepPlan:
    """A step: symbols of its arguments, its stages, and its observations.

    With `inner`, the stages are those of one substep, and record and monitors belong to the first substep.
    `certificates` are already the maximum over the stages; `monitors` and `certificates` are flat, `shapes` names them.
    `kept`, none by default, follow the record of a step: the unknowns of every substep with the state after it.
    """

    graph: Graph
    parameters: list[Expr]
    h: Expr
    state: list[Expr]
    inner: Inner | None
    stages: list[StagePlan]
    record: list[Expr]
    record_tree: Any
    monitors: list[Expr]
    monitor_shapes: dict[str, tuple[int, ...]]
    certificates: dict[str, Expr]
    stop: Expr | None
    kept: list[Expr] = field(default_factory=list)

    def with_course(self) -> StepPlan:
        """The same step; the unknowns of every substep, with the state after it, follow its record."""
        unknowns = [node for stage in self.stages for node in stage.solution]
        return replace(self, kept=[*unknowns, *self.stages[-1].after])

    @property
    def course(self) -> int:
        """How many numbers follow a record."""
        return len(self.kept) * (1 if self.inner is None else len(self.inner.fractions))


_KINDS = {0.0: 0, 1.0: 1}


def specialised(values: Iterable[float]) -> tuple[int, ...]:
    """The parameters that are exactly 0 or 1, by which code is specialised: 2 elsewhere."""
    numbers = values.tolist() if isinstance(values, np.ndarray) else values
    return tuple([_KINDS.get(x, 2) for x in numbers])


def plan(
    program: Program,
    parameters: PyTree,
    state: PyTree,
    pattern: tuple[int, ...],
    observed: bool,
    unrolled: bool = False,
) -> StepPlan:
    """Trace a program. `parameters` and `state` give shapes; `pattern` is that of `specialised`.

    `unrolled`: substeps are unrolled, stage after stage, instead of run in a loop.
    """
    if not all(stage.structure.native for stage in program.stages):
        raise Structured
    tracer = Tracer(Graph(MAX_NODES_OF_MULTIPLIERS) if any(map(_held, program.stages)) else None)
    graph = tracer.graph
    p = _specialise(graph, tracer.symbols("p", parameters), pattern)
    s, h = tracer.symbols("s", state), tracer.symbols("h", 0.0)
    prepared = tracer.trace(program.prepare, p, s, h)
    _check_same("prepare", prepared, state)
    looped = len(program.substeps) > 1 and not unrolled
    full = tracer.symbols("k", 0.0) if looped else h
    collect = Collector(graph, [*flat(p), h[()], full[()]])
    # Certificates and records share with the equations what `prepare` computes only in the form that the latter take.
    opening = tracer.symbols("c", state) if looped else _collected(collect, prepared)
    written = (1.0,) if looped else program.substeps
    parts = [(stage, substep * stage.fraction) for substep in written for stage in program.stages]
    changing = [*flat(opening), full[()]] if looped else flat(s)
    stages, first, certificates, current = _stages(tracer, parts, p, opening, full, changing, collect, observed)
    inner = None
    if looped:
        current = tracer.symbols("e", state)
        inner = Inner(program.substeps, full[()], flat(opening), flat(prepared), flat(current))
    monitors: Mapping[str, Any] = tracer.trace(program.monitors, p, first, h) if observed else {}
    return StepPlan(
        graph=graph,
        parameters=flat(tracer.symbols("p", parameters)),
        h=h[()],
        state=flat(s),
        inner=inner,
        stages=stages,
        record=flat(first),
        record_tree=jax.tree_util.tree_map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, np.float64), first),
        monitors=[node for name in monitors for node in flat(monitors[name])],
        monitor_shapes={name: np.shape(value) for name, value in monitors.items()},
        certificates=certificates,
        stop=flat(tracer.trace(program.stop, p, s, current))[0] if program.stops else None,
    )


def _stages(
    tracer: Tracer, parts: Sequence[tuple[Stage, float]], p: PyTree, state: PyTree, h: Any, changing: list[Expr],
    collect: Collector, observed: bool,
) -> tuple[list[StagePlan], Any, dict[str, Expr], Any]:  # fmt: skip
    """The stages one after the other, each over its part of h: their plans, the record of the first that is not
    tolerant, the largest certificates, and the state at their end."""
    graph, stages, certificates, first = tracer.graph, list[StagePlan](), dict[str, Expr](), None
    for number, (stage, fraction) in enumerate(parts):
        step = h if fraction == 1.0 else np.asarray(graph.mul(h[()], graph.constant(fraction)))
        traced, solution, sound = _stage(tracer, stage, number, p, state, step, changing, collect)
        after = _collected(collect, tracer.trace(stage.advance, p, state, step, solution, sound))
        _check_same("advance", after, state)
        stages.append(StagePlan(**traced, after=flat(after)))
        if first is None and not stage.tolerant:
            first = tracer.trace(stage.record, p, state, step, solution)
        if observed:
            found = tracer.trace(stage.certificate, p, state, step, solution, after)
            for name, value in found.items():
                (node,) = flat(value)
                certificates[name] = graph.apply("max", certificates[name], node) if name in certificates else node
        state = after
    return stages, first, certificates, state


def _stage(
    tracer: Tracer,
    stage: Stage,
    number: int,
    p: PyTree,
    state: PyTree,
    h: np.ndarray,
    changing: list[Expr],
    collect: Collector,
) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """The parts of a `StagePlan` before `advance`, and the arguments of `advance`: z and `sound`."""
    graph = tracer.graph
    guess = tracer.trace(stage.guess, p, state, h)
    if guess.ndim != 1 or (guess.size > MAX_UNKNOWNS and isinstance(stage.structure, Dense) and not _held(stage)):
        raise Untraceable("guess", f"a stage has {guess.size} unknowns, more than {MAX_UNKNOWNS}")
    unknowns = tracer.symbols(f"z{number}.", guess)
    residual = tracer.trace(stage.residual, p, state, h, unknowns)
    equations = collect(flat(residual))
    plan_of_newton = scheme(graph, list(unknowns), list(guess), equations, changing, collect, _held(stage))
    solution = tracer.symbols(f"w{number}.", guess)
    for i, value in plan_of_newton.settled.items():
        solution[i] = value
    traced = {
        "h": h[()],
        "blocks": _ranges(stage.blocks or (guess.size,)),
        "guess": plan_of_newton.start,
        "residual": equations,
        "unknowns": list(unknowns),
        "scheme": plan_of_newton,
        "solution": list(solution),
        "chart": collect(flat(tracer.trace(stage.chart, p, state, h, solution)))[0],
        "sound": None,
    }
    if not stage.tolerant:
        return traced, solution, np.asarray(graph.one)
    traced["sound"] = sound = graph.symbol(f"ok{number}")
    well = graph.apply("lt", graph.zero, sound)
    accepted = [graph.select(well, found, start) for found, start in zip(solution, guess, strict=True)]
    return traced, nodes(accepted, solution.shape), np.asarray(sound)


def _held(stage: Stage) -> bool:
    """Whether there are multipliers of constraints among the unknowns."""
    return isinstance(stage.structure, (Dense, Coupled)) and stage.structure.multipliers


def _collected(collect: Collector, tree: PyTree) -> Any:
    """The expressions in the arrays of a PyTree with their like terms collected."""
    return jax.tree_util.tree_map(lambda leaf: nodes(collect(list(leaf.ravel())), leaf.shape), tree)


def _ranges(sizes: tuple[int, ...]) -> list[range]:
    ends = np.cumsum(sizes).tolist()
    return [range(end - size, end) for size, end in zip(sizes, ends, strict=True) if size]


def _specialise(graph: Graph, tree: PyTree, pattern: tuple[int, ...]) -> Any:
    """Parameters that are exactly 0 or 1 as constants."""
    known = iter(pattern)

    def place(leaf: np.ndarray) -> np.ndarray:
        out = leaf.copy()
        for index in np.ndindex(leaf.shape):
            kind = next(known)
            if kind < 2:
                out[index] = graph.constant(float(kind))
        return out

    return jax.tree_util.tree_map(place, tree)


def _check_same(name: str, tree: PyTree, state: PyTree) -> None:
    """A step must return the structure of its argument."""
    given, got = (jax.tree_util.tree_flatten(t) for t in (state, tree))
    if given[1] != got[1] or [np.shape(x) for x in given[0]] != [np.shape(x) for x in got[0]]:
        raise ValueError(f"`{name}` must return a state with the structure and shapes of its argument.")
