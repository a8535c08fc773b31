"""One trajectory on one core: time per step and energy error of each path, beside the hand-written loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

import coadjoint as co
from benchmarks import bodies, kernels_yardstick, peers
from benchmarks.clock import Contender, interleaved, table_of
from benchmarks.problems import NODES, Problem, Ready, heavy_top, ready, vehicle
from coadjoint.kernels.packing import pack
from coadjoint.kernels.run import native, xla
from coadjoint.simulation.problem import SimulationProblem

YARDSTICK = "hand-written, numba: left rule"
H, STEPS = 0.01, 50_000
"""The paper's step, s, and number of steps."""
EVERY = 1000
PAPER = co.LeftRectangle(co.Cayley(), start="velocity")


@dataclass
class Row:
    """A contender, and what is known about it besides its time."""

    contender: Contender
    facts: dict[str, Any] = field(default_factory=dict)


def hand_written(problem: Problem, steps: int, save_every: int) -> Callable[[], tuple[np.ndarray, int]]:
    """The hand-written loop from the paper's start: rows of 28 numbers (records, then the final state), iterations."""
    s = PAPER.begin(problem.system, problem.start, H)
    first = np.concatenate([np.ravel(x) for x in (s.t, s.g, s.n, s.a, s.mu, s.pi, s.xi, s.nu)])
    numbers, records = problem.body.numbers, steps // save_every

    def run() -> tuple[np.ndarray, int]:
        state, out = first.copy(), np.empty((records, 28))
        _, iterations = kernels_yardstick.run(numbers, H, state, records, save_every, out)
        return np.concatenate([out, state[None]]), iterations

    return run


def rows_of_hand(problem: Problem, found: np.ndarray) -> np.ndarray:
    """Rows y from those of the hand-written loop."""
    R, n = found[:, 1:10].reshape(-1, 3, 3), found[:, 10:13]
    omega, nu = found[:, 16:19] / np.array(problem.body.inertia), found[:, 19:22] / np.array(problem.body.mass)
    return np.concatenate([found[:, 1:10], np.einsum("tij,tj->ti", R, n), omega, nu], axis=1)


def measure(quick: bool) -> dict[str, Any]:
    """Rows by name: seconds per step, ratio to the hand-written loop, energy error over the run, iterations a step."""
    times = 2 if quick else 6
    rows = {**_left_rule(vehicle(), times), **_methods(times), **_libraries(quick), **_others(quick)}
    timings = interleaved({name: row.contender for name, row in rows.items()}, 5 if quick else 21)
    missing = [name for name in ("diffrax", "mujoco", "exudyn") if peers.version(name) is None]
    table = table_of(timings, YARDSTICK)
    return {
        "rows": {name: {**table[name], **row.facts} for name, row in rows.items()},
        "missing": missing,
        "versions": {name: peers.version(name) for name in ("numba", "scipy", "jax", "diffrax", "mujoco", "exudyn")},
    }


