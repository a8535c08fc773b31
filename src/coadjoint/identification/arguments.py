"""What `identify` is given, checked before anything is traced."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError, shown
from coadjoint.identification.log import Log
from coadjoint.mechanics.system import System
from coadjoint.simulation.arguments import require_kinds


def require_arguments(system: Any, log: Any, start: Any, method: Any) -> None:
    """Raise ArgumentError unless these are a system, a log, a start of the system and a method."""
    if isinstance(inner := getattr(system, "system", None), System):
        raise ArgumentError(
            f"Argument `system` must be a co.System, but is {type(system).__name__}: give its `system`, of "
            f"{inner.name}."
        )
    if not isinstance(log, Log):
        raise ArgumentError(
            "Argument `log` must be a Log, as co.vehicles.logs.read_log(path) and co.identification.synthetic_log(run) "
            f"make, but is {shown(log)}."
        )
    require_kinds(system, start, method)


def require_numbers(**given: Any) -> None:
    """Raise ArgumentError for arguments, by their names, that are no number."""
    for name, value in given.items():
        if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
            raise ArgumentError(f"Argument `{name}` must be a number, but is {shown(value)}.")


def require_named(**given: Any) -> None:
    """Raise ArgumentError for arguments, by their names, that are not name → value."""
    for name, value in given.items():
        if not isinstance(value, Mapping):
            raise ArgumentError(f"Argument `{name}` must be name → value by columns of the log, but is {shown(value)}.")
