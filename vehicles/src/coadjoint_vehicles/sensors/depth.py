"""Depth by pressure."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.kinematics import Kinematics
from coadjoint_vehicles.sensors.message import Message, MessageField
from coadjoint_vehicles.sensors.sensor import Sensor


@dataclass(frozen=True, eq=False, kw_only=True)
class Depth(Sensor):
    """The depth of its place r that the pressure there is in water of one density, (1,) m: ∫₀^z ρ dz/ρ_s.

    density: ρ_s, kg/m³, to which its electronics are set; left out, it reads z = (q + Rr)_z itself. The pressure at r
    is that at O with ρ(Rr)_z more. depth: its Errors. limit: the greatest depth that it reads, m. Raises ArgumentError.
    """

    kind: ClassVar[str] = "depth"
    channels: ClassVar[tuple[Channel, ...]] = (Channel("depth", ("depth",), u.LENGTH, "m"),)
    message: ClassVar[Message | None] = Message(
        "sensor_msgs/FluidPressure", (MessageField("fluid_pressure", "pressure", ("depth",)),)
    )
    density: Measured = measured(u.DENSITY, positive, default=None)
    limit: Measured = measured(u.LENGTH, positive, default=None)
    depth: Errors = field(default_factory=Errors)

    def reading(self, motion: Kinematics, own: Named) -> Array:
        z = motion.place(own.position)[2]
        if "density" in own and motion.head is not None and motion.density is not None:
            z = (motion.head + motion.density * (z - motion.position[2])) / own.density
        return jnp.stack([z])

    def within(self, motion: Kinematics, own: Named) -> Array:
        z = motion.place(own.position)[2]
        return z <= own.limit if "limit" in own else jnp.asarray(True)
