"""An entry of the catalogue of models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import TYPE_CHECKING

from coadjoint.arrays import PyTree
from coadjoint.extensions import import_string

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System


@dataclass(frozen=True)
class CatalogueEntry:
    """A model with its default parameters and its default initial state.

    `make` and `start` take what `parameters` and `initial` name; other names raise ArgumentError. Nothing of the model
    is imported before one of them is called. `maker`, `starter`: where the functions are, as "module:function".
    `dt`, `duration`: a step and a time, in s, that suit the defaults; `method`: the name of one that fits the model.
    """

    name: str
    description: str
    maker: str
    starter: str
    parameters: Mapping[str, PyTree] = field(hash=False)
    initial: Mapping[str, PyTree] = field(hash=False)
    dt: float
    duration: float
    method: str = "Midpoint"

    def __post_init__(self):
        for key in ("parameters", "initial"):
            object.__setattr__(self, key, MappingProxyType(dict(getattr(self, key))))

    def __reduce__(self) -> tuple[object, ...]:
        plain = {"parameters": dict(self.parameters), "initial": dict(self.initial)}
        return type(self), tuple(plain.get(one.name, getattr(self, one.name)) for one in fields(self))

    def make(self, **parameters: PyTree) -> System:
        """The system with these parameters in place of the defaults."""
        self._require_known(parameters, self.parameters, "parameter")
        return import_string(self.maker)(**{**self.parameters, **parameters})

    def start(self, system: System, **initial: object) -> State:
        """The state to start from, with these values in place of the defaults.

        Naming one way to give the attitude, or the angular velocity, replaces the default one.
        """
        self._require_known(initial, self.initial, "initial value")
        values = {**self.initial, **initial}
        for ways in _ALTERNATIVES:
            if any(initial.get(way) is not None for way in ways):
                values.update({way: initial.get(way) for way in ways if way in values})
        return import_string(self.starter)(system, **values)

    def _require_known(self, given: Mapping[str, object], known: Mapping[str, object], what: str) -> None:
        from coadjoint import checks  # which imports NumPy, and a listing of models does not

        for name in given:
            checks.known(name, known, what, f"Model `{self.name}`")


_ALTERNATIVES = (("rotation", "euler_zxz", "euler_zyx"), ("angular_velocity", "euler_rates"))


TURNING = {
    "rotation": None,
    "euler_zxz": None,
    "euler_zyx": None,
    "angular_velocity": (0.0, 0.0, 0.0),
    "euler_rates": None,
}
"""Initial values of a body that turns: its attitude and its angular velocity, each in one of several ways."""
MOVING = {"position": (0.0, 0.0, 0.0), "velocity": (0.0, 0.0, 0.0), **TURNING, "down": (0.0, 0.0, 1.0)}
"""Initial values of a body that moves in space, with gravity along `down`."""
UP = {**TURNING, "up": (0.0, 0.0, 1.0)}
"""Initial values of a body with one point fixed, with gravity against `up`."""
