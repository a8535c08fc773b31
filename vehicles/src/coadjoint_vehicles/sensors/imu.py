"""Inertial measurement units: gyroscopes and accelerometers at one point of the body."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array
from coadjoint.spaces import Named
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.kinematics import Kinematics, turned
from coadjoint_vehicles.sensors.message import Message, MessageField
from coadjoint_vehicles.sensors.sensor import Sensor


@dataclass(frozen=True, eq=False, kw_only=True)
class Imu(Sensor):
    """Mᵀω and Mᵀf at its place r, f = Rᵀq̈ + ω̇ × r + ω × (ω × r) − g Rᵀe_z: angular velocity and specific force.

    M takes its axes to those of the body. A reading is (6,): angular velocity, (3,) rad/s, then specific force, (3,)
    m/s². At rest, level and upright, the specific force is (0, 0, −g). gyroscope, accelerometer: their Errors. Raises
    ArgumentError. Source: Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd ed. (2004), chapter 3.
    """

    kind: ClassVar[str] = "imu"
    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("gyroscope", tuple(f"angular_velocity_{x}" for x in "xyz"), u.ANGULAR_VELOCITY, "rad/s", vector=True),
        Channel("accelerometer", tuple(f"specific_force_{x}" for x in "xyz"), u.ACCELERATION, "m/s²", vector=True),
    )
    message: ClassVar[Message | None] = Message(
        "sensor_msgs/Imu",
        (
            MessageField("angular_velocity", "vector", ("gyroscope",)),
            MessageField("linear_acceleration", "vector", ("accelerometer",)),
        ),
        unknown=("orientation_covariance",),
    )
    gyroscope: Errors = field(default_factory=Errors)
    accelerometer: Errors = field(default_factory=Errors)

    def reading(self, motion: Kinematics, own: Named) -> Array:
        back = turned(own.euler_zyx).T
        return jnp.concatenate([back @ jnp.asarray(motion.omega), back @ motion.specific_force(own.position)])
