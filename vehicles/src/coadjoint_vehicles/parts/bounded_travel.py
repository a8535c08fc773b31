"""Actuators that travel between two ends at a bounded rate: masses on a line, volumes of a bladder."""

from __future__ import annotations

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.mechanics import Force
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.part import Command, Flow, Part, towards


class BoundedTravel(Part):
    """An actuator x between `low` and `high`, |ẋ| ≤ `rate`, with a `lag`, that acts through ℓ,
    not by a force. unit: that of x."""

    unit: ClassVar[str]
    low: Any
    high: Any

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low >= self.high:
            raise ArgumentError(
                f"Argument `low` of the {self.title}` must be below `high`, but low is {self.low:g} and high "
                f"{self.high:g}."
            )

    @property
    def command(self) -> Command:
        return Command(self.unit, start=float(np.clip(0.0, self.low, self.high)))

    def wanted(self, command: Array, own: Named) -> Array:
        """Where it goes: clip(command, low, high)."""
        return jnp.clip(command, own.low, own.high)

    def advance(self, actual: PyTree, command: Array, h: Scalar, own: Named) -> PyTree:
        """x over h, co.mechanics.Course: ẋ = clip((wanted − x)/τ, ±rate), exact for a command that is held."""
        return towards(actual, self.wanted(command, own), h, own)

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        return Force()
