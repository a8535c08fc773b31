"""Altitude over the bottom by one beam."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array
from coadjoint.models.quantities import not_negative, positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.kinematics import Kinematics, turned
from coadjoint_vehicles.sensors.sensor import Sensor, needs

LEVEL = 1e-3
"""The sine of the angle below the horizon from which a beam counts as one that meets the bottom."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Altimeter(Sensor):
    """The way to a level bottom along its z axis s, (bottom − (q + Rr)_z)/s_z, (1,) m; s is in space, s_z down.

    lowest, highest: the ranges between which it reads, m. range: its Errors. It does not read where its beam does not
    meet the bottom. Raises ArgumentError, also for a motion that knows of no `bottom`.
    """

    kind: ClassVar[str] = "altimeter"
    channels: ClassVar[tuple[Channel, ...]] = (Channel("range", ("range",), u.LENGTH, "m"),)
    required: ClassVar[tuple[str, ...]] = ("bottom",)
    lowest: Measured = measured(u.LENGTH, not_negative, default=None)
    highest: Measured = measured(u.LENGTH, positive, default=None)
    range: Errors = field(default_factory=Errors)

    def reading(self, motion: Kinematics, own: Named) -> Array:
        bottom = needs(motion, "bottom", f"{self.title}`")
        steep = motion.down @ turned(own.euler_zyx)[:, 2]
        steep = jnp.where(steep > LEVEL, steep, 1.0)
        return jnp.stack([(bottom - motion.place(own.position)[2]) / steep])

    def within(self, motion: Kinematics, own: Named) -> Array:
        way = self.reading(motion, own)[0]
        meets = (motion.down @ turned(own.euler_zyx)[:, 2] > LEVEL) & (way >= 0)
        meets = meets & (way >= own.lowest) if "lowest" in own else meets
        return meets & (way <= own.highest) if "highest" in own else meets
