"""A mass that a motor moves along a line in the hull."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.mechanics import Course
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.bounded_travel import BoundedTravel
from coadjoint_vehicles.parts.measured import Measured, lag_or_none, measured, place, way
from coadjoint_vehicles.parts.part import towards


@dataclass(frozen=True, eq=False)
class MovingMass(BoundedTravel):
    """A point mass m at r + x e, which ℓ has as ½m|ν + ω × (r + x e) + ẋ e|² + m g depth, beyond the mass of the body.

    Over each step ℓ has the mass at its mean place and at its mean speed: centre of mass, inertia and the momentum
    of the mass that runs are in ℓ, momenta are continuous where ẋ changes, and so the hull recoils as it must. The
    motor's work is the ledger's ΔH at the nodes. Its internal state is `position`, x, m, and `speed`, ẋ, m/s.

    mass: m, kg. position: r, (3,) m. axis: e, unit vector (3,). low, high: the range of x, m. rate: largest |ẋ|, m/s.
    lag: τ, s, with which it comes to its command, none if left out. Commanded by x. Raises ArgumentError.
    """

    kind: ClassVar[str] = "moving_mass"
    unit: ClassVar[str] = "m"
    mass: Measured = measured(u.MASS, positive)
    position: Measured = place()
    axis: Measured = way()
    low: Measured = measured(u.LENGTH)
    high: Measured = measured(u.LENGTH)
    rate: Measured = measured(u.SPEED, positive)
    lag: Measured = measured(u.TIME, lag_or_none, default=None)

    @property
    def units(self) -> dict[str, str]:
        return {"position": "m", "speed": "m/s"}

    def at_rest(self, where: object) -> dict[str, PyTree]:
        return {"position": where, "speed": 0.0}

    def advance(self, actual: PyTree, command: Array, h: Scalar, own: Named) -> dict[str, PyTree]:
        found = towards(actual.position, wanted := self.wanted(command, own), h, own)
        begin, end = (self._speed(wanted - x, own) for x in (actual.position, found.end))
        return {"position": found, "speed": Course(end, (found.end - actual.position) / h, begin)}

    def _speed(self, gap: Array, own: Named) -> Array:
        """ẋ = clip((wanted − x)/τ, ±rate)."""
        if "lag" not in own:
            return own.rate * jnp.sign(gap)
        late = own.lag > 0
        slow = jnp.clip(gap / jnp.where(late, own.lag, 1.0), -own.rate, own.rate)
        return jnp.where(late, slow, own.rate * jnp.sign(gap))

    def lumps(self, actual: PyTree, own: Named) -> tuple[tuple[Array, Array, Array], ...]:
        return ((own.mass, own.position + actual.position * own.axis, actual.speed * own.axis),)
