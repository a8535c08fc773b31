"""Higher orders: energy of the paper's run at equal work, its course in time, and the fast heavy top to 1e-10."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import coadjoint as co
from benchmarks import bodies, peers
from benchmarks.clock import Contender, interleaved
from benchmarks.precision import Point, by_rk4, repeated
from benchmarks.problems import NODES, Problem, heavy_top, ready, vehicle
from coadjoint.kernels.chunk import Chunk

DURATION = 500.0
"""Of the paper's run, s."""

PAPER = "left rule, as in the paper"
TARGET = 1e-10
"""What the position of the fast heavy top at t = 2 s shall be off by, m."""

MIDPOINT, PAIR = co.Midpoint(co.Cayley()), co.methods.LeftRight(co.Cayley())
EQUAL_WORK: dict[str, tuple[co.methods.Method, int]] = {
    PAPER: (co.LeftRectangle(co.Cayley(), start="velocity"), 50_000),
    "midpoint": (MIDPOINT, 50_000),
    "Galerkin, order 4": (co.Galerkin(co.Cayley(), degree=2), 25_000),
    "Suzuki-4 (midpoint)": (co.Suzuki4(MIDPOINT), 50_000),
    "Kahan–Li-6 (midpoint)": (co.methods.KahanLi6(MIDPOINT), 50_000),
    "Sofroniou–Spaletta-6 (midpoint)": (co.methods.SofroniouSpaletta6(MIDPOINT), 50_000),
    "Kahan–Li-8 (midpoint)": (co.methods.KahanLi8(MIDPOINT), 50_000),
    "Sofroniou–Spaletta-8 (midpoint)": (co.methods.SofroniouSpaletta8(MIDPOINT), 50_000),
    "Sofroniou–Spaletta-10 (midpoint)": (co.methods.SofroniouSpaletta10(MIDPOINT), 50_000),
    "pair": (PAIR, 100_000),
    "Suzuki-4 (pair)": (co.Suzuki4(PAIR), 100_000),
    "Suzuki-4 (pair), 3/4 of the solves": (co.Suzuki4(PAIR), 75_000),
    "Kahan–Li-8 (pair)": (co.methods.KahanLi8(PAIR), 100_000),
    "Kahan–Li-8 (pair), twice the solves": (co.methods.KahanLi8(PAIR), 200_000),
}
"""Methods with the number of their single solves in 500 s."""

_EXP = co.Exponential()
TOP: dict[str, tuple[co.methods.Method, tuple[float, ...]]] = {
    "Suzuki-4 (pair)": (co.Suzuki4(co.methods.LeftRight(_EXP)), (5e-4, 2.5e-4)),
    "Kahan–Li-6 (pair)": (co.methods.KahanLi6(co.methods.LeftRight(_EXP)), (2e-3, 1e-3, 5e-4)),
    "Kahan–Li-8 (pair)": (co.methods.KahanLi8(co.methods.LeftRight(_EXP)), (1e-2, 5e-3, 4e-3)),
    "Sofroniou–Spaletta-10 (pair)": (co.methods.SofroniouSpaletta10(co.methods.LeftRight(_EXP)), (2e-2, 1e-2)),
    "Sofroniou–Spaletta-10 (midpoint)": (co.methods.SofroniouSpaletta10(co.Midpoint(_EXP)), (1e-2, 5e-3)),
    "Galerkin, order 8": (co.Galerkin(_EXP, degree=4), (4e-3, 2e-3)),
}
"""Methods with the steps at which they are tried on the top."""

OURS = tuple(TOP)


@dataclass(frozen=True)
class Case:
    """A method at its step on the vehicle, for the clock and for its energies."""

    name: str
    solves: int
    steps: int
    run: Callable[[int, int], Chunk]

    def course(self, nodes: int) -> np.ndarray:
        """Rows t, energy error, Kelvin–Noether error at so many nodes, ends included."""
        every = self.steps // nodes
        chunk = self.run(nodes, every)
        problem = vehicle()
        y = np.concatenate([problem.rows(chunk.records), problem.rows(chunk.final)[None]])
        return _course(problem, np.append(chunk.records.t, chunk.final.t), y)


