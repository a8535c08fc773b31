"""Copies of a system with some attributes replaced, which are not checked again."""

from __future__ import annotations

from typing import Any, TypeVar

from coadjoint.arrays import PyTree
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.reduced_functions import ReducedFunctions

S = TypeVar("S", bound=ReducedFunctions)


def replaced(system: S, **values: PyTree) -> S:
    """A copy of the system with these attributes."""
    kind: Any = type(system)
    made = object.__new__(kind)
    for name in kind.__dataclass_fields__:
        object.__setattr__(made, name, values[name] if name in values else getattr(system, name))
    return made


def replace_parameters(system: S, parameters: Parameters | None) -> S:
    """A copy of the system with these parameters; with None, its static skeleton."""
    return replaced(system, parameters=parameters)
