"""The heading of a compass, and roll, pitch and heading of an attitude reference."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.groups import SO3
from coadjoint.spaces import Named
from coadjoint.spaces.charts import euler, roll_pitch_yaw, wrapped
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.kinematics import Kinematics, turned
from coadjoint_vehicles.sensors.message import Message, MessageField
from coadjoint_vehicles.sensors.sensor import Sensor, tilt, turn


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
    tilt, heading: the Errors of roll and pitch, and of the heading, which together are a vector e about its own axes:
    it reads R M exp(e^×). declination: of magnetic from true north, rad. Raises
    ArgumentError.
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

    @property
    def space(self) -> PyTree:
        return SO3()

    @property
    def coordinates(self) -> PyTree:
        return "rpy"

    def value(self, motion: Kinematics, own: Named) -> Array:
        """Its attitude over magnetic north, (3, 3)."""
        return euler(0.0, 0.0, -own.declination) @ jnp.asarray(motion.rotation) @ turned(own.euler_zyx)

    def reading(self, motion: Kinematics, own: Named) -> Array:
        return roll_pitch_yaw(self.value(motion, own))

    def _shapes(self) -> PyTree:
        return np.eye(3)


def upright(motion: Kinematics, own: Named) -> Array:
    """Whether the z axis of a sensor is within `largest_tilt` of down, one truth value; always where it has none."""
    if "largest_tilt" not in own:
        return jnp.asarray(True)
    return motion.down @ turned(own.euler_zyx)[:, 2] >= jnp.cos(own.largest_tilt)
