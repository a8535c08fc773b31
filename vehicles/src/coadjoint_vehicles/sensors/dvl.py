"""Doppler velocity logs: a velocity, or its components along the beams."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.models.quantities import not_negative, positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, acute, measured
from coadjoint_vehicles.sensors.compass import upright
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.kinematics import Kinematics, turned
from coadjoint_vehicles.sensors.message import Message, MessageField
from coadjoint_vehicles.sensors.sensor import Sensor, along_beams, tilt, turn


@dataclass(frozen=True, eq=False, kw_only=True)
class Dvl(Sensor):
    """Mᵀ(ν + ω × r), (3,) m/s in its own axes, of its place over ground; z is the way it looks, down.

    M takes its axes to those of the body. track: "bottom", or "water", Mᵀ(ν + ω × r − Rᵀc). lowest, highest: the
    altitudes of r between which the bottom is locked, m, where the motion knows of a `bottom`; a track of the water
    needs none. largest_tilt: of its z axis from down, rad, beyond which the lock is lost. velocity: its Errors; a
    share of the speed, as data sheets state it, is `scale`. Raises ArgumentError.
    """

    kind: ClassVar[str] = "dvl"
    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("velocity", tuple(f"velocity_{x}" for x in "xyz"), u.SPEED, "m/s", vector=True),
    )
    message: ClassVar[Message | None] = Message(
        "geometry_msgs/TwistWithCovarianceStamped",
        (MessageField("twist.twist.linear", "vector", ("velocity",)),),
        silent=("twist.twist.angular",),
    )
    track: Measured = measured(None, None, words=("bottom", "water"), default="bottom")
    lowest: Measured = measured(u.LENGTH, not_negative, default=None)
    highest: Measured = measured(u.LENGTH, positive, default=None)
    largest_tilt: Measured = measured(u.ANGLE, tilt, default=None)
    velocity: Errors = field(default_factory=Errors)

    def reading(self, motion: Kinematics, own: Named) -> Array:
        v = motion.velocity_at(own.position)
        if self.track == "water":
            v = v - jnp.asarray(motion.rotation).T @ jnp.asarray(motion.current)
        return turned(own.euler_zyx).T @ v

    def within(self, motion: Kinematics, own: Named) -> Array:
        locked = upright(motion, own)
        if self.track == "bottom" and motion.bottom is not None:
            altitude = motion.bottom - motion.place(own.position)[2]
            locked = locked & (altitude >= own.lowest) if "lowest" in own else locked
            locked = locked & (altitude <= own.highest) if "highest" in own else locked
        return locked


@dataclass(frozen=True, eq=False, kw_only=True)
class DvlBeams(Dvl):
    """b_i·v, (4,) m/s: the velocity v of a `Dvl` along each of its four beams, positive towards where it points.

    b_i = (sin α cos φ_i, sin α sin φ_i, cos α), φ_i = φ + (i − 1)π/2, in its own axes. beam_angle: α, of the beams from
    its z axis, rad. azimuth: φ, of the first beam from its x axis towards y, rad. velocity: the Errors of a beam. Other
    fields are those of `Dvl`. Raises ArgumentError.
    """

    kind: ClassVar[str] = "dvl_beams"
    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("velocity", tuple(f"beam_{i}" for i in range(1, 5)), u.SPEED, "m/s"),
    )
    message: ClassVar[Message | None] = None
    beam_angle: Measured = measured(u.ANGLE, acute)
    azimuth: Measured = measured(u.ANGLE, turn, default=0.0)

    def beams(self, own: PyTree = None) -> Array:
        """The unit vectors b_i, (4, 3), in its own axes."""
        own = self if own is None else own
        numbers = np if own is self else jnp
        phi = own.azimuth + 0.5 * np.pi * np.arange(4)
        across = numbers.sin(own.beam_angle)
        along = numbers.cos(own.beam_angle) * np.ones(4)
        return numbers.stack([across * numbers.cos(phi), across * numbers.sin(phi), along], axis=1)  # pyright: ignore[reportReturnType]

    def reading(self, motion: Kinematics, own: Named) -> Array:
        return along_beams(self.beams(own), super().reading(motion, own))
