"""The columns of a log: names that end in their unit, angles in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.csv_tables import csv_text
from coadjoint.units import ending
from coadjoint_vehicles.logs.records import VehicleRecords

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset


def columns(log: VehicleRecords, axes: str = "NED/FRD") -> dict[str, np.ndarray]:
    """All columns of a log by their names, (nodes,) each.

    In ENU/FLU the columns are `east_m`, `north_m`, `up_m`, `roll_deg`, `pitch_deg`, `yaw_deg`, and u, v, w, p, q, r are
    along forward, port and up; set points, commands and currents keep their names and meanings. u, v, w are over
    ground; in a current `u_water_m_s`, … are through the water.
    """
    position, attitude, velocity, through_water, rates, names = _motion(log, axes)
    found = {"time_s": log.time}
    found |= dict(zip(names[:3], position.T, strict=True))
    found |= dict(zip(names[3:], np.degrees(attitude).T, strict=True))
    found |= dict(zip(("u_m_s", "v_m_s", "w_m_s"), velocity.T, strict=True))
    if log.current is not None:
        found |= dict(zip(("u_water_m_s", "v_water_m_s", "w_water_m_s"), through_water.T, strict=True))
    found |= dict(zip(("p_rad_s", "q_rad_s", "r_rad_s"), rates.T, strict=True))
    for name, actuator in log.actuators.items():
        found |= written(name, actuator.actual, actuator.unit)
    for name, actuator in log.actuators.items():
        if actuator.command is not None:
            found |= written(f"command_{name}", actuator.command, actuator.unit)
    for name, (values, unit) in log.set_points.items():
        found |= written(f"set_{name}", values, unit)
    if log.current is not None:
        found |= {f"current_{n}_m_s": c for n, c in zip(("north", "east", "down"), log.current.T, strict=True)}
    return found


def _motion(log: VehicleRecords, axes: str) -> tuple[Any, ...]:
    """Position, attitude, velocities over ground and through the water, rates, and names of the first two."""
    names = ("north_m", "east_m", "depth_m", "roll_deg", "pitch_deg", "heading_deg")
    if axes == "NED/FRD":
        return log.position, log.attitude, log.velocity, log.through_water, log.rates, names
    from coadjoint_vehicles import axes as border

    position = border.space_vector(log.position, axes)  # pyright: ignore[reportArgumentType]
    attitude = border.euler_zyx(log.attitude[:, ::-1], axes)[:, ::-1]  # pyright: ignore[reportArgumentType]
    moving = (border.body_vector(v, axes) for v in (log.velocity, log.through_water, log.rates))  # pyright: ignore[reportArgumentType]
    return position, attitude, *moving, ("east_m", "north_m", "up_m", "roll_deg", "pitch_deg", "yaw_deg")


def written(name: str, values: np.ndarray, unit: str) -> dict[str, np.ndarray]:
    """A quantity under its name with its unit, angles in degrees; components of several as `name[1]`, `name[2]`, …"""
    end = ending(unit or "1")
    values = np.degrees(values) if unit == "rad" else values
    if values.ndim == 1:
        return {f"{name}{end}": values}
    return {f"{name}[{i + 1}]{end}": column for i, column in enumerate(values.reshape(len(values), -1).T)}


def log_text(dataset: AnyDataset, axes: str = "NED/FRD") -> str:
    """Columns `time_s`, `north_m`, `east_m`, `depth_m`, …; with axes "ENU/FLU" of east, north, up.

    Raises ArgumentError for a run without a vehicle.
    """
    return csv_text(columns(VehicleRecords(dataset), axes))
