"""The motion of a vehicle as its sensors meet it: places, velocities and accelerations of points of the body."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.mechanics import NodeMotion
from coadjoint.spaces.charts import euler


class Kinematics(NamedTuple):
    """The motion of the body origin O at one time; space axes north, east, down, body axes forward, starboard, down.

    position: q of O, (3,) m. rotation: R from body to space, (3, 3). velocity: ν = Rᵀq̇ over ground, (3,) m/s.
    omega: ω, (3,) rad/s, body axes. acceleration: Rᵀq̈, (3,) m/s², body axes; angular_acceleration: ω̇, (3,) rad/s²:
    for an inertial unit. gravity: g, m/s². current: c, (3,) m/s, space axes: the velocity of the water, for a log that
    tracks it. bottom: its depth, m; None if unknown. head: ∫₀^depth ρ dz at O, kg/m², and density: ρ there,
    kg/m³, for the pressure; without them, the water is that of the depth sensor's settings. t: s.
    """

    position: Any
    rotation: Any
    velocity: Any = (0.0, 0.0, 0.0)
    omega: Any = (0.0, 0.0, 0.0)
    acceleration: Any = None
    angular_acceleration: Any = None
    gravity: Any = 9.81
    current: Any = (0.0, 0.0, 0.0)
    bottom: Any = None
    head: Any = None
    density: Any = None
    t: Any = 0.0

    @property
    def down(self) -> Array:
        """Rᵀe_z, the direction of down in body axes, (3,)."""
        return jnp.asarray(self.rotation)[2]

    def place(self, point: object) -> Array:
        """q + Rr in space, (3,) m, of the point r of the body, (3,) m."""
        return self.position + jnp.asarray(self.rotation) @ jnp.asarray(point)

    def velocity_at(self, point: object) -> Array:
        """ν + ω × r over ground, (3,) m/s, body axes, of the point r of the body, (3,) m."""
        return jnp.asarray(self.velocity) + jnp.cross(jnp.asarray(self.omega), jnp.asarray(point))

    def specific_force(self, point: object) -> Array:
        """f = Rᵀq̈ + ω̇ × r + ω × (ω × r) − g Rᵀe_z, (3,) m/s², body axes, at the point r of the body, (3,) m.

        At rest and level f = (0, 0, −g). Raises ArgumentError where the motion has no accelerations.
        """
        if self.acceleration is None or self.angular_acceleration is None:
            raise ArgumentError(
                "The specific force needs `acceleration` and `angular_acceleration` of the motion, but it has none: "
                "give them, as `kinematics` of a craft does."
            )
        r, omega = jnp.asarray(point), jnp.asarray(self.omega)
        turning = jnp.cross(jnp.asarray(self.angular_acceleration), r) + jnp.cross(omega, jnp.cross(omega, r))
        return self.acceleration + turning - self.gravity * self.down


def at_node(motion: NodeMotion, **more: object) -> Kinematics:
    """The kinematics of a `co.mechanics.NodeMotion` of a craft, as functions of `co.control.Measured` get it.

        function=lambda motion: dvl.measured(at_node(motion))

    more: fields that the motion itself does not have, such as `bottom`, one number in m, or `current`, (3,) m/s.
    """
    return Kinematics(motion.q, rotation_of(motion.a), motion.nu, motion.xi, t=motion.t, **more)


def rotation_of(a: PyTree) -> Array:
    """R (3, 3) from body to space: north, east and down in body axes as its rows, of a craft's advected directions."""
    return jnp.stack([a.north, jnp.cross(a.down, a.north), a.down])


def turned(euler_zyx: Any) -> Array:
    """R_z(yaw)R_y(pitch)R_x(roll), (3, 3), of yaw, pitch and roll (3,) rad: from a sensor's axes to the body's."""
    return euler(euler_zyx[2], euler_zyx[1], euler_zyx[0])
