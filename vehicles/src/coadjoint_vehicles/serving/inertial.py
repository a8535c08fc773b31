"""The reading of an inertial measurement unit on a craft at a node: angular velocity and specific force."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree
from coadjoint.extending import replace_parameters
from coadjoint.mechanics import State, System, continuous


class Inertial(NamedTuple):
    """ω, rad/s, and the specific force f, m/s², (3,) each, forward, starboard, down."""

    angular_velocity: Array
    specific_force: Array


def inertial(system: System, place: Any, state: State, p: PyTree) -> Inertial:
    """ω and f = ν̇ + ω × ν − g_O + ω̇ × r + ω × (ω × r) at r, body axes, of a craft's system at a node.

    ω and ν are those of the momenta at the node, ω̇ and ν̇ those of the continuous equations (P20)–(P22) with all forces
    there; g_O is the acceleration of gravity in body axes. At rest, level and neutrally buoyant, f = (0, 0, −g).
    """
    system = replace_parameters(system, p)
    xi, nu = continuous.velocities(system, state)
    rates = continuous.vector_field(system, state.replace(xi=xi, nu=nu))
    down = system.advected.view(system.group, state.a).down
    turning = jnp.cross(rates.xi, place) + jnp.cross(xi, jnp.cross(xi, place))
    return Inertial(xi, rates.nu + jnp.cross(xi, nu) - p.gravity * down + turning)
