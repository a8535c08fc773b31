"""What a system is apart from its numbers: the same in every process, where nothing else than the library made it."""

from __future__ import annotations

from typing import Any

from coadjoint.kernels.trace.identity import Traced
from coadjoint.mechanics.inputs import Inputs
from coadjoint.mechanics.internal_rule import InternalRule
from coadjoint.mechanics.signals import Signal
from coadjoint.mechanics.system import System

NUMBERS = ("parameters", "checks")
"""The fields of a system that say nothing of what its functions do."""
FUNCTIONS = ("lagrangian", "discrete_lagrangian", "group_lagrangian", "hamiltonian")


def parts(system: System) -> dict[str, Any]:
    """The parts of a system for `kernels.trace.identity`; what `mechanics.version` traces of it may be anybody's.

    Quantities may not: they are functions of a state, which has other fields at the start than in a record.
    """
    found = {name: getattr(system, name) for name in system.__dataclass_fields__ if name not in NUMBERS}
    for name in FUNCTIONS:
        if found[name] is not None:
            found[name] = Traced(found[name])
    if system.forces is not None:
        found["forces"] = system.forces.names, tuple(map(Traced, system.forces.functions))
    if system.internal is not None and not isinstance(system.internal, InternalRule):
        found["internal"] = Traced(system.internal)
    if system.inputs is not None:
        found["inputs"] = _sources(system.inputs)
    return found


def _sources(inputs: Inputs) -> tuple[Any, ...]:
    """Signals by their functions, and functions of the motion, under their names."""

    def part(source: Any) -> Any:
        if type(source) is Signal:
            return "signal", Traced(source.function)
        return source if isinstance(source, Signal) or not callable(source) else Traced(source)

    return inputs.names, tuple(map(part, inputs.sources))
