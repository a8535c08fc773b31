"""Water: its current and its density, in place and time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.models.quantities import vector
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.numbers import Numbers

STRATIFIED = "A water with its own density gives both `density` and `pressure_head`, but `{}` has no `{}`."


@dataclass(frozen=True, eq=False)
class Water(Numbers, ABC):
    """The water around a craft. Axes of the space frame: north, east, down.

    Fields that hold numbers are parameters: `velocity` of a water is `p.water.velocity` of the system, and its methods
    get `p.water` as `own`.
    """

    uniform = True
    """Whether the current is the same everywhere."""
    steady = True
    """Whether it never changes at a place."""

    @property
    def timed(self) -> bool:
        """Whether the current depends on t itself, beyond its internal state."""
        return not self.steady and not self.start()

    @property
    def stratified(self) -> bool:
        """Whether its density is its own, and not that of the vehicle."""
        own = type(self)
        return own.density is not Water.density or own.pressure_head is not Water.pressure_head

    def start(self) -> dict[str, PyTree]:
        """The internal state of the water at the start, as of a random current; {} if it has none."""
        return {}

    def seeded(self, seed: object) -> Water:
        """The same water with random numbers of another seed, or co.each of seeds; unchanged if it is not random."""
        return self

    def advance(self, internal: Named, h: Scalar, own: Named) -> dict[str, PyTree]:
        """The internal state after h."""
        return {}

    @abstractmethod
    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        """c(q, t), the velocity of the water, (3,) m/s."""

    def density(self, depth: Array, own: Named) -> Array:
        """ρ, kg/m³, of water that is `stratified`; where a class has none, it is the vehicle's."""
        raise ArgumentError(STRATIFIED.format(type(self).__name__, "density"))

    def pressure_head(self, depth: Array, own: Named) -> Array:
        """∫₀^depth ρ dz, kg/m², of water that is `stratified`: in buoyancy it is multiplied by g and the volume."""
        raise ArgumentError(STRATIFIED.format(type(self).__name__, "pressure_head"))


@dataclass(frozen=True, eq=False)
class UniformWater(Water):
    """The same steady current everywhere. velocity: (3,) m/s, north, east, down; still by default."""

    velocity: Any = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "velocity", vector(self.velocity, "velocity"))

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        return own.velocity


def StillWater() -> UniformWater:
    """Water without a current."""
    return UniformWater(np.zeros(3))
