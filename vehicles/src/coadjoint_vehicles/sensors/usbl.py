"""Ultra-short baselines: range and direction between a vehicle and a beacon."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.models.quantities import positive, vector
from coadjoint.spaces import Named, Sphere
from coadjoint.spaces.charts import bearing
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.parts.part import speed_of
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.kinematics import Kinematics, turned
from coadjoint_vehicles.sensors.sensor import Sensor


@dataclass(frozen=True, eq=False, kw_only=True)
class Usbl(Sensor):
    """Range |d|, m, bearing atan2(d_y, d_x) and elevation atan2(−d_z, |(d_x, d_y)|), rad, up positive: (3,).

    seen_from: "vehicle", d from its place r to the beacon in its own axes, MᵀRᵀ(b − q − Rr); or "beacon", whose
    transceiver is aligned with space: d = q + Rr − b, so that the bearing is from north to the east.

    beacon: b, (3,) m, north, east, down. farthest: the largest range, m. range, direction: their Errors, those of the
    direction along the arcs of bearing and elevation on the sphere. Raises ArgumentError.
    """

    kind: ClassVar[str] = "usbl"
    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("range", ("range",), u.LENGTH, "m"),
        Channel("direction", ("bearing", "elevation"), u.ANGLE, "rad", angle=True),
    )
    beacon: Measured = measured(u.LENGTH, vector)
    seen_from: Measured = measured(None, None, words=("vehicle", "beacon"), default="vehicle")
    farthest: Measured = measured(u.LENGTH, positive, default=None)
    range: Errors = field(default_factory=Errors)
    direction: Errors = field(default_factory=Errors)

    def between(self, motion: Kinematics, own: Named) -> Array:
        """d, (3,) m; jax.numpy only."""
        d = own.beacon - motion.place(own.position)
        if self.seen_from == "beacon":
            return -d
        return turned(own.euler_zyx).T @ (jnp.asarray(motion.rotation).T @ d)

    @property
    def space(self) -> PyTree:
        return None, Sphere()

    @property
    def coordinates(self) -> PyTree:
        return None, "bearing"

    def value(self, motion: Kinematics, own: Named) -> tuple[Array, Array]:
        """Range (1,) m and d, (3,) m, whose direction it reads."""
        d = self.between(motion, own)
        return jnp.stack([speed_of(d)]), d

    def reading(self, motion: Kinematics, own: Named) -> Array:
        reach, d = self.value(motion, own)
        return jnp.concatenate([reach, bearing(d)])

    def _shapes(self) -> PyTree:
        return np.zeros(1), np.ones(3)

    def within(self, motion: Kinematics, own: Named) -> Array:
        near = speed_of(self.between(motion, own))
        return near <= own.farthest if "farthest" in own else jnp.asarray(True)