def _course(problem: Problem, t: np.ndarray, y: np.ndarray) -> np.ndarray:
    energy, (momentum, _) = problem.body.energy(y), problem.body.momentum(y)
    return np.stack([t, np.abs(energy / energy[0] - 1), np.abs(momentum / momentum[0] - 1)], axis=1)


def measure(quick: bool) -> dict[str, Any]:
    """Errors and times of the paper's run, courses of its energy, and what 1e-10 on the top costs."""
    rows, courses = _vehicle(quick)
    found = {"vehicle": rows, "courses": {vehicle().title: courses, heavy_top().title: _top_courses(quick)}}
    return {**found, "top": _top(quick), "ours": OURS, "paper": PAPER}


def _vehicle(quick: bool) -> tuple[dict[str, Any], dict[str, Any]]:
    nodes = 100 if quick else 500
    cases = [_case(name, method, solves, nodes) for name, (method, solves) in EQUAL_WORK.items()]
    courses = {case.name: case.course(nodes) for case in cases}
    courses |= _others(nodes)
    timings = interleaved(
        {case.name: Contender(lambda case=case: case.run(1, case.steps)) for case in cases}, 3 if quick else 15
    )
    every_step = {case.name: np.max(case.course(case.steps), axis=0) for case in cases}
    rows = {
        case.name: {
            "solves": case.solves,
            "step": DURATION / case.steps,
            "energy": float(every_step[case.name][1]),
            "momentum": float(every_step[case.name][2]),
            "seconds": timings[case.name].median,
            "ratio": timings[case.name].ratio(timings[PAPER]),
        }
        for case in cases
    }
    return rows, {name: course.tolist() for name, course in courses.items()}


def _top_courses(quick: bool) -> dict[str, Any]:
    """Energy of the fast heavy top over 20 s (2 s) with steps of 1 ms."""
    problem = replace(heavy_top(), duration=2.0 if quick else 20.0)
    points = [_ours(name, problem, co.Midpoint(_EXP) if scheme is None else scheme(co.Midpoint(_EXP)), h)
              for name, scheme, h in (("midpoint", None, 1e-3), ("Suzuki-4 (midpoint)", co.Suzuki4, 5e-3),
                                      ("Kahan–Li-6 (midpoint)", co.methods.KahanLi6, 1e-2),
                                      ("Kahan–Li-8 (midpoint)", co.methods.KahanLi8, 1e-2))]  # fmt: skip
    points.append(by_rk4(problem, 1e-3))
    points.append(_by("DOP853, 1e-09", 1e-9, _dop853(problem, 1e-9)))
    if peers.version("mujoco"):
        for integrator in ("RK4", "implicit", "Euler"):
            points.append(Point(f"MuJoCo {integrator}", 1e-4, *peers.by_mujoco(problem, integrator, 1e-4, False)))
    with np.errstate(all="ignore"):
        return {p.name: _course(problem, problem.times, p.solve()).tolist() for p in points}


def _case(name: str, method: co.methods.Method, solves: int, nodes: int) -> Case:
    """Steps that need about `solves` single solves and are a multiple of the nodes."""
    steps = max(round(solves / len(method.stages) / nodes), 1) * nodes
    case = ready(vehicle(), method, DURATION / steps)
    return Case(name, steps * len(method.stages), steps, case.run)


