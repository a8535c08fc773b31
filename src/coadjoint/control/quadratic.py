"""Quadratic programs of optimal control, stage by stage, for HPIPM, which CasADi's wheel brings.

The variables are u_0, x_1, u_1, …, x_{N−1}, u_{N−1}, x_N: the start is known, and not a variable.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coadjoint.control.library import casadi
from coadjoint.control.linearised import view
from coadjoint.errors import ArgumentError

INF = 1e5
"""The number for no bound: no change may come near it."""

TOLERANCE = dict.fromkeys(("res_g_max", "res_b_max", "res_d_max", "res_m_max"), 1e-9)
MODES = {
    "near": {"mode": "speed", "mu0": 1e-2, "iter_max": 20, **TOLERANCE},
    "far": {"mode": "robust", "mu0": 1.0, "iter_max": 60, **TOLERANCE},
}
"""Of HPIPM, an interior-point method by Riccati's recursion. The program is of changes of a plan, which are small where
the plan is followed; a program that the first mode does not solve goes to the second one."""


class Stages(NamedTuple):
    """Numbers of a program. For N stages: H (N, m, m) and g (N, m) of (x_k, u_k), M = [A B] (N, nx, m) and c (N, nx),
    C (N, rows, m) of constraints between lower and upper (N, rows), bounds (N, nu) of u. Of the last node: H, g, C of
    (x_N, s), with slack variables s ≥ 0.
    """

    H: np.ndarray
    g: np.ndarray
    M: np.ndarray
    c: np.ndarray
    C: np.ndarray
    C_limits: tuple[np.ndarray, np.ndarray]
    u_limits: tuple[np.ndarray, np.ndarray]
    last_H: np.ndarray
    last_g: np.ndarray
    last_C: np.ndarray
    last_limits: tuple[np.ndarray, np.ndarray]


class Solved(NamedTuple):
    """x (N + 1, nx), u (N, nu), the slack at the end, and their violation of the constraints; failure: the reason, or
    empty. multipliers: of the constraints, those of the last node at the end."""

    x: np.ndarray
    u: np.ndarray
    last: np.ndarray
    violation: float
    failure: str
    multipliers: np.ndarray


class StageLayout:
    """The places of the numbers of stages among the nonzeros of the program's matrices.

    patterns: the entries of M (nx, m), H (m, m), C (rows, m), and of H_N, C_N that may differ from zero. x first, then
    u.
    """

    def __init__(self, count: int, nx: int, nu: int, patterns: dict[str, np.ndarray]):
        self.count, self.nx, self.nu = count, nx, nu
        self.rows, self.last_rows = len(patterns["C"]), len(patterns["last_C"])
        self.ends = patterns["last_C"].shape[1] - nx
        self.variables = count * (nx + nu) + self.ends
        stage = np.arange(count)[:, None]
        columns = stage * (nx + nu) + np.arange(-nx, nu)[None, :]  # of (x_k, u_k); those of x_0 are below 0
        last = self.variables - nx - self.ends + np.arange(nx + self.ends)
        begins = np.arange(count) * (nx + self.rows)
        following = columns[:, nx : nx + 1] + nu + np.arange(nx)
        steps = begins[:, None] + np.arange(nx)[None, :]
        limits = begins[:, None] + nx + np.arange(self.rows)[None, :]
        ends = count * (nx + self.rows) + np.arange(self.last_rows)
        of_h = [_entries(columns, columns, patterns["H"]), _entries(last[None], last[None], patterns["last_H"])]
        of_a = [
            _entries(steps, columns, patterns["M"]),
            _entries(steps.reshape(-1, 1), following.reshape(-1, 1), np.ones((1, 1), bool)),
            _entries(limits, columns, patterns["C"]),
            _entries(ends[None], last[None], patterns["last_C"]),
        ]  # fmt: skip
        self.h, self._h_order = _compressed(of_h, (self.variables, self.variables))
        self.a, self._a_order = _compressed(of_a, (count * (nx + self.rows) + self.last_rows, self.variables))
        self._limits = limits

    def numbers(self, s: Stages, first: np.ndarray) -> dict[str, np.ndarray]:
        """The arguments of the solver by their names, with δx_0 = first, (nx,)."""
        nx, rows = self.nx, self.count * (self.nx + self.rows)
        h = np.concatenate([s.H.ravel(), s.last_H.ravel()])[self._h_order]
        minus = np.full(self.count * nx, -1.0)
        a = np.concatenate([s.M.ravel(), minus, s.C.ravel(), s.last_C.ravel()])[self._a_order]
        g, c = s.g[:, :], s.c.copy()
        c[0] += s.M[0, :, :nx] @ first
        gradient = np.concatenate([g[0, nx:] + s.H[0, nx:, :nx] @ first, g[1:].ravel(), s.last_g])
        sides = []
        for side in (0, 1):
            limits = s.C_limits[side].copy()
            limits[0] -= s.C[0, :, :nx] @ first
            stage = np.concatenate([-c, limits], axis=1)
            sides.append(np.concatenate([stage.ravel(), s.last_limits[side]]))
            assert len(sides[-1]) == rows + self.last_rows
        return {"h": h, "a": a, "g": gradient, "lba": sides[0], "uba": sides[1], **self._bounds(s)}

    def _bounds(self, s: Stages) -> dict[str, np.ndarray]:
        found = {}
        for name, side, endless in (("lbx", 0, -np.inf), ("ubx", 1, np.inf)):
            both = np.full((self.count, self.nu + self.nx), endless)
            both[:, : self.nu] = s.u_limits[side]
            found[name] = np.concatenate([both.ravel(), np.full(self.ends, max(endless, 0.0))])
        return found

    def split(self, w: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x (N + 1, nx), u (N, nu) and the slack at the end of the variables."""
        rows, last = np.split(w, [self.variables - self.ends])
        both = rows.reshape(self.count, self.nu + self.nx)
        return np.vstack([first, both[:, self.nu :]]), both[:, : self.nu], last


