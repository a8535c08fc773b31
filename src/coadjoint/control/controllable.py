"""Which problems predictive control can take, and its times as whole steps."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.control.inputs_between import Profile
from coadjoint.control.problem_data import ProblemData
from coadjoint.errors import ArgumentError, shown


def steps_of(value: Any, dt: float, name: str, least: int) -> int:
    """A time as whole steps; raises ArgumentError for another."""
    number = isinstance(value, (int, float, np.floating, np.integer)) and not isinstance(value, bool)
    count = round(value / dt) if number and np.isfinite(value) else -1
    if count < least or abs(count * dt - value) > 1e-9 * max(dt, abs(value)):
        raise ArgumentError(
            f"Argument `{name}` must be a whole number of steps of {dt:g} s{', at least one' if least else ''}, but is "
            f"{shown(value)}."
        )
    return count


def changing_names(problem: ProblemData, changing: Any) -> tuple[str, ...]:
    """The names of parameters that may change; raises ArgumentError for what are none."""
    names = (changing,) if isinstance(changing, str) else changing
    if not isinstance(names, (tuple, list)) or not all(isinstance(name, str) for name in names):
        raise ArgumentError(
            f'Argument `changing` must be names of parameters, such as ("mass",), not {shown(changing)}.'
        )
    for name in names:
        if not hasattr(problem.system.parameters, name):
            raise ArgumentError(f"Argument `changing` names `{name}`, which is no parameter of the system.")
    return tuple(names)


def require_controllable(problem: ProblemData) -> None:
    """Raise ArgumentError where a problem is none of a controller."""
    if problem.cost is None and problem.final_cost is None:
        raise ArgumentError("A controller needs something to make small: give the problem a `cost` or a `final_cost`.")
    if problem.free_duration is not None:
        raise ArgumentError("A controller looks ahead over a fixed time: leave out `free_duration`.")
    if problem.parameters:
        raise ArgumentError("A controller chooses inputs alone: leave out `parameters`; `changing` names those to set.")
    if problem.free_start or problem.measured:
        raise ArgumentError("A controller begins at the state that it is given: leave out `free_start` and `measured`.")
    if any(getattr(value, "course", "") == "linear" or isinstance(value, Profile) for value in problem.inputs.values()):
        raise ArgumentError(
            "A controller chooses inputs that are held over each step: leave out linear ones and profiles."
        )
    if not any(hasattr(value, "guess") for value in problem.inputs.values()):
        raise ArgumentError("A controller needs at least one co.control.Input(…) in `inputs`.")