def _left_rule(problem: Problem, times: int) -> dict[str, Row]:
    """The paper's run by hand, natively and by XLA; what saving and watching cost."""
    by_hand, every = hand_written(problem, STEPS, EVERY), hand_written(problem, STEPS, 1)
    method = ready(problem, PAPER, H)
    watched = (
        SimulationProblem(problem.system, problem.start, PAPER, H, STEPS, EVERY, monitors=True, backend="native")
        .set_up()
        .plan
    )
    start = ready(problem, PAPER, H).state
    observed = Ready(watched.program, watched.constants, start, H)

    def monitored(ready: Ready) -> object:
        return native.run(ready.program, ready.constants, ready.state, H, STEPS // EVERY, EVERY, monitors=True)

    def by_xla(steps: int) -> Any:
        return xla.run(method.program, method.constants, method.state, H, 1, steps, monitors=False)

    found, iterations = hand_written(problem, STEPS, STEPS // NODES)()
    hand = {"energy": _energy(problem, rows_of_hand(problem, found)), "iterations": iterations / STEPS}
    chunk = method.run(NODES, STEPS // NODES)
    ours = {"energy": _energy(problem, problem.path(chunk)), "iterations": chunk.iterations / STEPS}
    return {
        YARDSTICK: Row(_repeated(by_hand, times), hand),
        "hand-written, numba: left rule, every step saved": Row(_repeated(every, times), hand),
        "native: one step, a call": Row(_repeated(lambda: method.run(1, 1), 100, 1)),
        "native: left rule": Row(_repeated(lambda: method.run(STEPS // EVERY, EVERY), times), ours),
        "native: left rule, every step saved": Row(_repeated(lambda: method.run(STEPS, 1), times), ours),
        "native: left rule, every step saved, before it is unpacked": Row(
            _repeated(lambda: _launch(method, STEPS), times)
        ),
        "native: left rule, all monitors": Row(_repeated(lambda: monitored(observed), times), ours),
        "XLA: left rule": Row(Contender(lambda: by_xla(5000), 5000), ours),
    }


def _repeated(run: Callable[[], object], times: int, steps: int = STEPS) -> Contender:
    """A run of `steps` steps so many times over: what a call costs is counted as often."""

    def runs() -> None:
        for _ in range(times):
            run()

    return Contender(runs, times * steps)


def _launch(method: Ready, records: int) -> object:
    """The machine code alone, with memory of its own for the records."""
    (_, p), (_, s) = pack(method.constants), pack(method.state)
    kernel = native.compile(method.program, method.constants, method.state, monitors=False)
    return native.launch(kernel, p[:, None], np.full(1, method.h), s[:, None], records, 1)


def _methods(times: int) -> dict[str, Row]:
    """The other rules on the vehicle, and the heavy top, natively."""
    top = heavy_top()
    cases = [
        ("left rule, exponential", vehicle(), co.LeftRectangle(co.Exponential(), start="velocity"), H),
        ("midpoint", vehicle(), co.Midpoint(), H),
        ("left–right pair", vehicle(), co.methods.LeftRight(), H),
        ("trapezoidal", vehicle(), co.Trapezoidal(), H),
        ("Suzuki-4 over midpoint", vehicle(), co.Suzuki4(co.Midpoint()), H),
        ("heavy top, left rule", top, co.LeftRectangle(), 1e-4),
        ("heavy top, midpoint", top, co.Midpoint(), 1e-4),
        ("heavy top, left–right pair", top, co.methods.LeftRight(), 1e-4),
    ]
    found = {}
    for name, problem, method, h in cases:
        case = ready(problem, method, h)
        whole = STEPS if problem is vehicle() else round(problem.duration / h)
        chunk = case.run(NODES, whole // NODES)
        facts = {"energy": _energy(problem, problem.path(chunk)), "iterations": chunk.iterations / whole}
        contender = _repeated(lambda case=case, whole=whole: case.run(whole // EVERY, EVERY), times, whole)
        found[f"native: {name}"] = Row(contender, facts)
    return found


def _libraries(quick: bool) -> dict[str, Row]:
    """Library integrators on the vehicle: errors over the paper's 500 s, times over 50 s; a step is one of theirs."""
    problem, found = vehicle(), {}
    duration, whole = 50.0, 50.0 if quick else H * STEPS
    for method, compiled in (("DOP853", False), ("RK45", False), ("DOP853", True)):

        def run(duration: float, method: str = method, compiled: bool = compiled) -> tuple[np.ndarray, float]:
            times = np.linspace(0.0, duration, NODES + 1)
            return bodies.by_scipy(problem.body, problem.y0, times, method, 1e-9, compiled)

        path, (_, steps) = run(whole)[0], run(duration)
        of = "right-hand side by numba" if compiled else "NumPy"
        facts = {"energy": _energy(problem, path), "step": duration / steps}
        found[f"scipy {method}, {of}, tolerance 1e-9"] = Row(Contender(partial(run, duration), steps), facts)

    def rk4(steps: int = 20_000) -> np.ndarray:
        y, out = problem.y0.copy(), np.empty((NODES, 18))
        bodies.rk4(problem.body.numbers, H, y, NODES, steps // NODES, out)
        return np.concatenate([out, y[None]])

    found["hand-written, numba: RK4"] = Row(Contender(rk4, 20_000), {"energy": _energy(problem, rk4(STEPS))})
    return found


def _others(quick: bool) -> dict[str, Row]:
    """diffrax on the vehicle; MuJoCo and Exudyn, which cannot hold its added mass, on the heavy top."""
    found: dict[str, Row] = {}
    if peers.version("diffrax"):
        for solver in ("Dopri8", "Tsit5"):
            run = peers.by_diffrax(vehicle(), solver, 1e-9)
            path, steps = run()
            facts = {"energy": _energy(vehicle(), path), "step": vehicle().duration / steps}
            found[f"diffrax {solver}, tolerance 1e-9"] = Row(Contender(run, steps), facts)
    top, h = heavy_top(), 1e-4
    if peers.version("mujoco"):
        for integrator in ("RK4", "implicit"):
            path, whole = peers.by_mujoco(top, integrator, h, fluid=False)
            facts = {"energy": _energy(top, path())}
            found[f"MuJoCo {integrator}: heavy top"] = Row(Contender(whole, top.duration / h), facts)
    if peers.version("exudyn"):
        for name, explicit in (("Lie-group RK4", True), ("generalised-α", False)):
            path = peers.by_exudyn(top, explicit, h)
            found[f"Exudyn {name}: heavy top"] = Row(
                Contender(path, top.duration / h), {"energy": _energy(top, path())}
            )
    return found


def _energy(problem: Problem, path: np.ndarray) -> float:
    energy = problem.body.energy(path)
    return float(np.max(np.abs(energy / energy[0] - 1)))
