"""Checks of the arguments of `simulate` and `trajectory`, before anything runs."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError, shown
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics import quantities
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import require_scalar
from coadjoint.methods.method import Method
from coadjoint.simulation.without_g import read_of
from coadjoint.spaces.numbers import float64

MOST = 2**53
"""Up to here every whole number is a float64, so that times of nodes are distinct."""


def require_kinds(system: Any, start: Any, method: Any) -> None:
    """Raise ArgumentError unless these are a system, a start of it and a method."""
    if not isinstance(system, System):
        raise ArgumentError(f"Argument `system` must be a co.System, but is {type(system).__name__}.")
    if not isinstance(start, State):
        raise ArgumentError(f"Argument `start` must come from system.state(…), but is {type(start).__name__}.")
    if start.places != system.places:
        raise ArgumentError("Argument `start` belongs to a system with another group or other spaces.")
    if not isinstance(method, Method):
        raise ArgumentError(f"Argument `method` must be a method such as co.Midpoint(), but is {shown(method)}.")


def require_quantities(system: System, state: State) -> None:
    """Raise ArgumentError where a quantity has a name that a dataset has already; LagrangianError unless a number."""
    from coadjoint.simulation.dataset import reserved

    for name, function in system.quantities:
        if name in reserved(system) or name.startswith(("work_", "inputs_", "internal_")):
            raise ArgumentError(
                f"The quantity `{name}` must have a name of its own: datasets have a variable `{name}`."
            )
        what = f"The quantity `{name}`"
        value = partial(quantities.value, system, function)
        read_of(lambda state, value=value, what=what: require_scalar(value, what, (state,)), what, state)


def whole(value: Any, name: str) -> int:
    """A whole number of at least 1; raises ArgumentError."""
    if isinstance(value, (bool, np.timedelta64)) or not isinstance(value, (int, np.integer)) or value < 1:
        raise ArgumentError(f"Argument `{name}` must be a whole number of at least 1, but is {shown(value)}.")
    if value > MOST:
        raise ArgumentError(f"Argument `{name}` must be at most 2⁵³ = {MOST}, but is {shown(value)}.")
    return int(value)


def truth(value: Any, name: str) -> bool:
    """True or False; raises ArgumentError for what only counts as one of them."""
    if not isinstance(value, (bool, np.bool_)):
        raise ArgumentError(f"Argument `{name}` must be True or False, but is {shown(value)}.")
    return bool(value)


def positive(value: Any, name: str) -> float:
    """A positive, finite number; raises ArgumentError."""
    number = isinstance(value, (int, float, np.floating, np.integer)) and not isinstance(value, (bool, np.timedelta64))
    if not number or not 0 < value < np.inf:
        raise ArgumentError(f"Argument `{name}` must be positive, but is {shown(value)}.")
    return float(float64(value, f"Argument `{name}`"))


def step_size(dt: Any) -> Any:
    """A step of a trajectory: one number, traced or finite, not zero; negative ones go back in time."""
    h = float64(dt, "Argument `dt`")
    if np.shape(h) != ():
        raise ArgumentError(f"Argument `dt` must be one number, but has shape {np.shape(h)}.")
    if not traced(h) and h == 0:
        raise ArgumentError("Argument `dt` must not be zero: the steps would go nowhere.")
    return h


def grid(dt: Any, duration: Any, steps: Any) -> tuple[float, int]:
    """The step size and the number of steps of a run; raises ArgumentError."""
    h = positive(dt, "dt")
    if (duration is None) == (steps is None):
        raise ArgumentError("Give either `duration` or `steps`, one of them.")
    if steps is not None:
        return h, whole(steps, "steps")
    duration = positive(duration, "duration")
    count = round(duration / h)
    if count < 1 or abs(count * h - duration) > 1e-9 * duration:
        raise ArgumentError(
            f"Argument `duration` must be a whole number of steps, but {duration} s is {duration / h:.6g} steps of "
            f"{h} s; give duration={max(count, 1) * h:.10g}."
        )
    if count > MOST:
        raise ArgumentError(f"Argument `duration` must be at most 2⁵³ steps, but {duration} s is {count:.3g} of {h} s.")
    return h, count