def _others(nodes: int) -> dict[str, np.ndarray]:
    """Hand-written RK4 with the paper's step, DOP853 at two tolerances."""
    problem = vehicle()
    y, out, times = problem.y0.copy(), np.empty((nodes, 18)), np.linspace(0.0, DURATION, nodes + 1)
    bodies.rk4(problem.body.numbers, 0.01, y, nodes, round(DURATION / 0.01) // nodes, out)
    found = {"RK4 (numba)": _course(problem, times, np.concatenate([out, y[None]]))}
    for tolerance in (1e-6, 1e-9):
        rows = bodies.by_scipy(problem.body, problem.y0, times, "DOP853", tolerance, compiled=True)[0]
        found[f"DOP853, {tolerance:g}"] = _course(problem, times, rows)
    return found


def _top(quick: bool) -> list[dict[str, Any]]:
    """For every program, the settings that were tried with position errors at t = 2 s, and times."""
    problem = heavy_top()
    exact = problem.place(bodies.reference(problem.body, problem.y0, problem.times)[-1])
    points, rows = [], []
    for point in _points(problem, quick):
        error = float(np.linalg.norm(problem.place(point.solve()[-1]) - exact))
        if np.isfinite(error) and error < 1.0:
            points.append(point)
            rows.append({"name": point.name, "setting": point.setting, "error": error})
    timings = interleaved({str(i): repeated(point.timed) for i, point in enumerate(points)}, 1 if quick else 3)
    for i, row in enumerate(rows):
        row["seconds"] = timings[str(i)].median
    return rows


def _points(problem: Problem, quick: bool) -> Iterator[Point]:
    for name, (method, steps) in TOP.items():
        for h in steps[-1:] if quick else steps:
            yield _ours(name, problem, method, h)
    halvings = (5,) if quick else (2, 4, 5, 6, 7, 8)
    yield from (by_rk4(problem, problem.coarse / 2**k) for k in halvings)
    tolerances = (1e-9,) if quick else (1e-9, 1e-11, 1e-12, 1e-13)
    for tolerance in tolerances:
        yield _by("DOP853 (scipy, compiled)", tolerance, _dop853(problem, tolerance))
        if peers.version("diffrax"):
            solve = peers.by_diffrax(problem, "Dopri8", tolerance)
            yield _by("Dopri8 (diffrax)", tolerance, lambda solve=solve: solve()[0])
        if peers.version("lielab"):
            yield _by("Lielab, RKMK 8(7)", tolerance, peers.by_lielab(problem, tolerance))
    for k in (2, 4) if quick else (2, 4, 6, 7):
        h = problem.coarse / 2**k
        if peers.version("mujoco"):
            yield Point("MuJoCo RK4", h, *peers.by_mujoco(problem, "RK4", h, False))
        if peers.version("exudyn"):
            yield _by("Exudyn Lie-group RK4", h, peers.by_exudyn(problem, True, h))
    if peers.version("exudyn"):
        yield _by("Exudyn generalised-α", 1e-4, peers.by_exudyn(problem, False, 1e-4))


def _ours(name: str, problem: Problem, method: co.methods.Method, h: float) -> Point:
    every, case = round(problem.duration / h) // NODES, ready(problem, method, h)
    return Point(name, h, lambda: problem.path(case.run(NODES, every)), lambda: case.run(NODES, every))


def _by(name: str, setting: float, solve: Callable[[], np.ndarray]) -> Point:
    return Point(name, setting, solve, solve)


def _dop853(problem: Problem, tolerance: float) -> Callable[[], np.ndarray]:
    return lambda: bodies.by_scipy(problem.body, problem.y0, problem.times, "DOP853", tolerance, compiled=True)[0]


def cheapest(rows: list[dict[str, Any]], target: float = TARGET) -> dict[str, dict[str, Any] | None]:
    """For every program, its cheapest setting that is as accurate as `target`, None where none was."""
    found: dict[str, dict[str, Any] | None] = {row["name"]: None for row in rows}
    for row in rows:
        best = found[row["name"]]
        if row["error"] <= target and (best is None or row["seconds"] < best["seconds"]):
            found[row["name"]] = row
    return found
