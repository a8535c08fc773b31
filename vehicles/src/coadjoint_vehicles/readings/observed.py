"""Readings of sensors at the nodes of a stepper, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from coadjoint.arrays import PyTree
from coadjoint.models.quantities import not_negative
from coadjoint.spaces import Named
from coadjoint_vehicles.model.craft import Craft
from coadjoint_vehicles.readings.craft_kinematics import kinematics
from coadjoint_vehicles.readings.of_run import chosen_sensors
from coadjoint_vehicles.readings.taken import PREFIX
from coadjoint_vehicles.sensors.sensor import Sensor


def observations(
    craft: Craft, sensors: Sequence[Sensor | str] | None = None, *, bottom: float | None = None
) -> dict[str, Callable[..., PyTree]]:
    """`sensor_NAME` → (state, p) ↦ the error-free reading of a sensor at a node, (m,), for `observe` of a `co.Stepper`.

        stepper = co.Stepper(craft.system, start, dt=0.05, observe=observations(craft, ["imu", "dvl"]))

    sensors: names, or a user's own sensors; by default all of the craft's vehicle. bottom: the depth of a level bottom,
    one number in m. Neither rates nor limits count here, and errors are drawn by `Noise`. Raises ArgumentError.
    """
    at = kinematics(craft, bottom=None if bottom is None else float(not_negative(bottom, "bottom")))
    return {PREFIX + one.name: partial(_read, one, at) for one in chosen_sensors(craft, sensors)}


def _read(sensor: Sensor, at: Callable[..., PyTree], state: Any, p: PyTree) -> Any:
    return sensor.reading(at(state, p), Named(**sensor.parameters()))
