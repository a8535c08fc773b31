"""Copies of a system with something replaced, which is not checked again."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coadjoint.mechanics.parameters import Parameters
    from coadjoint.mechanics.system import System


def replaced(system: System, **values: Any) -> System:
    """A copy of the system with these attributes."""
    kind = type(system)
    made = object.__new__(kind)
    for name in kind.__dataclass_fields__:
        object.__setattr__(made, name, values[name] if name in values else getattr(system, name))
    return made


def replace_parameters(system: System, parameters: Parameters | None) -> System:
    """A copy of the system with these parameters; with None, its static skeleton."""
    return replaced(system, parameters=parameters)
