"""Temperature that falls linearly with depth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint_vehicles import measured
from coadjoint_vehicles.sensors import Channel, Errors, Sensor


@dataclass(frozen=True, eq=False, kw_only=True)
class Thermometer(Sensor):
    """T = surface − lapse · depth at its place, (1,) K."""

    kind: ClassVar[str] = "thermometer"
    channels: ClassVar[tuple[Channel, ...]] = (Channel("temperature", ("temperature",), u.NUMBER, "1"),)
    surface: float = measured(u.NUMBER, default=288.0)
    lapse: float = measured(u.NUMBER, default=0.05)
    temperature: Errors = field(default_factory=Errors)

    def reading(self, motion, own):
        return jnp.stack([own.surface - own.lapse * motion.place(own.position)[2]])
