"""Attitude control on SO(3) itself: the error of an attitude, and the acceleration that takes it away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.models.quantities import positive, vector
from coadjoint.spaces import Named
from coadjoint_vehicles.controllers.allocation import Allocation, commands_of
from coadjoint_vehicles.controllers.design import TurningModel, propose_attitude
from coadjoint_vehicles.controllers.pid import pull
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.measured import Measured, measured


def attitude_of(down: Array, north: Array) -> Array:
    """R, body to space (north, east, down): its rows are the space axes as the body sees them."""
    return jnp.stack([north, jnp.cross(down, north), down])


def level(heading: PyTree) -> Array:
    """The attitude without roll and pitch at a heading (rad)."""
    c, s, o = jnp.cos(heading), jnp.sin(heading), jnp.zeros(())
    return jnp.stack([jnp.stack([c, -s, o]), jnp.stack([s, c, o]), jnp.array([0.0, 0.0, 1.0])])


def attitude_error(R: Array, wanted: Array) -> Array:
    """e_R = ½(R_dᵀR − RᵀR_d)^∨, rad for small errors; |e_R| = sin of the angle between R and R_d.

    Source: Bullo and Murray (1999); Lee, Leok, McClamroch (2010), (10).
    """
    E = wanted.T @ R
    return 0.5 * jnp.stack([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])


def pointing_error(R: Array, wanted: Array) -> Array:
    """e = (RᵀR_d e₁) × e₁, rad for small errors, of the nose alone: |e| = sin of the angle between R e₁ and R_d e₁.

    Source: Bullo and Murray (1999), reduced attitude.
    """
    nose = R.T @ wanted[:, 0]
    return jnp.stack([jnp.zeros(()), nose[2], -nose[1]])


def attitude_distance(R: Array, wanted: Array) -> Array:
    """Ψ = ½ tr(I − R_dᵀR) = 1 − cos of the angle between R and R_d; at constant R_d, Ψ̇ = e_R·ω."""
    return 0.5 * (3.0 - jnp.sum(wanted * R))


def angular_acceleration(gains: PyTree, R: Array, wanted: Array, omega: Array) -> Array:
    """α = −k_R e_R − k_ω ω, rad/s², towards an attitude R_d at rest. gains: (k_R in 1/s², k_ω in 1/s).

    With ω̇ = α, V = ½|ω|² + k_R Ψ has V̇ = −k_ω|ω|²: R converges to R_d from everywhere except a set of measure zero,
    attitudes half a turn away. No Euler angles occur, so pitch ±90° is not a special case.
    Source: Lee, Leok, McClamroch (2010), Propositions 1 and 2, per unit of inertia.
    """
    return -gains[0] * attitude_error(R, wanted) - gains[1] * omega


@dataclass(frozen=True, eq=False, kw_only=True)
class Attitude(Controller):
    """Any attitude, by fins under way: a vertical dive or a loop is not a special case.

        α = −k_R e_R − k_I ∫e_R − k_ω ω,    δ = (U/u)² G⁺ (α − (u/U) A (v, w, ω) − b)

    ω̇ = (u/U) A (v, w, ω) + b + (u/U)² G δ is the vehicle linearised at the speed `speed`, U, with b of its weight and
    buoyancy (`design.turning_model`). Where no fins master the righting moment in roll, e_R is the error of the nose
    alone, `pointing_error`. Fins are scaled down alike at fin_limit; the integral stops there and where |e_R| > ½.

    Set points: `attitude`, R_d, (3, 3), body to space, and `speed` (m/s through the water).
    Fields, the keys of [controller] with kind = "attitude", all optional. speed: U, m/s. attitude_gains: k_R in 1/s²,
    k_I in 1/s³, k_ω in 1/s. speed_gains: k_p, k_i, k_d, as of `Cruise`. feed_forward: n₀, command per m/s. fin_limit:
    largest deflection, rad. thrust_limit: largest command of propulsion. Missing values are proposed. Raises
    ArgumentError.
    """

    kind: ClassVar[str] = "attitude"
    speed: Measured = measured(u.SPEED, positive, default=1.5)
    attitude_gains: Measured = measured(None, vector, default=None)
    speed_gains: Measured = measured(None, vector, default=None)
    feed_forward: Measured = measured(None, default=None)
    fin_limit: Measured = measured(u.ANGLE, positive, default=None)
    thrust_limit: Measured = measured(None, positive, default=None)
    allocation: Allocation | None = None
    model: TurningModel | None = None

    def fitted(self, vehicle: object) -> Attitude:
        """The controller with its model of a vehicle, and proposed values of missing gains."""
        return self if self.model is not None else propose_attitude(self, vehicle)

    def parameters(self) -> dict[str, PyTree]:
        return {**super().parameters(), **({} if self.model is None else {"model": self.model._asdict()})}

    @property
    def ahead_only(self) -> bool:
        return True

    @property
    def inputs(self) -> dict[str, str]:
        return {"attitude": "1", "speed": "m/s"}

    def memory(self) -> dict[str, PyTree]:
        return {"attitude": np.zeros(3), "speed": 0.0}

    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Vehicle
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        assert self.allocation is not None
        model = own.model
        v, faster = feedback.velocity, feedback.velocity[0] / own.speed
        R, goal = attitude_of(feedback.down, feedback.north), feedback.inputs.attitude
        error = jnp.where(model.rolls > 0, attitude_error(R, goal), pointing_error(R, goal))
        gains, following = own.attitude_gains, memory.attitude + own.period * error
        wanted = -gains[0] * error - gains[1] * following - gains[2] * feedback.omega
        natural = faster * model.flow @ jnp.concatenate([v[1:], feedback.omega]) + model.weight @ feedback.down
        fins = model.inverse @ (wanted - natural) / jnp.maximum(faster, 0.5) ** 2
        scale = jnp.minimum(1.0, own.fin_limit / jnp.maximum(jnp.max(jnp.abs(fins)), 1e-9))
        ahead, of_speed = pull(feedback, memory.speed, own)
        commands = commands_of(self.allocation, scale * fins + model.ahead * ahead, vehicle)
        grows = (scale == 1.0) & (error @ error < 0.25)
        return commands, {"attitude": jnp.where(grows, following, memory.attitude), "speed": of_speed}
