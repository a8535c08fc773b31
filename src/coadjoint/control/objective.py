"""The variables of a nonlinear program by their meaning, and its cost f(w)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.control.boundary_conditions import start_deviations
from coadjoint.control.inputs_between import at_end
from coadjoint.control.library import casadi
from coadjoint.control.transcription import Transcription
from coadjoint.errors import ArgumentError


class MappedFunction:
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


class ProgramVariables(NamedTuple):
    """w by its parts: x, u and z of every step (rows, N), x of the last node, the parameters p and the length h.

    after: u at the end of every step. lengths: of the steps (1, N), s. slack: of soft constraints. given: the numbers
    that are given with each solution. fixed: h where it is not chosen, else None.
    """

    w: Any
    x: Any
    u: Any
    z: Any
    last: Any
    after: Any
    p: Any
    h: Any
    lengths: Any
    slack: Any
    given: Any
    fixed: float | None

    @property
    def each(self) -> tuple[Any, Any]:
        """Parameters and length of every step."""
        return casadi().repmat(self.p, 1, self.x.shape[1]), self.lengths

    @property
    def end(self) -> tuple[Any, ...]:
        """(x, u, p, h) of the last node."""
        return self.last, self.after[:, -1], self.p, self.h

    def mapped(self, function: Any) -> MappedFunction:
        """A function of a step, for all steps."""
        return MappedFunction(function, self.x.shape[1], self.fixed)


def variables(transcription: Transcription, given: bool, even: int) -> ProgramVariables:
    """The variables of a transcription; the arguments are those of `nonlinear_program`."""
    ca, problem = casadi(), transcription.problem
    nx, nu, nz, count = transcription.sizes
    steps, block, free = problem.count, nx + nu + nz, problem.free_duration is not None
    end = steps * block + nx + count + free
    w = ca.MX.sym("w", end + transcription.slacks)
    rows = ca.reshape(w[: steps * block], block, steps)
    last = w[steps * block : steps * block + nx]
    u = rows[nx : nx + nu, :]
    numbers = ca.MX.sym("given", len(transcription.given)) if given else None
    p = transcription.expressions(w[steps * block + nx : steps * block + nx + count], numbers)
    h = w[end - 1] if free else ca.MX(problem.dt)
    lengths = ca.horzcat(ca.repmat(ca.MX(problem.dt), 1, even), ca.repmat(h, 1, steps - even))
    return ProgramVariables(
        w, rows[:nx, :], u, rows[nx + nu :, :], last, u[at_end(transcription.inputs), :], p, h, lengths, w[end:],
        transcription.given if numbers is None else numbers, None if free else problem.dt,
    )  # fmt: skip


def objective(transcription: Transcription, v: ProgramVariables, before: dict[str, Any]) -> PyTree:
    """f(w) without the cost of slack: of the last node, of the course, of measurements and of changes of inputs."""
    ca, problem, functions = casadi(), transcription.problem, transcription.functions
    f = _of_terminal(transcription, *v.end)
    if problem.final_cost is not None:
        f += functions.final(*v.end)
    if problem.cost is not None:
        cost = v.mapped(functions.cost)
        begun = cost(v.x, v.u, *v.each)
        same = "x" not in cost.read and at_end(transcription.inputs) == list(range(transcription.sizes[1]))
        following = ca.horzcat(v.x[:, 1:], v.last)
        f += ca.dot(v.lengths, begun if same else 0.5 * (begun + cost(following, v.after, *v.each)))
    f += _misfit(transcription, ca.horzcat(v.x, v.last), ca.horzcat(v.u, v.after[:, -1]), v.p, v.h)
    return f + _of_changes(transcription, v.u, v.lengths, before)


def _of_terminal(transcription: Transcription, *node: PyTree) -> PyTree:
    """½ eᵀVe of the last node, 0 without a terminal cost."""
    terminal = transcription.problem.terminal
    if terminal is None:
        return casadi().MX(0)
    e = transcription.functions.terminal(*node)
    return 0.5 * casadi().bilin(casadi().DM(terminal.cost), e, e)


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
