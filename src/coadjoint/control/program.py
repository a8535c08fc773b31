"""The nonlinear program of a transcription: f(w), g(w) with their limits, for any solver of CasADi."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.control.boundary_conditions import start_deviations
from coadjoint.control.inputs_between import at_end
from coadjoint.control.library import casadi
from coadjoint.control.stage import numbers_of
from coadjoint.control.transcription import Rows, Split, Transcription
from coadjoint.errors import ArgumentError


class Block(NamedTuple):
    """Rows of g(w) of one kind, the same at `nodes` nodes in turn."""

    rows: Rows
    nodes: int


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
    ca, problem, functions = casadi(), transcription.problem, transcription.functions
    nx, nu, nz, count = transcription.sizes
    steps, block, free = problem.count, nx + nu + nz, problem.free_duration is not None
    end = steps * block + nx + count + free
    w = ca.MX.sym("w", end + transcription.slacks)
    rows = ca.reshape(w[: steps * block], block, steps)
    last = w[steps * block : steps * block + nx]
    x, u, z = rows[:nx, :], rows[nx : nx + nu, :], rows[nx + nu :, :]
    numbers = ca.MX.sym("given", len(transcription.given)) if given else None
    p = transcription.expressions(w[steps * block + nx : steps * block + nx + count], numbers)
    h = w[end - 1] if free else ca.MX(problem.dt)
    lengths = ca.horzcat(ca.repmat(ca.MX(problem.dt), 1, even), ca.repmat(h, 1, steps - even))
    softened = _Softened(w[end:], lengths / (1 + problem.path_points))
    following = ca.horzcat(x[:, 1:], last)
    each = ca.repmat(p, 1, steps), lengths
    number = None if free else problem.dt
    residual, advanced = _Mapped(functions.equations, steps, number)(x, u, z, *each)
    parts = [ca.vec(ca.vertcat(residual, following - advanced))]
    zeros = np.zeros(nz + nx)
    blocks = [Block(Rows("the equations of motion", zeros, zeros), steps)]
    after = u[at_end(transcription.inputs), :]
    f = _of_terminal(transcription, last, after[:, -1], p, h)
    if problem.final_cost is not None:
        f += functions.final(last, after[:, -1], p, h)
    if problem.cost is not None:
        cost = _Mapped(functions.cost, steps, number)
        begun = cost(x, u, *each)
        same = "x" not in cost.read and at_end(transcription.inputs) == list(range(nu))
        f += ca.dot(lengths, begun if same else 0.5 * (begun + cost(following, after, *each)))
    f += _misfit(transcription, ca.horzcat(x, last), ca.horzcat(u, after[:, -1]), p, h)
    if transcription.path:
        at_nodes = ca.horzcat(
            _Mapped(functions.path, steps, number)(x, u, *each), functions.path(last, after[:, -1], p, h)
        )
        begin = 0
        for of_path in transcription.path:
            own = at_nodes[begin : begin + len(of_path.lower), :]
            parts.append(ca.vec(softened(of_path, own, 0)))
            blocks.append(Block(of_path, steps + 1))
            begin += len(of_path.lower)
    if functions.within is not None:
        inside = ca.reshape(_Mapped(functions.within, steps, number)(x, u, z, *each), -1, steps * problem.path_points)
        sizes = np.cumsum([0, *(len(rows.lower) for rows in transcription.path)]).tolist()
        by_rows = ca.vertsplit(inside, sizes)
        found = [
            softened(rows, one, problem.path_points) for rows, one in zip(transcription.path, by_rows, strict=True)
        ]
        parts.append(ca.vec(ca.vertcat(*found)))
        blocks.append(Block(_inside(transcription), steps))
    before = {
        name: (transcription.given if numbers is None else numbers)[at] for name, at in transcription.previous.items()
    }
    f += _of_changes(transcription, u, lengths, before)
    for rows_of, values, nodes in _of_inputs(transcription, u, lengths, before):
        parts.append(ca.vec(values))
        blocks.append(Block(rows_of, nodes))
    if transcription.start:
        parts.append(functions.start(x[:, 0], u[:, 0], p, h))
        blocks += [Block(rows, 1) for rows in transcription.start]
    if transcription.end:
        sizes = np.cumsum([0, *(len(rows.lower) for rows in transcription.end)]).tolist()
        for of_end, own in zip(
            transcription.end, ca.vertsplit(functions.end(last, after[:, -1], p, h), sizes), strict=True
        ):
            parts.append(softened(of_end, own, None))
        blocks += [Block(of_end, 1) for of_end in transcription.end]
    f += softened.cost
    return NonlinearProgram(w, ca.densify(f), ca.vertcat(*parts), blocks, _bounds(transcription, even), numbers)


class _Mapped:
    """A function of CasADi over all steps, of those of its arguments that it reads: derivatives by the others, which
    are zero, would take as long to build as those that count. h: the length of the steps, None if it is chosen."""

    def __init__(self, function: Any, steps: int, h: float | None):
        ca, names = casadi(), function.name_in()
        symbols = [ca.SX.sym(name, function.size1_in(k)) for k, name in enumerate(names)]
        given = [ca.SX(h) if name == "h" and h is not None else one for name, one in zip(names, symbols, strict=True)]
        results = function.call(given, True, False)
        joined = ca.vertcat(*map(ca.vec, results))
        self._places = [k for k, one in enumerate(symbols) if ca.depends_on(joined, one)] or [0]
        self.read = [names[k] for k in self._places]
        own = [symbols[k] for k in self._places]
        self._function = ca.Function(function.name(), own, results, self.read, function.name_out()).map(steps)

    def __call__(self, *arguments: Any) -> Any:
        return self._function(*(arguments[k] for k in self._places))


def _of_terminal(transcription: Transcription, *node: PyTree) -> PyTree:
    """½ eᵀVe of the last node, 0 without a terminal cost."""
    terminal = transcription.problem.terminal
    if terminal is None:
        return casadi().MX(0)
    e = transcription.functions.terminal(*node)
    return 0.5 * casadi().bilin(casadi().DM(terminal.cost), e, e)


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


def _misfit(transcription: Transcription, x: Array, u: Array, p: PyTree, h: Scalar) -> PyTree:
    """½ Σ |(h(x_k) ⊖ y_k)/σ|², or ρ of it, of all measurements, and ½ |η/σ|² of the start."""
    ca, found = casadi(), 0.0
    for name, (nodes, values, weights, space) in transcription.data.items():
        if not len(nodes):
            raise ArgumentError(f"`{name}` has no values: give them to co.control.Measured, or use an estimator.")
        at, count = nodes.tolist(), len(nodes)
        function = transcription.functions.measured[name].map(count)
        off = function(x[:, at], u[:, at], ca.repmat(p, 1, count), ca.repmat(h, 1, count), ca.DM(values))
        off, loss = off * ca.DM(weights), transcription.problem.measured[name].loss
        squares = ca.sum1(off**2)
        found += 0.5 * ca.sumsqr(off) if loss is None else ca.sum2(loss.cost(squares, space.dim, ca))
    if transcription.eta:
        eta = p[-len(transcription.eta) :]
        found += 0.5 * ca.sumsqr(eta / ca.DM(start_deviations(transcription.problem)))
    return found


def _of_changes(transcription: Transcription, u: Array, lengths: Any, before: dict[str, Any]) -> PyTree:
    """Σ c |u_{k+1} − u_k|²/h of all inputs with a cost of changes."""
    ca, found = casadi(), 0.0
    for name, given, begin, end in transcription.columns:
        cost = np.ravel(given.change_cost)
        if not np.any(cost):
            continue
        own = u[begin, :]
        if begin != end:
            change = u[end, :] - own
        else:
            own = ca.horzcat(before[name], own) if name in before else own
            change = own[:, 1:] - own[:, :-1]
        found += ca.sum2(ca.DM(cost).T @ change**2 / lengths[:, -change.shape[1] :]) if change.shape[1] else 0.0
    return found


def _of_inputs(
    transcription: Transcription, u: Array, lengths: Any, before: dict[str, Any]
) -> list[tuple[Rows, Any, int]]:
    """Continuity of linear inputs, and the largest rates: rows, their values, and the number of nodes."""
    found, steps = [], transcription.problem.count
    for name, given, begin, end in transcription.columns:
        rate, zeros = np.ravel(given.rate), np.zeros(given.rate.size)
        limited, linear = np.any(np.isfinite(rate)), begin != end
        if linear and steps > 1:
            found.append((Rows(f"the course of input `{name}`", zeros, zeros), u[begin, 1:] - u[end, :-1], steps - 1))
        if linear and name in before:
            found.append((Rows(f"the beginning of input `{name}`", zeros, zeros), u[begin, 0] - before[name], 1))
        of_rate = Rows(f"the rate of input `{name}`", -rate, rate)
        if limited and linear:
            found.append((of_rate, _over(u[end, :] - u[begin, :], lengths), steps))
        elif limited and steps > 1:
            found.append((of_rate, _over(u[begin, 1:] - u[begin, :-1], lengths[:, 1:]), steps - 1))
        if limited and not linear and name in before:
            found.append((of_rate, (u[begin, 0] - before[name]) / lengths[0], 1))
    return found


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
