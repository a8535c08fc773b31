"""Work and precision: energy and position error against computing time, on three problems."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import coadjoint as co
from benchmarks import bodies, peers
from benchmarks.clock import Contender, interleaved
from benchmarks.one import YARDSTICK, hand_written
from benchmarks.problems import NODES, Problem, ellipsoid, heavy_top, ready, vehicle

METHODS = {
    "left rule": co.LeftRectangle(co.Cayley()),
    "midpoint": co.Midpoint(co.Cayley()),
    "trapezoidal": co.Trapezoidal(co.Cayley()),
    "left–right pair": co.methods.LeftRight(co.Exponential()),
    "Suzuki-4 (midpoint)": co.Suzuki4(co.Midpoint(co.Cayley())),
    "Kahan–Li-8 (pair)": co.methods.KahanLi8(co.methods.LeftRight(co.Exponential())),
    "Galerkin, order 6": co.Galerkin(co.Exponential(), degree=3),
}
OURS = tuple(METHODS)
UNIT = 100_000
"""Steps of the hand-written loop that make the unit of time."""


@dataclass(frozen=True)
class Point:
    """One setting of one program: `solve` gives rows y at the nodes; `timed` does the same work for the clock."""

    name: str
    setting: float
    solve: Callable[[], np.ndarray]
    timed: Callable[[], object]


def measure(quick: bool) -> dict[str, Any]:
    """For each problem, each program's settings with their errors and times in steps of the hand-written loop."""
    found = {}
    for problem in (vehicle(), heavy_top(), ellipsoid()):
        exact = bodies.reference(problem.body, problem.y0, problem.times)
        points, rows = [], []
        for point in _points(problem, quick):
            errors = _errors(problem, point, exact)
            if errors is not None:
                points.append(point)
                rows.append({"name": point.name, "setting": point.setting, **errors})
        timings = _times(points, 1 if quick else 3)
        for row, seconds in zip(rows, timings, strict=True):
            row["time"] = seconds
        found[problem.title] = rows
    return {"problems": found, "ours": OURS}


def _errors(problem: Problem, point: Point, exact: np.ndarray) -> dict[str, float] | None:
    """None where the program failed or left the motion altogether."""
    try:
        with np.errstate(all="ignore"):
            path = point.solve()
            if path.shape != exact.shape or not np.all(np.isfinite(path)):
                return None
            errors = problem.errors(path, exact)
    except (RuntimeError, ValueError, co.errors.CoadjointError):
        return None
    scale = max(1.0, float(np.max(np.abs(problem.place(exact)))))
    return errors if errors["position"] < 30 * scale and errors["energy"] < 10 else None


def _times(points: list[Point], repetitions: int) -> list[float]:
    """Times in steps of the hand-written loop, measured in turns."""
    contenders = {str(i): repeated(point.timed) for i, point in enumerate(points)}
    contenders[YARDSTICK] = Contender(hand_written(vehicle(), UNIT, UNIT), UNIT)
    timings = interleaved(contenders, repetitions)
    return [timings[str(i)].ratio(timings[YARDSTICK]) for i in range(len(points))]


def repeated(timed: Callable[[], object]) -> Contender:
    """The work so often that the clock can tell."""
    timed()
    began = time.perf_counter()
    timed()
    count = min(max(int(0.005 / (time.perf_counter() - began)), 1), 50)

    def run() -> None:
        for _ in range(count):
            timed()

    return Contender(run, count)


def _points(problem: Problem, quick: bool) -> Iterator[Point]:
    halvings = range(0, 6, 3) if quick else range(9)
    tolerances = (1e-6,) if quick else (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
    for name, method in METHODS.items():
        for k in halvings:
            yield _ours(name, problem, method, problem.coarse / 2**k)
    for k in halvings:
        yield by_rk4(problem, problem.coarse / 2**k)
    for tolerance in tolerances:
        yield _adaptive("DOP853 (scipy, NumPy)", tolerance, _by_scipy(problem, tolerance, False))
        yield _adaptive("DOP853 (scipy, compiled)", tolerance, _by_scipy(problem, tolerance, True))
    if peers.version("diffrax"):
        for tolerance in tolerances:
            solve = peers.by_diffrax(problem, "Dopri8", tolerance)
            yield _adaptive("Dopri8 (diffrax)", tolerance, lambda solve=solve: solve()[0])
    if problem is not vehicle():
        yield from _multibody(problem, halvings)


def _ours(name: str, problem: Problem, method: co.methods.Method, h: float) -> Point:
    every, case = round(problem.duration / h) // NODES, ready(problem, method, h)

    def solve() -> np.ndarray:
        chunk = case.run(NODES, every)
        if chunk.code:
            raise RuntimeError("A step failed.")
        return problem.path(chunk)

    return Point(name, h, solve, lambda: case.run(NODES, every))


def by_rk4(problem: Problem, h: float) -> Point:
    """Hand-written RK4 with steps of h."""

    def solve() -> np.ndarray:
        y, out = problem.y0.copy(), np.empty((NODES, 18))
        bodies.rk4(problem.body.numbers, h, y, NODES, round(problem.duration / h) // NODES, out)
        return np.concatenate([out, y[None]])

    return Point("RK4 (numba)", h, solve, solve)


def _adaptive(name: str, tolerance: float, solve: Callable[[], np.ndarray]) -> Point:
    return Point(name, tolerance, solve, solve)


def _by_scipy(problem: Problem, tolerance: float, compiled: bool) -> Callable[[], np.ndarray]:
    return lambda: bodies.by_scipy(problem.body, problem.y0, problem.times, "DOP853", tolerance, compiled)[0]


def _multibody(problem: Problem, halvings: range) -> Iterator[Point]:
    """MuJoCo on both, Exudyn on the top; neither can hold the anisotropic mass of the vehicle."""
    fluid = problem is ellipsoid()
    if peers.version("mujoco"):
        for integrator in ("RK4", "implicit", "Euler"):
            for k in halvings:
                h = problem.coarse / 2**k
                yield Point(f"MuJoCo {integrator}", h, *peers.by_mujoco(problem, integrator, h, fluid))
    if peers.version("exudyn") and not fluid:
        for name, explicit in (("Exudyn Lie-group RK4", True), ("Exudyn generalised-α", False)):
            for k in halvings:
                path = peers.by_exudyn(problem, explicit, problem.coarse / 2**k)
                yield Point(name, problem.coarse / 2**k, path, path)
