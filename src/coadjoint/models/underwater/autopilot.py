"""Depth, heading and speed by digital PID controllers, and the actuators that carry out what they say."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from coadjoint.groups.group import Array
from coadjoint.mechanics.internal import sampled, sampling
from coadjoint.models.underwater.pilots.pid import nearest_turn, pid


def attitude_angles(down: Array, north: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and heading (rad) from the directions of down and north in the body frame, forward-starboard-down."""
    east = jnp.cross(down, north)
    pitch = jnp.arctan2(-down[0], jnp.sqrt(down[1] ** 2 + down[2] ** 2 + 1e-300))
    return jnp.arctan2(down[1], down[2]), pitch, jnp.arctan2(east[0], north[0])


def autopilot(motion: Any, h: Any, p: Any) -> dict[str, Any]:
    """The rule of a vehicle's internal state: depth, heading and speed controllers, then the actuators' lags.

    motion.inputs: `depth` (m), `heading` (rad), `speed` (m/s, through the water). Depth asks for a pitch,
    θ_c = −PI(depth error), and pitch for stern planes, δ_s = −PD(θ_c − θ); heading for the rudder; speed for
    revolutions.
    Actuators: x ← x + (1 − exp(−h/τ))(u − x).
    """
    now = motion.internal
    v, omega = motion.nu - motion.a.current, motion.xi
    roll, pitch, heading = attitude_angles(motion.a.down, motion.a.north)
    sink = motion.nu @ motion.a.down
    turn = (omega[1] * jnp.sin(roll) + omega[2] * jnp.cos(roll)) / jnp.cos(pitch)

    def update(last: Any) -> dict[str, Any]:
        T = p.period
        dive, of_depth = pid(
            p.depth_gains, motion.inputs.depth - motion.n @ motion.a.down, sink, last.depth, T, p.pitch_limit
        )
        planes, _ = pid(p.pitch_gains, -dive - pitch, omega[1], jnp.zeros(()), T, p.fin_limit)
        turned = nearest_turn(motion.inputs.heading - heading)
        rudder, of_heading = pid(p.heading_gains, turned, turn, last.heading, T, p.fin_limit)
        pull, of_speed = pid(
            p.speed_gains, motion.inputs.speed - v[0], jnp.zeros(()), last.speed, T, p.revolutions_limit
        )
        return {
            "stern_planes": -planes,
            "rudder": rudder,
            "revolutions": jnp.maximum(pull, 0.0),
            "depth": of_depth,
            "heading": of_heading,
            "speed": of_speed,
        }

    pilot = sampled(motion, h, now.pilot, update, period=p.period, delay=p.delay)
    after: dict[str, Any] = {"pilot": pilot}
    for name, lag in (("rudder", p.fin_lag), ("stern_planes", p.fin_lag), ("revolutions", p.propeller_lag)):
        command, actual = getattr(now.pilot.value, name), getattr(now, name)
        after[name] = actual + (1 - jnp.exp(-h / lag)) * (command - actual)
    return after


def at_rest(revolutions: float = 0.0, speed_integral: float = 0.0) -> dict[str, Any]:
    """The internal state that `autopilot` starts from: fins amidships, the propeller at n (1/s)."""
    fins = {"stern_planes": 0.0, "rudder": 0.0, "revolutions": revolutions}
    return {**fins, "pilot": sampling({**fins, "depth": 0.0, "heading": 0.0, "speed": speed_integral})}
