"""The solvers that come with CasADi, their settings, and the reasons of their failures."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import whole
from coadjoint.control.infeasible import resisting
from coadjoint.control.library import INTERRUPTED, IPOPT, casadi
from coadjoint.control.program import NonlinearProgram
from coadjoint.errors import ArgumentError, Interrupted, OptimumError

SOLVERS = ("ipopt", "fatrop")
"""Solvers of CasADi's wheel that are tested here."""

REASONS = {
    "Infeasible_Problem_Detected": "no motion satisfies all constraints near the end of the solver",
    "Maximum_Iterations_Exceeded": "the solver did not converge",
    "Maximum_CpuTime_Exceeded": "the solver did not converge in its time",
    "Restoration_Failed": "the solver found no way back to the constraints",
    "Diverging_Iterates": "the cost falls without bound",
    "Invalid_Number_Detected": "a function of the problem, or a derivative, is not finite at an iterate of the solver",
    "Not_Enough_Degrees_Of_Freedom": "there are more equations than numbers to choose: take more steps or inputs",
    "Error_In_Step_Computation": "the solver could make no step: is a function not smooth, such as |u| at 0?",
}
"""The meaning of IPOPT's statuses."""

INFEASIBLE = ("Infeasible_Problem_Detected", "Restoration_Failed", "Not_Enough_Degrees_Of_Freedom")
"""Its statuses for constraints that resist."""

ACCEPTABLE = "Solved_To_Acceptable_Level"
"""IPOPT's status for a solution below the requested tolerance."""


class Settings(NamedTuple):
    """A solver's name, its tolerance, and its options for CasADi."""

    solver: str
    tolerance: float
    options: dict[str, PyTree]


class FoundOptimum(NamedTuple):
    """The solution of a solver: x, f, g and the multipliers lam_g, lam_x; iterations, seconds, and its line in the
    summary; minimum: whether its last step needed no regularisation, as at a strict minimum."""

    numbers: dict[str, np.ndarray]
    iterations: int
    seconds: float
    words: str
    minimum: bool = True


def settings_of(
    solver: str, tolerance: float, max_iterations: int, verbose: bool, options: Mapping[str, PyTree] | None
) -> Settings:
    """The arguments of `Problem.solve` that are the solver's, checked."""
    checks.choice(solver, "solver", SOLVERS)
    fits = isinstance(tolerance, (int, float)) and 0 < tolerance < 1
    checks.expect(fits, tolerance, "tolerance", "a small positive number")
    found, more = _options(solver, tolerance, whole(max_iterations, "max_iterations"), verbose), dict(options or {})
    return Settings(solver, tolerance, found | more | {solver: found[solver] | dict(more.get(solver, {}))})


def solver_of(program: NonlinearProgram, settings: Settings) -> Any:
    """CasADi's function that solves a program."""
    parts = {"x": program.w, "f": program.f, "g": program.g} | ({} if program.p is None else {"p": program.p})
    try:
        return casadi().nlpsol("optimum", settings.solver, parts, settings.options)
    except RuntimeError as error:
        raise ArgumentError(
            f"CasADi cannot set up {settings.solver} for this problem: {str(error).splitlines()[-1]}"
        ) from None


def found_by(
    function: Any, program: NonlinearProgram, first: np.ndarray, settings: Settings, given: np.ndarray | None = None
) -> FoundOptimum:
    """The optimum from an initial guess, with the given numbers; raises OptimumError if there is none."""
    began = time.perf_counter()
    found = answer(function, program, first, given)
    seconds, stats, solver = time.perf_counter() - began, function.stats(), settings.solver
    if not stats["success"]:
        _explain(program if given is None else program.at(given), found, stats, settings.tolerance, first)
    numbers = {name: found[name].full().ravel() for name in ("x", "f", "g", "lam_g", "lam_x")}
    words = f"{solver}, to an acceptable level only" if stats.get("return_status") == ACCEPTABLE else solver
    shifts = stats.get("iterations", {}).get("regularization_size", [])
    minimum = not shifts or shifts[-1] == 0.0
    return FoundOptimum(numbers, int(stats.get("iter_count", 0)), seconds, words, minimum)


def answer(function: Any, program: NonlinearProgram, first: np.ndarray, given: np.ndarray | None) -> dict[str, Any]:
    """The results of CasADi's solver, whether it found an optimum or not; raises OptimumError where it stopped."""
    lower, upper = program.limits
    more = {} if given is None else {"p": given}
    try:
        return function(x0=first, lbx=program.bounds[0], ubx=program.bounds[1], lbg=lower, ubg=upper, **more)
    except (RuntimeError, SystemError) as error:
        if "KeyboardInterrupt" in f"{error} {error.__cause__!r}":
            raise Interrupted("Interrupted in the solver.") from None
        raise OptimumError(f"The solver stopped: {str(error).splitlines()[-1]}") from None


def _options(solver: str, tolerance: float, iterations: int, verbose: bool) -> dict[str, PyTree]:
    quiet: dict[str, object] = {
        "print_time": verbose,
        "record_time": True,
        "error_on_fail": False,
        "show_eval_warnings": False,
    }
    if solver == "ipopt":
        own = {"tol": tolerance, "constr_viol_tol": tolerance, "max_iter": iterations}
        return quiet | {"ipopt": IPOPT | own | {"print_level": 5 if verbose else 0}}
    own = {"tolerance": tolerance, "max_iter": iterations, "print_level": 5 if verbose else 0}
    return quiet | {"fatrop": own}


def _explain(program: NonlinearProgram, found: Any, stats: Any, tolerance: float, first: np.ndarray) -> None:
    """Raise OptimumError with the reason of the solver and the constraint that resists."""
    status = str(stats.get("return_status", "unknown"))
    if status in INTERRUPTED:
        raise Interrupted(f"Interrupted after {stats.get('iter_count', 0)} iterations of the solver.")
    reason = REASONS.get(status, f"the solver ended with “{status}”")
    what, excess = (resisting(program, first) if status in INFEASIBLE else None) or ("", 0.0)
    if excess <= tolerance:
        constraints = casadi().Function("g", [program.w], [program.g])
        what, excess = program.worst(constraints(found["x"]).full().ravel())
    resists = f"; most violated: {what}, by {excess:.3g}" if excess > tolerance else ""
    raise OptimumError(f"No optimum was found after {stats.get('iter_count', 0)} iterations: {reason}{resists}.")
