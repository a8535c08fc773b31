"""Depth, heading and speed of vehicles with fins and propulsion: torpedoes with cross tails, X-tails, bow planes."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.models.quantities import positive, vector
from coadjoint.spaces import Named
from coadjoint_vehicles.controllers.allocation import Allocation, commands_of
from coadjoint_vehicles.controllers.design import propose
from coadjoint_vehicles.controllers.pid import nearest_turn, pid, pull
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.measured import Measured, acute, measured


@dataclass(frozen=True, eq=False, kw_only=True)
class Cruise(Controller):
    """Depth, heading and speed by PID controllers, mixed over whatever fins and propulsion the vehicle has.

        θ_c = −PID(depth error), |θ_c| ≤ pitch_limit;    n = n₀ U_c + PID(U_c − u), 0 ≤ n ≤ thrust_limit
        δ_pitch = PID(θ_c − θ),    δ_heading = PID(ψ_c − ψ),    δ_roll = PID(−φ)
        δ_i = Σ_j allocation_ij δ_j over the fins, scaled down alike where one is beyond fin_limit

    Positive δ_pitch turns the nose up, δ_heading the nose and δ_roll the mast to starboard, whatever the fins' signs.
    The gains are made for going at `speed`: at another u, rates count by speed/u, as fins push with its square.

    Of a vehicle that its fins turn in yaw alone and that holds `speed` without commands, as a ship in the plane, the
    heading is controlled, and depth and speed are not.

    Set points: `depth` (m; or `altitude` over a flat `bottom`, or `pitch` (rad), by `vertical`), `heading` (rad),
    `speed` (m/s through the water).
    Fields, the keys of [controller] with kind = "cruise", all optional. speed: of the design, m/s. depth_gains: k_p,
    k_i, k_d, in rad/m, rad/(m s), rad s/m. pitch_gains, heading_gains, roll_gains: k_p, k_i, k_d, in 1, 1/s, s.
    speed_gains: k_p, k_i, k_d, in commands per m/s, per m, per m/s². feed_forward: n₀, command per m/s. pitch_reach,
    heading_reach: larger errors count as these, so that turns stay within the authority of the fins, rad. pitch_limit:
    largest |θ_c|, rad. fin_limit: largest deflection, rad. thrust_limit: largest command of propulsion. vertical: the
    set point of the vertical. bottom: the depth of a flat bottom, m. Missing values are proposed from the vehicle's
    mass, damping and fins at `speed` (`design.propose`). Raises ArgumentError.
    """

    kind: ClassVar[str] = "cruise"
    speed: Measured = measured(u.SPEED, positive, default=1.5)
    depth_gains: Measured = measured(None, vector, default=None)
    pitch_gains: Measured = measured(None, vector, default=None)
    heading_gains: Measured = measured(None, vector, default=None)
    roll_gains: Measured = measured(None, vector, default=None)
    pitch_reach: Measured = measured(u.ANGLE, positive, default=None)
    heading_reach: Measured = measured(u.ANGLE, positive, default=None)
    speed_gains: Measured = measured(None, vector, default=None)
    feed_forward: Measured = measured(None, default=None)
    pitch_limit: Measured = measured(u.ANGLE, acute, default=pi / 6)
    fin_limit: Measured = measured(u.ANGLE, positive, default=None)
    thrust_limit: Measured = measured(None, positive, default=None)
    vertical: str = measured(None, None, words=("depth", "altitude", "pitch"), default="depth")
    bottom: Measured = measured(u.LENGTH, default=None)
    allocation: Allocation | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.vertical == "altitude") != (self.bottom is not None):
            raise ArgumentError('The controller `cruise` takes `bottom` (m) with vertical = "altitude", and only then.')

    def fitted(self, vehicle: object) -> Cruise:
        """The controller with its allocation, and proposed values of missing gains, for a vehicle; raises ArgumentError
        if that is impossible.
        """
        return self if self.allocation is not None else propose(self, vehicle)

    def parameters(self) -> dict[str, PyTree]:
        return {**super().parameters(), **({} if self.allocation is None else {"allocation": self.allocation.matrix})}

    @property
    def inputs(self) -> dict[str, str]:
        return {self.vertical: "rad" if self.vertical == "pitch" else "m", "heading": "rad", "speed": "m/s"}

    @property
    def ahead_only(self) -> bool:
        return True

    @property
    def keeps_level(self) -> bool:
        return True

    def memory(self) -> dict[str, PyTree]:
        return dict.fromkeys(("depth", "pitch", "heading", "roll", "speed"), 0.0)

    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Vehicle
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        mixed, integrals = self.turns_and_thrust(feedback, memory, own)
        return self.shared(mixed, own, vehicle), integrals

    def turns_and_thrust(self, feedback: Feedback, memory: Named, own: Named) -> tuple[Array, dict[str, PyTree]]:
        """(δ_roll, δ_pitch, δ_heading, n), (4,), and the integrals of the five controllers."""
        T, omega = own.period, feedback.omega
        faster = own.speed / jnp.maximum(feedback.velocity[0], own.speed / 3)
        climb, of_depth = self._climb(feedback, memory, own)
        # The integral ignores a depth error that pitch has yet to follow.
        of_depth = jnp.where(jnp.abs(climb - feedback.pitch) > own.pitch_reach, memory.depth, of_depth)
        up, of_pitch = self._turn("pitch", climb - feedback.pitch, omega[1], memory.pitch, faster, own)
        turned = nearest_turn(feedback.inputs.heading - feedback.heading)
        turn = (omega[1] * jnp.sin(feedback.roll) + omega[2] * jnp.cos(feedback.roll)) / jnp.cos(feedback.pitch)
        round_, of_heading = self._turn("heading", turned, turn, memory.heading, faster, own)
        over, of_roll = pid(_at(faster, own.roll_gains), -feedback.roll, omega[0], memory.roll, T, own.fin_limit)
        ahead, of_speed = pull(feedback, memory.speed, own)
        return jnp.stack([over, up, round_, ahead]), {
            "depth": of_depth,
            "pitch": of_pitch,
            "heading": of_heading,
            "roll": of_roll,
            "speed": of_speed,
        }

    def shared(self, mixed: Array, own: Named, vehicle: Vehicle) -> dict[str, PyTree]:
        """The commands of fins and propulsion for (δ_roll, δ_pitch, δ_heading, n)."""
        assert self.allocation is not None
        fins = own.allocation[:, :3] @ mixed[:3]
        fins = fins * jnp.minimum(1.0, own.fin_limit / jnp.maximum(jnp.max(jnp.abs(fins)), 1e-9))
        return commands_of(self.allocation, fins + own.allocation[:, 3] * mixed[3], vehicle)

    def _turn(self, axis: str, error: Array, rate: Array, integral: Array, faster: Array, own: Named) -> Any:
        """The mixed angle about an axis, and the integral of its error where that is within reach."""
        far, gains = getattr(own, f"{axis}_reach"), _at(faster, getattr(own, f"{axis}_gains"))
        near = jnp.clip(error, -far, far)
        angle, following = pid(gains, near, rate, integral, own.period, own.fin_limit)
        return angle, jnp.where(near == error, following, integral)

    def _climb(self, feedback: Feedback, memory: Named, own: Named) -> tuple[Array, Array]:
        """θ_c, rad, and the integral of the depth error."""
        if self.vertical == "pitch":
            return jnp.clip(feedback.inputs.pitch, -own.pitch_limit, own.pitch_limit), memory.depth
        wanted = feedback.inputs.depth if self.vertical == "depth" else own.bottom - feedback.inputs.altitude
        dive, integral = pid(
            own.depth_gains, wanted - feedback.depth, feedback.sink, memory.depth, own.period, own.pitch_limit
        )
        return -dive, integral


def _at(faster: Array, gains: Array) -> Array:
    """The gains with that of the rate as it counts at another speed."""
    return gains * jnp.stack([jnp.ones(()), jnp.ones(()), faster])
