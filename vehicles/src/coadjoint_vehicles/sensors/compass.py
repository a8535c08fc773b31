"""The heading of a compass, and roll, pitch and heading of an attitude reference."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.kinematics import Kinematics, turned
from coadjoint_vehicles.sensors.message import Message, MessageField
from coadjoint_vehicles.sensors.sensor import Sensor, tilt, turn, wrapped


@dataclass(frozen=True, eq=False, kw_only=True)
class Compass(Sensor):
    """The heading of its x axis, atan2(x_east, x_north) less the declination, (1,) rad in [−π, π).

    declination: of magnetic from true north, rad, positive to the east; 0 of a gyrocompass, or where it is made up for.
    largest_tilt: of its z axis from down, rad, beyond which it does not read. heading: its Errors. Raises
    ArgumentError.
    """

    kind: ClassVar[str] = "compass"
    channels: ClassVar[tuple[Channel, ...]] = (Channel("heading", ("heading",), u.ANGLE, "rad", angle=True),)
    declination: Measured = measured(u.ANGLE, turn, default=0.0)
    largest_tilt: Measured = measured(u.ANGLE, tilt, default=None)
    heading: Errors = field(default_factory=Errors)

    def reading(self, motion: Kinematics, own: Named) -> Array:
        ahead = jnp.asarray(motion.rotation) @ turned(own.euler_zyx)[:, 0]
        return jnp.stack([wrapped(jnp.arctan2(ahead[1], ahead[0]) - own.declination)])

    def within(self, motion: Kinematics, own: Named) -> Array:
        return upright(motion, own)


@dataclass(frozen=True, eq=False, kw_only=True)
class Ahrs(Sensor):
    """Roll, pitch and heading of the sensor axes, (3,) rad, of R M: an attitude and heading reference.

    roll = atan2(d_y, d_z) and pitch = atan2(−d_x, |(d_y, d_z)|) of down d in its axes, heading as of `Compass`.
    tilt: the Errors of roll and pitch; heading: of the heading. declination: of magnetic from true north, rad.
    Raises ArgumentError.
    """

    kind: ClassVar[str] = "ahrs"
    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("tilt", ("roll", "pitch"), u.ANGLE, "rad", angle=True),
        Channel("heading", ("heading",), u.ANGLE, "rad", angle=True),
    )
    message: ClassVar[Message | None] = Message(
        "sensor_msgs/Imu",
        (MessageField("orientation", "attitude", ("tilt", "heading")),),
        unknown=("angular_velocity_covariance", "linear_acceleration_covariance"),
    )
    declination: Measured = measured(u.ANGLE, turn, default=0.0)
    tilt: Errors = field(default_factory=Errors)
    heading: Errors = field(default_factory=Errors)

    def reading(self, motion: Kinematics, own: Named) -> Array:
        R = jnp.asarray(motion.rotation) @ turned(own.euler_zyx)
        roll = jnp.arctan2(R[2, 1], R[2, 2])
        pitch = jnp.arctan2(-R[2, 0], jnp.sqrt(R[2, 1] ** 2 + R[2, 2] ** 2))
        heading = wrapped(jnp.arctan2(R[1, 0], R[0, 0]) - own.declination)
        return jnp.stack([roll, pitch, heading])


def upright(motion: Kinematics, own: Named) -> Array:
    """Whether the z axis of a sensor is within `largest_tilt` of down, one truth value; always where it has none."""
    if "largest_tilt" not in own:
        return jnp.asarray(True)
    return motion.down @ turned(own.euler_zyx)[:, 2] >= jnp.cos(own.largest_tilt)
