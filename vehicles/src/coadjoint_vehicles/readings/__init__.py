"""Readings of a vehicle's sensors from its runs and steppers: times, latencies, errors from a seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.readings.craft_kinematics import kinematics as kinematics
    from coadjoint_vehicles.readings.observed import observations as observations
    from coadjoint_vehicles.readings.of_run import readings as readings
    from coadjoint_vehicles.readings.taken import Readings as Readings
    from coadjoint_vehicles.readings.taken import SensorReading as SensorReading

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
