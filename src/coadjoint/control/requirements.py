"""Which problems predictive control and moving-horizon estimation accept."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.boundary_conditions import start_deviations
from coadjoint.control.inputs_between import Profile
from coadjoint.control.library import casadi
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import Input
from coadjoint.control.transcription import Transcription
from coadjoint.control.window import Window
from coadjoint.errors import ArgumentError, shown
from coadjoint.spaces.space import require_flat


def steps_of(value: Any, dt: float, name: str, least: int) -> int:
    """A time as a number of steps; raises ArgumentError unless it is a multiple of dt."""
    number = isinstance(value, (int, float, np.floating, np.integer)) and not isinstance(value, bool)
    count = checks.steps(float(value), dt, least) if number and np.isfinite(value) else None
    if count is None:
        raise ArgumentError(
            f"Argument `{name}` must be a whole number of steps of {float(dt)!r} s"
            f"{', at least one' if least else ''}, but is {shown(value)}."
        )
    return count


def require_controllable(problem: ProblemData) -> None:
    """Raise ArgumentError unless a problem suits a controller."""
    if problem.cost is None and problem.final_cost is None and problem.terminal is None:
        raise ArgumentError("A controller needs something to minimise: give the problem a `cost` or a `final_cost`.")
    checks.leave_out(
        problem.parameters, "`parameters`; `changing` names those to set", "A controller chooses inputs alone"
    )
    checks.leave_out(
        problem.free_start or problem.measured, "`free_start` and `measured`", "A controller begins at the given state"
    )
    if any(isinstance(value, Profile) for value in problem.inputs.values()):
        raise ArgumentError("A controller chooses inputs that are held or linear over each step: leave out profiles.")
    if not any(hasattr(value, "guess") for value in problem.inputs.values()):
        raise ArgumentError("A controller needs at least one co.control.Input(…) in `inputs`.")


def require_free_duration(problem: ProblemData, period: int, iterations: object, shortest: object) -> None:
    """Raise ArgumentError unless a problem suits a controller whose plans choose their durations."""
    least = (problem.free_duration or (0.0, 0.0))[0]
    if least <= (period + 1e-9) * problem.dt or period >= problem.count:
        raise ArgumentError(
            f"The shortest `free_duration` of a controller, {least:g} s, must exceed its period of "
            f"{period * problem.dt:g} s, whose steps keep their length: the last plans recede at this duration."
        )
    if iterations != 1 or shortest is not None:
        raise ArgumentError(
            "A controller with a `free_duration` solves each problem to its optimum, between its own bounds: leave out "
            "`iterations` and `shortest`."
        )


def require_estimable(problem: ProblemData, known: PyTree) -> None:
    """Raise ArgumentError unless a problem suits an estimator."""
    if not problem.measured:
        raise ArgumentError("An estimator needs measurements: give the problem `measured`.")
    checks.leave_out(problem.free_duration is not None, "`free_duration`", "An estimator looks back over a fixed time")
    checks.leave_out(problem.parameters, "`parameters`", "An estimator estimates states and inputs alone")
    checks.leave_out(
        any(one.soft for one in problem.path.values()), "`soft`", "An estimator keeps the bounds of its `path`"
    )
    if problem.end is not None or problem.final_cost is not None or problem.terminal is not None:
        raise ArgumentError("An estimator has no end to reach: leave out `end`, `final_cost` and `terminal`.")
    require_flat(problem.system.additional, "An estimator", "describe q by coordinates")
    chosen = {name: one for name, one in problem.inputs.items() if hasattr(one, "guess")}
    for name, one in chosen.items():
        if not isinstance(one, Input) or one.course != "held":
            raise ArgumentError(f"An estimator takes inputs that are held over each step, but `{name}` is none.")
        checks.leave_out(np.any(np.isfinite(one.rate)), f"`rate` of input `{name}`", "An estimator bounds no rates")
    checks.all_known(known, chosen, "co.control.Input", "Argument `known`: the problem")
    if set(chosen) - set(known) and problem.cost is None:
        raise ArgumentError(
            "An estimator needs a `cost` of the inputs that it estimates, such as 0.5 * w @ w / σ**2: without one any "
            "motion is as likely."
        )


def require_convex(window: Window) -> None:
    """Raise ArgumentError unless a cost grows with every disturbance, at the start and their guesses."""
    H = window.of_disturbances()
    if not len(H) or not np.all(np.isfinite(H)):
        return
    units = np.sqrt(np.abs(np.diag(H)))
    units = np.where(units > 0, units, 1.0)
    values, vectors = np.linalg.eigh(H / units / units[:, None])
    if values[0] > 1e-12:
        return
    place = window.free[int(np.argmax(np.abs(vectors[:, 0])))]
    name = next(one.name for one in window.transcription.columns if one.begin.start <= place < one.begin.stop)
    raise ArgumentError(
        f"The `cost` of an estimator must grow as a square with every number of input `{name}`, as 0.5 * w @ w / σ**2 "
        "does, but at the start its second derivatives by it are not positive: add such a term, or name the input in "
        "`known` and give it with every call."
    )


def prior_directions(transcription: Transcription, x: np.ndarray, inverse: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(K, 1/σ²): how the directions of the first node change with η of the start, by columns, to first order."""
    sizes = transcription.sizes
    if not transcription.eta:
        return np.zeros((len(inverse), 0)), np.zeros(0)
    ca, function = casadi(), transcription.functions.start
    slopes = function.factory("slopes", function.name_in(), ["jac:start:x", "jac:start:p"])
    p = transcription.numbers(np.zeros(sizes[3]))
    of_x, of_p = (m.full() for m in slopes(x, np.zeros(sizes[1]), p, ca.DM(transcription.problem.dt)))
    of_eta = of_p[:, -len(transcription.eta) :]
    changes = np.linalg.lstsq(of_x, -of_eta, rcond=None)[0]
    return inverse @ changes, 1.0 / start_deviations(transcription.problem) ** 2
