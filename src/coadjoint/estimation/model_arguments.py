"""Checks of the arguments of a model process: methods of fixed steps, flat spaces, noise of its forces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.estimation.drifts import not_negative
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method

WHOSE = "co.estimation.ModelProcess"


def sizes_of(shapes: Any) -> dict[str, int]:
    """Name → count of numbers, from (name, shape)."""
    return {name: int(np.prod(shape, dtype=int)) for name, shape in shapes}


def require_fit(method: Method, system: System, start: State, error: str) -> None:
    """Raise ArgumentError for methods, spaces and starts that a filter does not support."""
    checks.choice(error, f"Argument `error` of {WHOSE}", ("left", "right"))
    if method.variable or any(step.tolerant for step, _ in method.pattern):
        raise ArgumentError(f"A filter takes a method of fixed steps, such as co.Midpoint(), not {method.title}.")
    if method.start == "velocity":
        raise ArgumentError(
            f"A filter's states are given by momenta, but {method.title} starts from velocities: take co.Midpoint()."
        )
    if not system.additional.flat:
        raise ArgumentError("A filter needs a flat space of additional dynamics, such as co.Defining().")
    if np.ndim(start.t):
        raise ArgumentError("Argument `start` must be of one member: give `Filter` many covariances or starts instead.")


def roots_of_noise(given: Mapping[str, Any] | None, d: int, q: int) -> np.ndarray:
    """Roots of densities, (dim G + dim Q,)."""
    given, found = dict(given or {}), []
    for name, size in (("torque", d), ("force", q)):
        value = not_negative(given.pop(name, 0.0), name, "`noise`")
        checks.shape(value, f"`{name}` of `noise`", (), (size,))
        found.append(np.broadcast_to(value, (size,)))
    if given:
        raise ArgumentError(f"`noise` has `torque` and `force`, but no `{next(iter(given))}`.")
    return np.concatenate(found)
