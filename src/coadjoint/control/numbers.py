"""Numbers that a user gave."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, shown
from coadjoint.mechanics.system import System


def number(value: Any, name: str, nan: bool = False) -> np.ndarray:
    """A number or an array of them, with NaN if that is allowed; raises ArgumentError for anything else."""
    try:
        found = np.asarray(np.nan if np.iscomplexobj(value) else value, float)
    except (TypeError, ValueError):
        raise ArgumentError(f"Argument `{name}` must be numbers, but is {shown(value)}.") from None
    checks.expect(not np.iscomplexobj(value) and (not np.any(np.isnan(found)) or nan), value, name, "numbers")
    return found


def spread(value: object, shape: tuple[int, ...], name: str, what: str = "an input") -> np.ndarray:
    """A number as an array of this shape; raises ArgumentError for other shapes."""
    found = number(value, name)
    if name == "guess":
        float64(found, f"Argument `guess` of {what}")
    try:
        return np.broadcast_to(found, shape).copy()
    except ValueError:
        raise ArgumentError(f"Argument `{name}` of {what} must be a number or have the shape {shape}.") from None


def known_parameter(system: System, name: object) -> None:
    """Raise ArgumentError unless a name is that of a parameter of the system."""
    names = [] if system.parameters is None else [*system.parameters.asdict()]
    checks.known(name, names, "parameter", "The system")


def shortest_and_longest(given: Any, name: str) -> tuple[float, float]:
    """Bounds of a duration, s; raises ArgumentError unless they are positive, finite and in order."""
    pair = isinstance(given, (tuple, list)) and len(given) == 2
    low, high = (float(number(one, name)) for one in given) if pair else (0.0, 0.0)
    checks.expect(0 < low <= high < math.inf, given, name, "(shortest, longest) in s, positive and finite")
    return low, high


def require_between(lower: np.ndarray, upper: np.ndarray, what: str) -> None:
    """Raise ArgumentError if no value lies between two bounds."""
    try:
        above = np.any(lower > upper)
    except ValueError:
        raise ArgumentError(f"The bounds of {what} have shapes {lower.shape} and {upper.shape}.") from None
    if above or np.any(lower == math.inf) or np.any(upper == -math.inf):
        raise ArgumentError(f"Nothing lies between the bounds of {what}, {lower.tolist()} and {upper.tolist()}.")
