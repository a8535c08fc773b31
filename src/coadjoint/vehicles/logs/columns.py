"""The columns of a log: names that end in their unit, angles in degrees."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from coadjoint.vehicles.logs.log import Log

SUFFIXES: dict[str, tuple[str, float]] = {
    "s": ("s", 1.0), "ms": ("s", 1e-3), "min": ("s", 60.0),
    "m": ("m", 1.0), "cm": ("m", 1e-2), "mm": ("m", 1e-3), "km": ("m", 1e3),
    "m_s": ("m/s", 1.0), "m_per_s": ("m/s", 1.0), "cm_s": ("m/s", 1e-2), "knots": ("m/s", 1852.0 / 3600.0),
    "rad": ("rad", 1.0), "deg": ("rad", pi / 180),
    "rad_s": ("rad/s", 1.0), "rad_per_s": ("rad/s", 1.0), "deg_s": ("rad/s", pi / 180),
    "deg_per_s": ("rad/s", pi / 180),
    "per_s": ("1/s", 1.0), "rpm": ("1/s", 1 / 60), "m3": ("m³", 1.0), "l": ("m³", 1e-3),
    "N": ("N", 1.0), "Nm": ("N m", 1.0), "kg": ("kg", 1.0), "J": ("J", 1.0), "V": ("V", 1.0),
}  # fmt: skip
"""The endings of column names: the SI unit, and how many of it they are."""

WRITTEN = {
    "m": "m",
    "s": "s",
    "m/s": "m_s",
    "rad": "deg",
    "rad/s": "rad_s",
    "1/s": "per_s",
    "m³": "m3",
    "N": "N",
    "N m": "Nm",
}
"""In what a unit is written."""

_LONGEST_FIRST = sorted(SUFFIXES, key=len, reverse=True)


def split(column: str) -> tuple[str, str, float]:
    """Name, SI unit and factor of a column: ("heading", "rad", π/180) of `heading_deg`; unit "" where it has none."""
    for suffix in _LONGEST_FIRST:
        name = column.removesuffix(f"_{suffix}")
        if name not in (column, ""):
            return name, *SUFFIXES[suffix]
    return column, "", 1.0


def columns(log: Log, axes: str = "NED/FRD") -> dict[str, np.ndarray]:
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
        found |= _written(name, actuator.actual, actuator.unit)
    for name, actuator in log.actuators.items():
        if actuator.command is not None:
            found |= _written(f"command_{name}", actuator.command, actuator.unit)
    for name, (values, unit) in log.set_points.items():
        found |= _written(f"set_{name}", values, unit)
    if log.current is not None:
        found |= {f"current_{n}_m_s": c for n, c in zip(("north", "east", "down"), log.current.T, strict=True)}
    return found


def _motion(log: Log, axes: str) -> tuple[Any, ...]:
    """Position, attitude, velocities over ground and through the water, rates, and names of the first two."""
    names = ("north_m", "east_m", "depth_m", "roll_deg", "pitch_deg", "heading_deg")
    if axes == "NED/FRD":
        return log.position, log.attitude, log.velocity, log.through_water, log.rates, names
    from coadjoint.vehicles import axes as border

    position = border.space_vector(log.position, axes)  # pyright: ignore[reportArgumentType]
    attitude = border.euler_zyx(log.attitude[:, ::-1], axes)[:, ::-1]  # pyright: ignore[reportArgumentType]
    moving = (border.body_vector(v, axes) for v in (log.velocity, log.through_water, log.rates))  # pyright: ignore[reportArgumentType]
    return position, attitude, *moving, ("east_m", "north_m", "up_m", "roll_deg", "pitch_deg", "yaw_deg")


def _written(name: str, values: np.ndarray, unit: str) -> dict[str, np.ndarray]:
    """A quantity under its name with its unit; the components of several as `name[1]`, `name[2]`, …"""
    suffix = WRITTEN.get(unit, "")
    values = np.degrees(values) if suffix == "deg" else values
    ending = f"_{suffix}" if suffix else ""
    if values.ndim == 1:
        return {f"{name}{ending}": values}
    return {f"{name}[{i + 1}]{ending}": column for i, column in enumerate(values.reshape(len(values), -1).T)}
