"""The quadratic program about a plan: its steps linearised, its costs to second order, its constraints to first.

    min Σ ½ δwᵀ H_k δw + g_kᵀ δw   subject to   δx_{k+1} = A δx_k + B δu_k + c_k,  w = (x, u),

where H is the Hessian of the costs alone, with no curvature of the steps: a generalised Gauss–Newton method, whose
steps need no multipliers and lead to the same optima. Where a Hessian is not positive semidefinite its negative
eigenvalues are left out.

Source: M. Diehl, H. G. Bock, J. P. Schlöder, *A real-time iteration scheme for nonlinear optimization in optimal
feedback control*, SIAM J. Control Optim. 43 (2005); on the Hessian: F. Messerer, K. Baumgärtner, M. Diehl, *Survey of
sequential convex programming and generalized Gauss–Newton methods*, ESAIM: Proc. 71 (2021).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from coadjoint.control.inputs_between import at_end
from coadjoint.control.linearised import LinearSteps, Steps, Tables, expanded, with_jacobian
from coadjoint.control.penalty import joined
from coadjoint.control.quadratic import Stages
from coadjoint.control.tangents import Tangents
from coadjoint.control.transcription import Transcription
from coadjoint.errors import ArgumentError

PARKED = 1e-8
"""The length of a step after the end of a motion that is shorter than the program, in units of the others."""

FLOOR = 1e-9
"""The least eigenvalue of a Hessian, of its largest number."""


class Expansion(NamedTuple):
    """The program about a plan, its linear steps, and the matrices from changes of a node to directions."""

    stages: Stages
    steps: Steps
    inverses: np.ndarray


class Expanding:
    """A transcription's functions, expanded about any plan. scale: the unit of each input in the program.

    Of a linear input the number at the beginning of a step is that at the end of the step before, a state of the
    program. begins, ends: their places in u. free: the places of the others, which the program chooses.
    floor: the least eigenvalue of Hessians, of their largest number. multiplier: of the terminal set by the last
    solution.
    """

    def __init__(self, transcription: Transcription, floor: float = FLOOR):
        self._floor = floor
        problem, functions = transcription.problem, transcription.functions
        self.transcription, self.count, self.h = transcription, problem.count, problem.dt
        self.nx, self.nu = transcription.sizes[:2]
        self.lower, self.upper, self.rate = (limits_of(transcription, name) for name in ("lower", "upper", "rate"))
        width = self.upper - self.lower
        self.scale = np.where(np.isfinite(width) & (width > 0), width / 2, 1.0)
        self.change_cost = limits_of(transcription, "change_cost")
        linear = [(one.begin, one.end) for one in transcription.columns if one.begin != one.end]
        every = np.arange(self.nu)
        self.begins, self.ends = (np.concatenate([every[side] for side in sides] or [every[:0]])
                                  for sides in (zip(*linear, strict=True) if linear else ((), ())))  # fmt: skip
        self.free, self._at_end = np.setdiff1d(every, self.begins), np.array(at_end(transcription.inputs), int)
        held = np.setdiff1d(self.free, self.ends)
        changes = held[(np.isfinite(self.rate) | (self.change_cost > 0))[held]]
        self.rated = np.sort(np.concatenate([changes, self.ends]))
        self.linear = np.searchsorted(self.rated, self.ends)
        self.tangents = Tangents(transcription)
        columns, self.width = self.tangents.columns(self.scale), self.tangents.width
        self._linear = LinearSteps(transcription, self.count, columns)
        cost, final = (expanded(transcription, name, columns) for name in ("cost", "final_cost"))
        terminal = functions.terminal
        self._terminal = None if terminal is None else Tables(with_jacobian(terminal, "terminal", columns), 1)
        self._weight = np.zeros((0, 0)) if problem.terminal is None else problem.terminal.cost
        self._bounded = problem.terminal is not None and np.isfinite(problem.terminal.within)
        self.multiplier = 0.0
        path, end = (with_jacobian(getattr(functions, name), name, columns) for name in ("path", "end"))
        self._cost, self._final = Tables(cost, 2 * self.count), Tables(final, 1)
        self._path, self._end = Tables(path, self.count + 1), Tables(end, 1)
        path_rows = [(len(rows.lower), rows.slack, self.h) for rows in transcription.path]
        self.slack = joined([*path_rows, (len(self.rated), None, 0.0)])
        half = [(count, slack, 0.5 * weight) for count, slack, weight in path_rows]
        self.last_slack = joined([*half, *((len(rows.lower), rows.slack, 1.0) for rows in transcription.end)])
        self.coupled = self._coupled(cost) or self._coupled(final)
        costs = [given for given in (problem.cost, problem.final_cost) if given is not None]
        self._definite = all(hasattr(given, "residual") for given in costs)
        self._hessians = np.zeros((2 * self.count, self.width + self.nu, self.width + self.nu))
        self._path_reads_inputs = _reads(path, self.width + held)
        if np.any(_reads(end, self.width + every)):
            raise ArgumentError(
                "A controller's `end` must be of the state alone: put conditions on inputs into `path`."
            )

    def _coupled(self, function) -> bool:
        """Whether a cost has a product of a state with an input, which belongs to two stages at the end of a step."""
        hessian = _pattern(function, "hessian", self.width + self.nu)
        return bool(np.any(hessian[: self.width, self.width :]))

    def lengths(self, left: int) -> np.ndarray:
        """The lengths of all steps, (N,), s, of a motion of `left` steps."""
        return np.where(np.arange(self.count) < left, 1.0, PARKED) * self.h

    def __call__(
        self, x: np.ndarray, u: np.ndarray, z: np.ndarray, p: np.ndarray, before: np.ndarray, left: int
    ) -> Expansion:
        """The program about x (N + 1, nx), u (N, nu), z; before: the input until then, NaN if unknown.

        left: the steps of the motion; at its end it stays for those that remain.
        """
        inverses = self.tangents.inverses(x, u, p, self.h)
        steps = self._linear(x[:-1], u, z, p, self.lengths(left)[:, None])
        M = self.tangents.rows(steps.M, inverses[1:])
        c = self.tangents.rows((steps.c - x[1:])[:, :, None], inverses[1:])[:, :, 0]
        H, g, last_H, last_g = self._costs(x, u, p, M, c, 0.5 * self.lengths(left))
        C, limits, last_C, last_limits = self._constraints(x, u, p)
        bounds = (self.lower - u) / self.scale, (self.upper - u) / self.scale
        stages = Stages(H, g, M, c, C, limits, bounds, last_H, last_g, last_C, last_limits)
        return Expansion(self._with_slack(self._with_rates(stages, u, before)), steps, inverses)

    def _costs(
        self, x: np.ndarray, u: np.ndarray, p: np.ndarray, M: np.ndarray, c: np.ndarray, half: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        n, nx, nu = self.count, self.width, self.nu
        later = u[:, self._at_end]
        _, gradient, hessian = self._cost(np.concatenate([x[:-1], x[1:]]), np.concatenate([u, later]), p, self.h)
        both = np.concatenate([half, half])[:, None]
        hessian = np.multiply(both[:, :, None], hessian.reshape(2 * n, nx + nu, nx + nu), out=self._hessians)
        gradient = both * gradient
        H, g, ahead, slope = hessian[:n], gradient[:n], hessian[n:], gradient[n:]
        _, gradient, last = self._final(x[-1:], later[-1:], p, self.h)
        ahead[-1] += last.reshape(nx + nu, nx + nu)
        slope[-1] += gradient[0]
        if self._terminal is not None:
            e, J = self._terminal(x[-1:], later[-1:], p, self.h)
            J = J.reshape(e.size, nx + nu)
            VJ = self._weight @ J
            ahead[-1] += (1.0 + self.multiplier) * J.T @ VJ
            slope[-1] += VJ.T @ e[0]
        if len(self.begins):
            read = np.eye(nx + nu)[np.concatenate([np.arange(nx), nx + self._at_end])]
            ahead, slope = read.T @ ahead @ read, slope @ read
        if self.coupled:
            T = np.concatenate([M, np.broadcast_to(np.eye(nu, nx + nu, nx), (n, nu, nx + nu))], axis=1)
            offset = slope + (ahead[:, :, :nx] @ c[:, :, None])[:, :, 0]
            back = T.transpose(0, 2, 1)
            H, g = H + back @ ahead @ T, g + (back @ offset[:, :, None])[:, :, 0]
            return self._convex(H), g, np.zeros((nx, nx)), np.zeros(nx)
        H[:, nx:, nx:] += ahead[:, nx:, nx:]
        g[:, nx:] += slope[:, nx:]
        H[1:, :nx, :nx] += ahead[:-1, :nx, :nx]
        g[1:, :nx] += slope[:-1, :nx]
        return self._convex(H), g, self._convex(ahead[-1:, :nx, :nx])[0], slope[-1, :nx]

    def _convex(self, H: np.ndarray) -> np.ndarray:
        return convex(H, self._definite, self._floor)

    def _constraints(self, x: np.ndarray, u: np.ndarray, p: np.ndarray):
        """The rows of the motion, less those that no input can change at the first node, and inputs at the last."""
        n, nx, m = self.count, self.width, self.width + self.nu
        later = u[-1:, self._at_end]
        values, jacobian = self._path(x, np.concatenate([u, later]), p, self.h)
        rows = values.shape[1]
        jacobian = jacobian.reshape(n + 1, rows, m)
        of_path, of_end = (
            [np.concatenate([getattr(r, s) for r in part] or [[]]) for s in ("lower", "upper")]
            for part in (self.transcription.path, self.transcription.end)
        )
        limits = [np.asarray(side, float) - values for side in of_path]
        inputs = self._path_reads_inputs
        for side, endless in zip(limits, (-np.inf, np.inf), strict=True):
            side[0, ~inputs] = endless
            side[-1, inputs] = endless
        end, slopes = self._end(x[-1:], later, p, self.h)
        last_C = np.zeros((rows + end.shape[1], nx + len(self.rated)))
        last_C[:rows, :nx], last_C[rows:, :nx] = jacobian[-1, :, :nx], slopes.reshape(end.shape[1], m)[:, :nx]
        last_C[:rows, nx + self.linear] = jacobian[-1][:, nx + self.begins]
        last = [np.concatenate([side[-1], at_end - end[0]]) for side, at_end in zip(limits, of_end, strict=True)]
        return jacobian[:-1], (limits[0][:-1], limits[1][:-1]), last_C, (last[0], last[1])

    def _with_rates(self, s: Stages, u: np.ndarray, before: np.ndarray) -> Stages:
        """With the previous input as additional states, v_{k+1} = u_k, and |u_k − v_k| ≤ rate h, for inputs with a
        rate."""
        rated, n, nx = self.rated, self.count, self.width
        if not len(rated):
            return s
        more, chosen = len(rated), np.searchsorted(self.free, rated)
        places = np.zeros(self.nu, int)
        places[self.free], places[self.begins] = more + np.arange(len(self.free)), self.linear
        grown = np.concatenate([np.arange(nx), nx + places])
        m = nx + more + len(self.free)
        H, g, M, C = (
            np.zeros((n, m, m)),
            np.zeros((n, m)),
            np.zeros((n, nx + more, m)),
            np.zeros((n, s.C.shape[1] + more, m)),
        )
        H[:, grown[:, None], grown], g[:, grown] = s.H, s.g
        M[:, :nx, grown] = s.M
        M[:, nx + np.arange(more), nx + more + chosen] = 1.0
        C[:, : s.C.shape[1], grown] = s.C
        C[:, s.C.shape[1] + np.arange(more), nx + more + chosen] = self.scale[rated]
        C[:, s.C.shape[1] + np.arange(more), nx + np.arange(more)] = -self.scale[rated]
        last = np.vstack([before, u[:-1]])[:, rated]
        last[:, self.linear] = u[:, self.begins]
        change = u[:, rated] - last
        most = self.rate[rated] * self.h
        low = np.where(np.isnan(change), -np.inf, -most - change)
        high = np.where(np.isnan(change), np.inf, most - change)
        self._add_changes(H, g, np.nan_to_num(change), ~np.isnan(change))
        limits = np.concatenate([s.C_limits[0], low], 1), np.concatenate([s.C_limits[1], high], 1)
        wide = [(0, more)]
        return s._replace(
            H=H, g=g, M=M, c=np.pad(s.c, [(0, 0), *wide]), C=C, C_limits=limits, last_H=np.pad(s.last_H, wide * 2),
            last_g=np.pad(s.last_g, wide), u_limits=(s.u_limits[0][:, self.free], s.u_limits[1][:, self.free]),
        )  # fmt: skip

    def _add_changes(self, H: np.ndarray, g: np.ndarray, change: np.ndarray, known: np.ndarray) -> None:
        """Add Σ c |u_k − v_k|²/h, from the changes of the plan (N, rated)."""
        rated, units = self.rated, self.scale[self.rated]
        cost = known * 2.0 * self.change_cost[rated] / self.h
        v = self.width + np.arange(len(rated))
        u = self.width + len(rated) + np.searchsorted(self.free, rated)
        for a, b, sign in ((v, v, 1.0), (u, u, 1.0), (u, v, -1.0), (v, u, -1.0)):
            H[:, a, b] += sign * cost * units**2
        g[:, u] += cost * units * change
        g[:, v] -= cost * units * change

    def _with_slack(self, s: Stages) -> Stages:
        """With the slack variables of soft constraints as additional inputs, and of the last node."""
        n, k, last = self.count, self.slack.size, self.last_slack.size
        if not (k or last):
            return s
        m, wide = s.H.shape[1], [(0, 0), (0, k)]
        H, g = np.zeros((n, m + k, m + k)), np.pad(s.g, wide)
        weights = np.ones(n)
        weights[0] = 0.5
        H[:, :m, :m], g[:, m:] = s.H, weights[:, None] * self.slack.linear
        H[:, m + np.arange(k), m + np.arange(k)] = np.maximum(weights[:, None] * self.slack.quadratic, FLOOR)
        C = np.concatenate([s.C, np.broadcast_to(self.slack.matrix, (n, *self.slack.matrix.shape))], axis=2)
        lower, upper = np.pad(s.u_limits[0], wide), np.pad(s.u_limits[1], wide, constant_values=np.inf)
        size = len(s.last_g)
        last_H = np.pad(s.last_H, (0, last))
        last_H[size + np.arange(last), size + np.arange(last)] = np.maximum(self.last_slack.quadratic, FLOOR)
        return s._replace(
            H=H, g=g, M=np.pad(s.M, [(0, 0), (0, 0), (0, k)]), C=C, u_limits=(lower, upper), last_H=last_H,
            last_g=np.concatenate([s.last_g, self.last_slack.linear]),
            last_C=np.concatenate([s.last_C, self.last_slack.matrix], axis=1),
        )  # fmt: skip

    def continuous(self, u: np.ndarray, before: np.ndarray) -> np.ndarray:
        """u (N, nu) whose linear inputs begin each step where the last one ended; before: u of the step before."""
        if not len(self.begins):
            return u
        u = u.copy()
        u[:, self.begins] = np.vstack([before, u[:-1]])[:, self.ends]
        return u

    def note(self, multipliers: np.ndarray) -> None:
        """Keep the multiplier of the terminal set, whose curvature counts in the next program."""
        self.multiplier = max(float(multipliers[-1]), 0.0) if self._bounded else 0.0

    def violated(self, u: np.ndarray, last: np.ndarray) -> dict[str, np.ndarray]:
        """Name → the violation of each soft constraint, (N + 1, rows), of an end (1, rows), by a solution.

        u: (N, nu) with the slack behind the inputs; last: that of the end.
        """
        found, at_nodes, at_end = {}, u[:, len(self.free) :], last
        for rows in self.transcription.path:
            if rows.slack is not None:
                size = rows.slack.size
                own = np.concatenate([at_nodes[:, :size], at_end[None, :size]])
                at_nodes, at_end = at_nodes[:, size:], at_end[size:]
                found[rows.name] = rows.slack.violations(np.maximum(own, 0.0))
        for rows in self.transcription.end:
            if rows.slack is not None:
                found[rows.name] = rows.slack.violations(np.maximum(at_end[None, : rows.slack.size], 0.0))
                at_end = at_end[rows.slack.size :]
        return found

    def patterns(self) -> dict[str, np.ndarray]:
        """The numbers of the program that may differ from zero."""
        nx, nu, more = self.width, len(self.free) + self.slack.size, len(self.rated)
        rows, end = (
            sum(len(r.lower) for r in self.transcription.path),
            sum(len(r.lower) for r in self.transcription.end),
        )
        m = nx + more + nu
        last = nx + more + self.last_slack.size
        found = {"M": (nx + more, m), "H": (m, m), "C": (rows + more, m), "last_H": (last, last)}
        return {name: np.ones(shape, bool) for name, shape in (found | {"last_C": (rows + end, last)}).items()}


def limits_of(transcription: Transcription, name: str) -> np.ndarray:
    """`lower`, `upper`, `rate`, `guess` or `change_cost` of all inputs, (nu,)."""
    return columns_of(transcription, {one: getattr(given, name) for one, given in transcription.inputs})


def columns_of(transcription: Transcription, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """u of a step, (nu,), with these values of the inputs at its beginning and at its end."""
    found = np.zeros(transcription.sizes[1])
    for name, _, begin, end in transcription.columns:
        found[begin] = found[end] = np.ravel(values[name])
    return found


def convex(H: np.ndarray, definite: bool, floor: float = FLOOR) -> np.ndarray:
    """The nearest matrices (n, m, m) with eigenvalues from `floor` of the largest number on.

    definite: whether none is negative, so that no search is needed; H itself is raised then.
    """
    diagonal = np.arange(H.shape[-1])
    if definite:  # the largest number is on the diagonal
        H[:, diagonal, diagonal] += floor * max(float(np.max(H[:, diagonal, diagonal], initial=0.0)), 1e-300)
        return H
    size = max(float(np.max(np.abs(H), initial=0.0)), 1e-300)
    raised = H + floor * size * np.eye(H.shape[-1])
    try:
        np.linalg.cholesky(raised)
        return raised
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(H)
        return (vectors * np.maximum(values, floor * size)[:, None, :]) @ vectors.transpose(0, 2, 1)


def _pattern(function, result: str, width: int) -> np.ndarray:
    sparsity = function.sparsity_out(result)
    found = np.zeros((sparsity.size1(), width), bool)
    found[np.array(sparsity.row(), int), np.array(sparsity.get_col(), int)] = True
    return found


def _reads(function, columns: np.ndarray) -> np.ndarray:
    """The rows of a function that depend on some of (x, u)."""
    sparsity = function.sparsity_out("jacobian")
    return np.any(_pattern(function, "jacobian", sparsity.size2())[:, columns], axis=1)