def _entries(rows: np.ndarray, columns: np.ndarray, pattern: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and validity of each number of blocks; rows (n, a), columns (n, b), pattern (a, b)."""
    shape = (len(rows), *pattern.shape)
    row = np.broadcast_to(rows[:, :, None], shape).ravel()
    column = np.broadcast_to(columns[:, None, :], shape).ravel()
    return row, column, np.broadcast_to(pattern, shape).ravel() & (row >= 0) & (column >= 0)


def _compressed(
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]], shape: tuple[int, int]
) -> tuple[Any, np.ndarray]:
    """The sparsity of all blocks, and the number at each of its places, column by column."""
    row, column, valid = (np.concatenate([part[k] for part in parts]) for k in range(3))
    kept = np.flatnonzero(valid)
    order = kept[np.lexsort((row[kept], column[kept]))]
    starts = np.searchsorted(column[order], np.arange(shape[1] + 1))
    return casadi().Sparsity(*shape, starts.tolist(), row[order].tolist()), order


class QuadraticSolver:
    """HPIPM for programs of one layout: δx_0 and the numbers of the stages in, x and u out."""

    def __init__(self, layout: StageLayout):
        self.layout, self._near, self._far = layout, Hpipm(layout, "near"), None

    def __call__(self, stages: Stages, first: np.ndarray) -> Solved:
        """The solution, checked against the constraints; a failure is a sentence."""
        numbers = self.layout.numbers(stages, first)
        solver = self._near
        found, failure = solver(numbers)
        if failure:
            solver = self._far = self._far or Hpipm(self.layout, "far")
            found, failure = solver(numbers)
        x, u, last = self.layout.split(found, first)
        worst = np.inf if failure else violation(stages, x, u, last)
        return Solved(x, u, last, worst, failure, solver.multipliers)


class Hpipm:
    """CasADi's interface to HPIPM in one of the `MODES`, read and written through views of memory."""

    def __init__(self, layout: StageLayout, mode: str):
        n, nx, nu = layout.count, layout.nx, layout.nu
        given = {"inf": INF, "hpipm": MODES[mode], "error_on_fail": False, "print_time": False}
        sizes = {"nx": [0] + [nx] * n, "nu": [nu] * n, "ng": [layout.rows] * n + [layout.last_rows]}
        if layout.ends:  # CasADi knows no inputs of the last node: it gets a successor without numbers
            sizes = {"nx": sizes["nx"] + [0], "nu": sizes["nu"] + [layout.ends], "ng": sizes["ng"] + [0]}
        given |= {"N": len(sizes["nu"]), **sizes, "nu": sizes["nu"] + [0]}
        try:
            function = casadi().conic("controller", "hpipm", {"h": layout.h, "a": layout.a}, given)
        except RuntimeError as error:
            raise ArgumentError(f"CasADi cannot set up HPIPM for this problem: {str(error).splitlines()[-1]}") from None
        self._function, (self._buffer, self._evaluate) = function, function.buffer()
        arguments = ("h", "g", "a", "lba", "uba", "lbx", "ubx", "x0")
        self._numbers = {name: np.zeros(function.nnz_in(name)) for name in arguments}
        self._x = np.zeros(layout.variables)
        results = {"x": self._x}  # HPIPM writes all of its results, asked for or not
        results |= {name: np.zeros(function.nnz_out(name)) for name in ("cost", "lam_a", "lam_x")}
        self.multipliers = results["lam_a"]
        self._arguments = [(function.index_in(name), view(array)) for name, array in self._numbers.items()]
        self._results = [(function.index_out(name), view(array)) for name, array in results.items()]

    def __call__(self, numbers: dict[str, np.ndarray]) -> tuple[np.ndarray, str]:
        """The variables, and why they are not a solution, or an empty sentence."""
        for name, values in numbers.items():
            self._numbers[name][:] = values
        self._x[:] = 0.0
        for place, array in self._arguments:  # a call forgets their addresses
            self._buffer.set_arg(place, array)
        for place, array in self._results:
            self._buffer.set_res(place, array)
        try:
            self._evaluate()
        except (RuntimeError, SystemError) as error:
            return self._x, str(error).splitlines()[-1]
        if not np.all(np.isfinite(self._x)):
            return self._x, "the solver of the quadratic program returned no numbers"
        if not self._buffer.stats().get("success", False):
            return self._x, "the quadratic program has no solution that its solver could find"
        if np.max(np.abs(self._x)) > 0.5 * INF:
            return self._x, "the quadratic program leads beyond all bounds"
        return self._x.copy(), ""


def violation(s: Stages, x: np.ndarray, u: np.ndarray, last: np.ndarray) -> float:
    """The largest violation of the steps and limits of the stages by x, u and the slack at the end."""
    both = np.concatenate([x[:-1], u], axis=1)[:, :, None]
    worst = [np.abs((s.M @ both)[:, :, 0] + s.c - x[1:])]
    inside, end = (s.C @ both)[:, :, 0], s.last_C @ np.concatenate([x[-1], last])
    for values, (low, high) in ((inside, s.C_limits), (u, s.u_limits), (end, s.last_limits)):
        worst += [low - values, values - high]
    return float(max(np.max(excess, initial=0.0) for excess in worst))
