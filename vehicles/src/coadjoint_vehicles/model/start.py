"""Where a craft begins: position, attitude and velocities through the water, of one craft or of each of a fleet."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate, starting_values
from coadjoint.groups import attitude
from coadjoint.mechanics.members import Each, count_members, each, stacked
from coadjoint.models.quantities import angles, number, vector
from coadjoint.spaces import Named
from coadjoint_vehicles import axes as turned
from coadjoint_vehicles.water.water import Water


def starting_motion(
    water: Water,
    own: Named,
    position: PyTree,
    velocity: object,
    euler_zyx: object,
    angular_velocity: object,
    t: float,
    axes: PyTree,
) -> dict[str, PyTree]:
    """R, q, q̇ = R v + c(q, t) and ω as `System.state` takes them; with `co.each` where an argument has it."""
    given = {
        "position": _vectors(position, "position"),
        "velocity": velocity,
        "R": _attitude(_angles(euler_zyx), axes),
        "angular_velocity": _vectors(angular_velocity, "angular_velocity"),
        "own": own,
        "memory": starting_values(water.start() or None),
    }

    def motion(given: dict[str, PyTree]) -> dict[str, PyTree]:
        R = given["R"]
        q = turned.space_vector(given["position"], axes)
        drift = water.current(q, jnp.asarray(t, dtype=float), given["memory"], given["own"])
        return {
            "g": R,
            "q": q,
            "qdot": R @ turned.body_vector(given["velocity"], axes) + drift,
            "xi": turned.body_vector(given["angular_velocity"], axes),
        }

    if count_members(given) is None:
        return evaluate(motion, given)
    values, members = stacked(given)
    found = evaluate(jax.vmap(motion, in_axes=(members,)), values)
    return {name: each(np.asarray(value)) for name, value in found.items()}


def through_water(speed: PyTree, velocity: PyTree) -> PyTree:
    """The velocity v of the body origin through the water, body axes, from a speed ahead or from itself."""
    if speed is not None and velocity is not None:
        raise ArgumentError("Give one of `speed` and `velocity`, not both.")
    if isinstance(speed, Each):
        checks.shape(speed.values, "speed", "(members,)")
        return each(np.outer(speed.values, [1.0, 0.0, 0.0]))
    if speed is not None:
        return number(speed, "speed") * np.array([1.0, 0.0, 0.0])
    return _vectors((0.0, 0.0, 0.0) if velocity is None else velocity, "velocity")


def _attitude(angles: object, axes: PyTree) -> PyTree:
    """R of yaw, pitch and roll, or each of the members'."""
    found = turned.euler_zyx(angles.values if isinstance(angles, Each) else angles, axes)
    R = attitude.zyx(found[..., 0], found[..., 1], found[..., 2])
    return each(R) if isinstance(angles, Each) else R


def _angles(given: object) -> PyTree:
    """Yaw, pitch and roll, (3,), or those of each member; raises ArgumentError."""
    found = _vectors(given, "euler_zyx")
    angles(found.values if isinstance(found, Each) else found, "euler_zyx")
    return found


def _vectors(value: Any, name: str) -> PyTree:
    """A vector (3,), or one for each member; raises ArgumentError."""
    if not isinstance(value, Each):
        return vector(value, name)
    checks.shape(value.values, name, "(members, 3)")
    return value
