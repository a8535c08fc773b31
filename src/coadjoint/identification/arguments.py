"""Checks of the arguments of `identify`, before anything is traced."""

from __future__ import annotations

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.identification.log import Log
from coadjoint.mechanics.system import System
from coadjoint.simulation.arguments import require_kinds


def require_arguments(system: System, log: object, start: PyTree, method: object) -> None:
    """Raise ArgumentError unless these are a system, a log, a start of the system and a method."""
    if isinstance(inner := getattr(system, "system", None), System):
        raise ArgumentError(
            f"Argument `system` must be a co.System, but is {type(system).__name__}: give its `system`, of "
            f"{inner.name}."
        )
    checks.instance(
        log, "log", Log, "a Log, as co.vehicles.logs.read_log(path) and co.identification.synthetic_log(run) make"
    )
    require_kinds(system, start, method)
