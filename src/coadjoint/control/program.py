"""The nonlinear program of a transcription: f(w), g(w) with their limits, for any solver of CasADi."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.control.library import casadi
from coadjoint.control.objective import ProgramVariables, objective, variables
from coadjoint.control.stage import numbers_of
from coadjoint.control.transcription import Rows, Split, Transcription


class Block(NamedTuple):
    """Rows of g(w) of one kind, the same at `nodes` nodes in turn."""

    rows: Rows
    nodes: int


Constraint = tuple[list[Block], Any]
"""Blocks of rows of g(w) with their values, one after the other."""


class NonlinearProgram(NamedTuple):
    """min f(w), lower ≤ g(w) ≤ upper, between bounds of w. blocks: the rows of g, in their order. p: the numbers that
    are given with each solution, None if they are constants."""

    w: Any
    f: Any
    g: PyTree
    blocks: list[Block]
    bounds: tuple[np.ndarray, np.ndarray]
    p: Any = None

    def at(self, given: np.ndarray) -> NonlinearProgram:
        """The program with these numbers given."""
        if self.p is None:
            return self
        f, g = casadi().Function("program", [self.w, self.p], [self.f, self.g])(self.w, given)
        return self._replace(f=f, g=g, p=None)

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """The lower and upper limits of g."""
        parts = [(np.tile(b.rows.lower, b.nodes), np.tile(b.rows.upper, b.nodes)) for b in self.blocks]
        lower, upper = zip(*parts, strict=True)
        return np.concatenate(lower), np.concatenate(upper)

    def worst(self, values: np.ndarray) -> tuple[str, float]:
        """The constraint that `values` of g violate most, and by how much."""
        lower, upper = self.limits
        excess = np.nan_to_num(np.maximum(lower - values, values - upper), nan=np.inf)
        place, begin = int(np.argmax(excess)), 0
        for rows, nodes in self.blocks:
            size = len(rows.lower)
            if place < begin + size * nodes:
                node = (place - begin) // size
                where = f" at node {node}" if nodes > 1 else ""
                return f"{rows.what}{where}", float(excess[place])
            begin += size * nodes
        raise AssertionError("a row of no constraint")


def nonlinear_program(transcription: Transcription, given: bool = False, even: int = 0) -> NonlinearProgram:
    """The program of all steps, whose functions are mapped over the steps and never written out.

    given: whether the given numbers are arguments of the program; by default they are constants. even: of a free
    duration, the number of first steps that keep the length dt; the others share one that is chosen.
    """
    ca, v = casadi(), variables(transcription, given, even)
    softened = _Softened(v.slack, v.lengths / (1 + transcription.problem.path_points))
    before = {name: v.given[at] for name, at in transcription.previous.items()}
    rows = [
        *_of_steps(transcription, v, softened),
        *_of_inputs(transcription, v.u, v.lengths, before),
        *_of_ends(transcription, v, softened),
    ]
    f = objective(transcription, v, before) + softened.cost
    g, blocks = ca.vertcat(*(values for _, values in rows)), [block for own, _ in rows for block in own]
    return NonlinearProgram(v.w, ca.densify(f), g, blocks, _bounds(transcription, even), v.given if given else None)


def _of_steps(transcription: Transcription, v: ProgramVariables, softened: _Softened) -> Iterator[Constraint]:
    """The equations of motion of every step, and the constraints of the path at its nodes and inside steps."""
    ca, problem, functions = casadi(), transcription.problem, transcription.functions
    following, steps, zeros = ca.horzcat(v.x[:, 1:], v.last), problem.count, np.zeros(sum(transcription.sizes[::2]))
    residual, advanced = v.mapped(functions.equations)(v.x, v.u, v.z, *v.each)
    equations = Rows("the equations of motion", zeros, zeros)
    yield [Block(equations, steps)], ca.vec(ca.vertcat(residual, following - advanced))
    if transcription.path:
        at_nodes = ca.horzcat(v.mapped(functions.path)(v.x, v.u, *v.each), functions.path(*v.end))
        for rows, own in _by_rows(transcription.path, at_nodes):
            yield [Block(rows, steps + 1)], ca.vec(softened(rows, own, 0))
    if functions.within is not None:
        points = problem.path_points
        inside = ca.reshape(v.mapped(functions.within)(v.x, v.u, v.z, *v.each), -1, steps * points)
        found = [softened(rows, own, points) for rows, own in _by_rows(transcription.path, inside)]
        yield [Block(_inside(transcription), steps)], ca.vec(ca.vertcat(*found))


def _of_ends(transcription: Transcription, v: ProgramVariables, softened: _Softened) -> Iterator[Constraint]:
    """The conditions on the first and the last node."""
    functions = transcription.functions
    if transcription.start:
        yield [Block(rows, 1) for rows in transcription.start], functions.start(v.x[:, 0], v.u[:, 0], v.p, v.h)
    if transcription.end:
        for rows, own in _by_rows(transcription.end, functions.end(*v.end)):
            yield [Block(rows, 1)], softened(rows, own, None)


def _by_rows(kinds: Sequence[Rows], values: Any) -> Iterator[tuple[Rows, Any]]:
    """Each kind of rows with its own of values (rows, nodes)."""
    sizes = np.cumsum([0, *(len(rows.lower) for rows in kinds)]).tolist()
    return zip(kinds, casadi().vertsplit(values, sizes), strict=True)


class _Softened:
    """Adds slack variables to soft rows, one block after the other, and their cost."""

    def __init__(self, slack: Any, lengths: Any):
        ca = casadi()
        ahead, back = ca.horzcat(lengths, 0), ca.horzcat(0, lengths)
        self._slack, self._inside, self._nodes = slack, lengths, 0.5 * (ahead + back)
        self._begin, self.cost = 0, ca.MX(0)

    def __call__(self, rows: Rows, values: Any, points: int | None) -> Any:
        """c + S s of rows c (rows, nodes). points: inside each step, 0 of the nodes, None of the end."""
        if rows.slack is None:
            return values
        ca, size, nodes = casadi(), rows.slack.size, values.shape[1]
        s = ca.reshape(self._slack[self._begin : self._begin + size * nodes], size, nodes)
        self._begin += size * nodes
        each = ca.DM(rows.slack.linear).T @ s + 0.5 * ca.DM(rows.slack.quadratic).T @ s**2
        if points is None:
            self.cost += ca.sum2(each)
        else:
            self.cost += ca.dot(each, ca.kron(self._inside, ca.DM.ones(1, points)) if points else self._nodes)
        return values + ca.DM(rows.slack.matrix) @ s


def _inside(transcription: Transcription) -> Rows:
    """The constraints of the path at all points inside a step."""
    names = ", ".join(f"`{name}`" for name in transcription.problem.path)
    limits = (np.concatenate([getattr(one, side) for one in transcription.path]) for side in ("lower", "upper"))
    lower, upper = (np.tile(limit, transcription.problem.path_points) for limit in limits)
    return Rows(f"the path ({names}) inside the step", lower, upper)


def _of_inputs(transcription: Transcription, u: Array, lengths: Any, before: dict[str, Any]) -> Iterator[Constraint]:
    """Continuity of linear inputs, and the largest rates."""
    steps, vec = transcription.problem.count, casadi().vec
    for name, given, begin, end in transcription.columns:
        rate, zeros = np.ravel(given.rate), np.zeros(given.rate.size)
        limited, linear = np.any(np.isfinite(rate)), begin != end
        if linear and steps > 1:
            course = Rows(f"the course of input `{name}`", zeros, zeros)
            yield [Block(course, steps - 1)], vec(u[begin, 1:] - u[end, :-1])
        if linear and name in before:
            beginning = Rows(f"the beginning of input `{name}`", zeros, zeros)
            yield [Block(beginning, 1)], vec(u[begin, 0] - before[name])
        of_rate = Rows(f"the rate of input `{name}`", -rate, rate)
        if limited and linear:
            yield [Block(of_rate, steps)], vec(_over(u[end, :] - u[begin, :], lengths))
        elif limited and steps > 1:
            yield [Block(of_rate, steps - 1)], vec(_over(u[begin, 1:] - u[begin, :-1], lengths[:, 1:]))
        if limited and not linear and name in before:
            yield [Block(of_rate, 1)], vec((u[begin, 0] - before[name]) / lengths[0])


def _over(changes: Any, lengths: Any) -> Any:
    """Changes in each step (rows, n) over the lengths of the steps (1, n)."""
    return changes / casadi().repmat(lengths, changes.shape[0], 1)


def _bounds(transcription: Transcription, even: int) -> tuple[np.ndarray, np.ndarray]:
    """The bounds of w: the start is fixed, inputs and parameters stay between theirs, h between those of the time."""
    problem, steps = transcription.problem, transcription.problem.count
    nx, nu, nz, _ = transcription.sizes
    start = transcription.graph.numbers(transcription.beginning.state)[transcription.live]
    names = transcription.graph.names()
    own = bool(transcription.start)  # then the momenta of the first node are those of its velocities
    moved = ("mu", "pi", "g", "n", "a") if transcription.eta else ("mu", "pi")
    momenta = np.array([own and names[i].startswith(moved) for i in transcription.live], bool)
    found = []
    for side, unbounded in (("lower", -np.inf), ("upper", np.inf)):
        x, u = np.full((steps + 1, nx), unbounded), np.full((steps, nu), unbounded)
        x[0] = unbounded if transcription.later else np.where(momenta, unbounded, start)
        for _, given, begin, end in transcription.columns:
            u[:, begin] = u[:, end] = np.ravel(getattr(given, side))
        z = np.full((steps, nz), unbounded)
        of_parameters = [_spread(transcription, name, side == "upper") for name in problem.parameters]
        of_profiles = [np.ravel(getattr(profile, side)) for profile in transcription.profiles.values()]
        parameters = np.concatenate([*of_profiles, *of_parameters, np.full(len(transcription.eta), unbounded)])
        duration = (problem.free_duration or (0.0, 0.0))[side == "upper"] - even * problem.dt
        slack = np.full(
            sum(rows.slack.size * nodes for rows, nodes in transcription.soft if rows.slack), max(unbounded, 0.0)
        )
        found.append(transcription.joined(Split(x, u, z, parameters, duration / (steps - even), slack)))
    return found[0], found[1]


def _spread(transcription: Transcription, name: str, upper: bool) -> np.ndarray:
    size = numbers_of(getattr(transcription.beginning.system.parameters, name)).size
    return np.broadcast_to(np.ravel(transcription.problem.parameters[name][upper]), size)
