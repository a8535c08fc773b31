"""From a problem to a nonlinear program: variables x_k, u_k, z_k, the equations of each step, bounds and costs.

The variables are ordered by steps, (x_0, u_0, z_0), …, (x_{N−1}, u_{N−1}, z_{N−1}), x_N, parameters and h, so that the
derivatives are banded. x are the numbers of the state that equations, costs and bounds depend on; group elements are
among them with all their entries, and stay on the group, as each is the last one times an element of G.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.control.inputs_between import Columns, Profile, columns
from coadjoint.control.library import casadi
from coadjoint.control.measured import Seen
from coadjoint.control.penalty import Slack
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import Input
from coadjoint.control.stage import Begun, StepGraph
from coadjoint.control.step_functions import Functions
from coadjoint.kernels.expressions.expression import Expr


class Rows(NamedTuple):
    """Equations or bounds of one kind: their name, and their limits, (rows,) each.

    slack, name: the variables of soft ones, and their name in the answer.
    """

    what: str
    lower: np.ndarray
    upper: np.ndarray
    slack: Slack | None = None
    name: str = ""


class Split(NamedTuple):
    """The variables by their kind: x (N + 1, nx), u (N, nu), z (N, nz), θ, parameters and η (np,), h, s.

    slack: of the soft constraints; empty for zeros.
    """

    x: np.ndarray
    u: np.ndarray
    z: np.ndarray
    parameters: np.ndarray
    h: float
    slack: np.ndarray = np.zeros(0)


@dataclass
class Transcription:
    """A problem as functions of CasADi.

    live: the numbers of the state that are x. path, end: their rows. eta: the change of the start, if it is free. data:
    name → measurements. given: the numbers that may change from one solution to the next. previous: the places
    of commands in force among them. goal: the values of the end, with g⁻¹ for g. later: whether x_0 is the end of
    another phase.
    """

    problem: ProblemData
    beginning: Begun
    graph: StepGraph
    live: list[int]
    functions: Functions
    path: list[Rows]
    start: list[Rows]
    end: list[Rows]
    eta: list[Expr]
    data: dict[str, Seen]
    given: np.ndarray
    previous: dict[str, slice]
    goal: dict[str, PyTree]
    later: bool = False

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """The sizes of x, u and z of a step, with those of points inside it, and of the parameters, with η."""
        found, nz = self.graph.symbols, self.functions.equations.size1_in(2)
        return len(self.live), len(found.commands), nz, len(found.parameters) - len(self.given) + len(self.eta)

    def numbers(self, parameters: np.ndarray) -> np.ndarray:
        """The argument p of the functions: θ and chosen parameters, the given numbers, η.

        parameters: θ, chosen parameters and η.
        """
        chosen = self.sizes[3] - len(self.eta)
        return np.concatenate([parameters[:chosen], self.given, parameters[chosen:]])

    def expressions(self, parameters: Any, given: Any = None) -> Any:
        """`numbers` of expressions of CasADi; given: by default the numbers of the problem."""
        ca, chosen = casadi(), self.sizes[3] - len(self.eta)
        given = ca.MX(ca.DM(self.given)) if given is None else given
        return ca.vertcat(*map(ca.vec, (parameters[:chosen], given, parameters[chosen:])))

    @property
    def inputs(self) -> list[tuple[str, Input]]:
        """The inputs that are chosen at every step, in the order of u."""
        return [(name, value) for name, value in self.problem.inputs.items() if isinstance(value, Input)]

    @property
    def columns(self) -> list[Columns]:
        """Their places in u."""
        return columns(self.inputs)

    @property
    def profiles(self) -> dict[str, Profile]:
        """The inputs whose numbers θ are chosen, in the order in which these precede the parameters."""
        return {name: value for name, value in self.problem.inputs.items() if isinstance(value, Profile)}

    def split(self, w: np.ndarray) -> Split:
        """The variables (n,) by their kind."""
        nx, nu, nz, count = self.sizes
        steps, block = self.problem.count, nx + nu + nz
        rows = w[: steps * block].reshape(steps, block)
        last, rest = np.split(w[steps * block :], [nx])
        free = self.problem.free_duration is not None
        h, slack = float(rest[count]) if free else self.problem.dt, rest[count + free :]
        x = np.vstack([rows[:, :nx], last])
        return Split(x, rows[:, nx : nx + nu], rows[:, nx + nu :], rest[:count], h, slack)

    def zeros(self) -> Split:
        """Variables that are all zero, h too."""
        nx, nu, nz, count = self.sizes
        steps = self.problem.count
        return Split(np.zeros((steps + 1, nx)), np.zeros((steps, nu)), np.zeros((steps, nz)), np.zeros(count), 0.0)

    def joined(self, parts: Split) -> np.ndarray:
        """The variables (n,) in their order."""
        rows = np.concatenate([parts.x[:-1], parts.u, parts.z], axis=1)
        h = [parts.h] if self.problem.free_duration is not None else []
        slack = (
            parts.slack
            if len(parts.slack)
            else np.zeros(sum(rows.slack.size * n for rows, n in self.soft if rows.slack))
        )
        return np.concatenate([rows.reshape(-1), parts.x[-1], parts.parameters, h, slack])

    @property
    def soft(self) -> list[tuple[Rows, int]]:
        """The soft constraints and the count of their nodes, in the order of their slack: path, points inside, end."""
        points, count = self.problem.path_points, self.problem.count
        path, end = ([rows for rows in part if rows.slack] for part in (self.path, self.end))
        within = [(rows, count * points) for rows in path] if points else []
        return [*((rows, count + 1) for rows in path), *within, *((rows, 1) for rows in end)]

    @property
    def slacks(self) -> int:
        """The count of slack variables."""
        return sum(rows.slack.size * nodes for rows, nodes in self.soft if rows.slack)

    def violated(self, parts: Split) -> dict[str, np.ndarray]:
        """Name → the violation of each soft constraint at its nodes, (nodes, rows); of an end (1, rows)."""
        found, begin = {}, 0
        for rows, nodes in self.soft:
            assert rows.slack is not None
            size = rows.slack.size * nodes
            own = parts.slack[begin : begin + size].reshape(nodes, rows.slack.size)
            found.setdefault(rows.name, rows.slack.violations(own))
            begin += size
        return found

    def commands(self, u: np.ndarray) -> dict[str, np.ndarray]:
        """Rows of u (N, nu) by the names of the inputs, (N, *shape) each, (N + 1, *shape) of linear ones."""
        found = {}
        for name, given, begin, end in self.columns:
            rows = u[:, begin] if begin == end else np.concatenate([u[:, begin], u[-1:, end]])
            found[name] = rows.reshape(len(rows), *given.shape)
        return found

    def taken(self, parts: Split) -> dict[str, np.ndarray]:
        """The optimal values of every input: its commands, or θ of a profile."""
        found, begin = self.commands(parts.u), 0
        for name, given in self.profiles.items():
            found[name] = parts.parameters[begin : begin + given.size].reshape(given.guess.shape)
            begin += given.size
        return found

    def moved_by(self, parts: Split) -> np.ndarray:
        """η, the change of the start."""
        return parts.parameters[len(parts.parameters) - len(self.eta) :]

    def chosen(self, parts: Split) -> dict[str, np.ndarray]:
        """The parameters that are chosen, by their names."""
        found, begin = {}, sum(profile.size for profile in self.profiles.values())
        known: Any = self.problem.system.parameters
        for name in self.problem.parameters:
            shape = np.shape(getattr(known, name))
            size = int(np.prod(shape))
            found[name] = parts.parameters[begin : begin + size].reshape(shape)
            begin += size
        return found
