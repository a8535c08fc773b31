"""Satellite navigation, which reads only at the surface."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from coadjoint import units as u
from coadjoint.arrays import Array
from coadjoint.models.quantities import number
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.kinematics import Kinematics
from coadjoint_vehicles.sensors.message import Message, MessageField
from coadjoint_vehicles.sensors.sensor import Sensor


@dataclass(frozen=True, eq=False, kw_only=True)
class Gps(Sensor):
    """North and east of its antenna at r, (q + Rr)_{n,e}, (2,) m, while that is at the surface.

    deepest: the depth of the antenna down to which it reads, m, 0 if left out. fix: its Errors. Raises ArgumentError.
    """

    kind: ClassVar[str] = "gps"
    channels: ClassVar[tuple[Channel, ...]] = (Channel("fix", ("north", "east"), u.LENGTH, "m"),)
    message: ClassVar[Message | None] = Message("sensor_msgs/NavSatFix", (MessageField("", "fix", ("fix",)),))
    deepest: Measured = measured(u.LENGTH, number, default=0.0)
    fix: Errors = field(default_factory=Errors)

    def reading(self, motion: Kinematics, own: Named) -> Array:
        return motion.place(own.position)[:2]

    def within(self, motion: Kinematics, own: Named) -> Array:
        return motion.place(own.position)[2] <= own.deepest
