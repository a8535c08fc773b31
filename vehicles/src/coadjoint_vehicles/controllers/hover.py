"""Vehicles that thrusters push any way: keeping a station, and depth, heading and speed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.models.quantities import vector
from coadjoint.spaces import Named
from coadjoint_vehicles.controllers.attitude import attitude_of, level
from coadjoint_vehicles.controllers.pid import asked, nearest_turn
from coadjoint_vehicles.controllers.thrusting import LARGEST_TURN, SHARE, Thrusting, poles
from coadjoint_vehicles.model.controller import Feedback
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.allocator import AXES
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.trim.under_way import Level


@dataclass(frozen=True, eq=False, kw_only=True)
class Hover(Thrusting):
    """Keeps a place over ground and a heading, level, against currents.

        a = k_p e + k_i I − k_d ν,    e = R⁻¹(q_c − q), shortened to `reach`;    I ← I + T(q_c − q) where |e| < reach
        α = −k_R e_R − k_I ∫e_R − k_ω ω towards level with the heading (`attitude.attitude_error`)
        w = M (a, α) − (0, Munk moment) − weigh · (net weight, righting torque), shared out over the thrusters

    Set points: `north`, `east`, `depth` (m), `heading` (rad).
    Fields, the keys of [controller] with kind = "hover", all optional: those of `Thrusting`, and position_gains: k_p,
    k_i, k_d, in 1/s², 1/s³, 1/s. Gains that are left out are proposed from the mass and the thrusters' limits. Raises
    ArgumentError.
    """

    NEEDS: ClassVar[tuple[str, ...]] = ("surge", "sway", "heave", "yaw")
    kind: ClassVar[str] = "hover"
    position_gains: Measured = measured(None, vector, default=None)

    @property
    def inputs(self) -> dict[str, str]:
        return {"north": "m", "east": "m", "depth": "m", "heading": "rad"}

    def memory(self) -> dict[str, PyTree]:
        return {**super().memory(), "position": np.zeros(3), "attitude": np.zeros(3)}

    def proposed(self, most: np.ndarray, late: float) -> dict[str, PyTree]:
        moving = most[:3][most[:3] > 0]
        given = {"position_gains": poles(min(SHARE * moving.min(initial=np.inf) / self.reach, 1.0), late)}
        return {**super().proposed(most, late), **given}

    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Vehicle
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        wanted, R = feedback.inputs, attitude_of(feedback.down, feedback.north)
        away = jnp.stack([wanted.north, wanted.east, wanted.depth]) - feedback.position
        distance = jnp.sqrt(away @ away + 1e-12)
        near = distance < own.reach
        integral = jnp.where(near, memory.position + own.period * away, memory.position)
        aim = own.position_gains[0] * away * jnp.minimum(1.0, own.reach / distance) + own.position_gains[1] * integral
        acceleration = R.T @ aim - own.position_gains[2] * feedback.ground_velocity
        turn, of_attitude = self.turn_to(self.wanted(feedback), feedback, memory.attitude, own)
        commands, lost = self.commands(acceleration, turn, feedback, own, vehicle)
        return commands, {"lost": lost, "position": integral, "attitude": of_attitude}

    def wanted(self, feedback: Feedback) -> Array:
        """R_d, (3, 3)."""
        return heading_near(feedback)


@dataclass(frozen=True, eq=False, kw_only=True)
class Pose(Hover):
    """Keeps a place and any attitude, upside down or nose down too: `Hover` by `attitude` instead of `heading`.

    Set points: `north`, `east`, `depth` (m), `attitude`, R_d, (3, 3), body to space. Fields as those of `Hover`, with
    kind = "pose". From almost everywhere R goes to R_d, along no Euler angles (`attitude.angular_acceleration`).
    """

    kind: ClassVar[str] = "pose"
    NEEDS: ClassVar[tuple[str, ...]] = AXES

    @property
    def keeps_level(self) -> bool:
        return False

    @property
    def inputs(self) -> dict[str, str]:
        return {"north": "m", "east": "m", "depth": "m", "attitude": "1"}

    def wanted(self, feedback: Feedback) -> Array:
        return feedback.inputs.attitude


@dataclass(frozen=True, eq=False, kw_only=True)
class Manoeuvre(Thrusting):
    """Depth, heading and speed ahead through the water, level, by thrusters.

        a = (PI(U_c − u), −k_d v, 0) + PID(depth error) d,    d the direction of down, depth error up to `reach`
        PI(U_c − u) begins from (D₁U_c + D₂|U_c|U_c)/M₁₁,    (D₁, D₂) = `drag`, of the vehicle going ahead

    of which D₁u + D₂|u|u is a force ahead without torque, and the rest as `Hover` does; k_d is that of `depth_gains`.
    Set points: `depth` (m), `heading` (rad), `speed` (m/s through the water), so that missions for torpedoes fit.
    Fields, the keys of [controller] with kind = "manoeuvre", all optional: those of `Thrusting`. depth_gains: k_p, k_i,
    k_d, in 1/s², 1/s³, 1/s. speed_gains: k_p, k_i, k_d, in 1/s, 1/s², 1. surge_limit, heave_limit: largest
    accelerations, m/s², the one against drag included; by default 0.8 of the smaller of those that the thrusters give
    both ways along the axis by itself. drag: D₁ and D₂, N s/m and N s²/m². Missing values are proposed. Raises
    ArgumentError.
    """

    kind: ClassVar[str] = "manoeuvre"
    depth_gains: Measured = measured(None, vector, default=None)
    speed_gains: Measured = measured(None, vector, default=None)
    surge_limit: Measured = measured(None, None, default=None)
    heave_limit: Measured = measured(None, None, default=None)
    drag: Measured = measured(None, None, default=None)

    @property
    def inputs(self) -> dict[str, str]:
        return {"depth": "m", "heading": "rad", "speed": "m/s"}

    def memory(self) -> dict[str, PyTree]:
        return {**super().memory(), "depth": 0.0, "speed": 0.0, "attitude": np.zeros(3)}

    def fitted(self, vehicle: object) -> Any:
        found = super().fitted(vehicle)
        if found.drag is not None:
            return found
        level = Level(vehicle)
        slow, fast = (-level.surge(speed) for speed in (0.5, 1.0))
        return replace(found, drag=np.array([4 * slow - fast, 2 * fast - 4 * slow]))

    def proposed(self, most: np.ndarray, late: float) -> dict[str, PyTree]:
        depth = poles(min(SHARE * most[2] / self.reach, 1.0), late)
        rate = min(1.0, 0.2 / late)
        given = {
            "depth_gains": depth,
            "speed_gains": np.array([rate, rate**2 / 4, 0.0]),
            "surge_limit": 0.8 * most[0],
            "heave_limit": 0.8 * most[2],
        }
        return {**super().proposed(most, late), **given}

    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Vehicle
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        T, v, zero, U = own.period, feedback.velocity, jnp.zeros(()), feedback.inputs.speed
        drag = (own.drag[0] + own.drag[1] * jnp.abs(U)) * U / own.mass[0, 0]
        ahead, of_speed = asked(own.speed_gains, U - v[0], zero, memory.speed, T, own.surge_limit, base=drag)
        off = feedback.inputs.depth - feedback.depth
        near = jnp.clip(off, -own.reach, own.reach)
        down, of_depth = asked(own.depth_gains, near, feedback.sink, memory.depth, T, own.heave_limit)
        of_depth = jnp.where(near == off, of_depth, memory.depth)
        turn, of_attitude = self.turn_to(heading_near(feedback), feedback, memory.attitude, own)
        aside = -own.depth_gains[2] * v[1]
        wanted = jnp.stack([ahead, aside, zero]) + down * feedback.down
        ahead, down = (jnp.clip(a, -b, b) for a, b in ((ahead, own.surge_limit), (down, own.heave_limit)))
        acceleration = jnp.stack([ahead, aside, zero]) + down * feedback.down
        # The force against drag accelerates nothing, and needs no torque about O.
        braking = (own.drag[0] + own.drag[1] * jnp.abs(v[0])) * v[0]
        moved = acceleration.at[0].add(-braking / own.mass[0, 0])
        commands, lost = self.commands(moved, turn, feedback, own, vehicle, braking)
        lost = jnp.concatenate([lost[:3] + own.mass[:3, :3] @ (wanted - acceleration), lost[3:]])
        return commands, {"lost": lost, "depth": of_depth, "speed": of_speed, "attitude": of_attitude}


def heading_near(feedback: Feedback) -> Array:
    """Level with the heading wanted, or with one LARGEST_TURN from the present one on the way there."""
    turned = nearest_turn(feedback.inputs.heading - feedback.heading)
    return level(feedback.heading + jnp.clip(turned, -LARGEST_TURN, LARGEST_TURN))
