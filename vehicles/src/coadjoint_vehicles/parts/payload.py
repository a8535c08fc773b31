"""A mass that a vehicle carries until it is dropped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.mechanics import Force, jumped
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative, place
from coadjoint_vehicles.parts.part import Command, Flow, Part, Passing


@dataclass(frozen=True, eq=False)
class Payload(Part):
    """A point mass m at r, with a volume V, beyond those of the body, until its command is 1: then both are gone.

    No velocity changes at the node where it is dropped: ∂ℓ/∂ν and ∂ℓ/∂ξ lose m v_r and r × m v_r, v_r that of the
    point. ℓ, whose momenta are continuous, keeps the lost momentum as P·(R(ν + ω × r)), P = R m v_r fixed in space: a
    derivative by time, which moves nothing. So μ and π keep the momentum of the dropped payload, and the energy loses
    ½m|v_r|² − m g depth + V g ∫₀^depth ρ dz, which is the ledger's ΔH. The payload's own motion is not followed.
    Its internal state is `dropped`, 0 or 1, and `momentum`, P, N s.

    mass: m, kg. position: r, (3,) m. volume: V, m³, 0 unless given. Commanded by 0, held, and 1, from 0.5 on dropped,
    for good. Raises ArgumentError. Source: the momentum that leaves with a part of the mass, Euler's laws for both.
    """

    kind: ClassVar[str] = "payload"
    mass: Measured = measured(u.MASS, positive)
    position: Measured = place()
    volume: Measured = measured(u.VOLUME, not_negative, default=0.0)

    @property
    def command(self) -> Command:
        return Command("1")

    @property
    def units(self) -> dict[str, str]:
        return {"dropped": "1", "momentum": "N s"}

    def at_rest(self, where: object) -> dict[str, PyTree]:
        return {"dropped": where, "momentum": np.zeros(3)}

    def follow(self, actual: PyTree, command: Array, h: Scalar, own: Named, passing: Passing) -> PyTree:
        going = (command >= 0.5) & (actual.dropped < 0.5)
        velocity = passing.turn @ (passing.velocity + jnp.cross(passing.omega, own.position))
        return {
            "dropped": jumped(jnp.where(going, 1.0, actual.dropped)),
            "momentum": jumped(jnp.where(going, own.mass * velocity, actual.momentum)),
        }

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        return Force(torque=jnp.zeros(3), force=jnp.zeros(3))

    def lumps(self, actual: PyTree, own: Named) -> tuple[tuple[Array, Array, Array], ...]:
        return (((1 - actual.dropped) * own.mass, own.position, jnp.zeros(3)),)

    def displaced(self, actual: PyTree, own: Named) -> tuple[tuple[Array, Array], ...]:
        return (((1 - actual.dropped) * own.volume, own.position),)

    def released(self, actual: PyTree, own: Named) -> tuple[tuple[Array, Array], ...]:
        return ((actual.momentum, own.position),)
