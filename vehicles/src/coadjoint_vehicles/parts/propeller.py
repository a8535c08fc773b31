"""A propeller whose thrust and torque fall linearly with its advance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import PyTree
from coadjoint.mechanics import Force
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative, numbers, place, share, way
from coadjoint_vehicles.parts.part import Command, Flow, Part


@dataclass(frozen=True, eq=False)
class Propeller(Part):
    """T = e(1 − t)ρD⁴(K_T0 n|n| + K_T1 |n| V_a/D) along its axis, and e k ρD⁵(K_Q0 n|n| + K_Q1 |n| V_a/D) about it.

    V_a = (1 − w) max(u, 0) of the velocity u of its place along its axis, and V_a = 0 where n < 0.

    diameter: D, m. thrust: (K_T0, K_T1). torque: (K_Q0, K_Q1). thrust_deduction: t. wake_fraction: w.
    torque_fraction: k, the fraction of the torque on the hull. limit: largest |n|, 1/s. lag: of its actuator, s.
    position: of its centre, (3,) m. axis: unit vector (3,), ahead. effectiveness: e, the part of T and of the torque
    that it has, 1, or 0 of a dead propeller, whose own drag is left out. Commanded by n, 1/s; n > 0 is ahead.
    Raises ArgumentError. Source: Fossen (2021), 9.3.
    """

    kind: ClassVar[str] = "propeller"
    diameter: Measured = measured(u.LENGTH, positive)
    thrust: Measured = measured(u.NUMBER, numbers(2))
    torque: Measured = measured(u.NUMBER, numbers(2))
    thrust_deduction: Measured = measured(u.NUMBER)
    wake_fraction: Measured = measured(u.NUMBER)
    torque_fraction: Measured = measured(u.NUMBER)
    limit: Measured = measured(u.REVOLUTIONS, positive)
    lag: Measured = measured(u.TIME, not_negative, default=None)
    position: Measured = place(default=(0.0, 0.0, 0.0))
    axis: Measured = way(default=(1.0, 0.0, 0.0))
    effectiveness: Measured = measured(u.NUMBER, share, default=1.0)

    @property
    def command(self) -> Command:
        return Command("1/s")

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        D, n = own.diameter, actual
        ahead = (1 - own.wake_fraction) * jnp.maximum(flow.at(own.position) @ own.axis, 0.0)
        J = jnp.where(n > 0, ahead / D, 0.0)
        thrust = own.effectiveness * flow.density * D**4 * jnp.abs(n) * (own.thrust[0] * n + own.thrust[1] * J)
        torque = own.effectiveness * flow.density * D**5 * jnp.abs(n) * (own.torque[0] * n + own.torque[1] * J)
        push = (1 - own.thrust_deduction) * thrust * own.axis
        return Force(torque=own.torque_fraction * torque * own.axis + jnp.cross(own.position, push), force=push)
