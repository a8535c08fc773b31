"""Depth from pressure, and north and east from fixes of satellites."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Scalar
from coadjoint.errors import FileError
from coadjoint.groups import attitude
from coadjoint.identification.channels import ATTITUDE, VELOCITY

SPEEDS = ("north_speed", "east_speed", "down_speed")
OTHERS = ("pressure", "latitude", "longitude", *SPEEDS)
"""Measurements of sensors that are not columns of a vehicle: Pa, degrees, degrees, and m/s along axes of space."""


class WaterAbove(NamedTuple):
    """The pressure at the surface, Pa, and the density of the water, kg/m³."""

    surface: Scalar = 101325.0
    density: Scalar = 1025.0


AXIS, SQUARE = 6378137.0, 6.69437999014e-3
"""The ellipsoid WGS 84: the greater half axis, m, and the square of the eccentricity."""
GRAVITY = 9.80665
MOST_NORTH = 89.0


def converted(
    given: Mapping[str, np.ndarray], water: WaterAbove, origin: tuple[float, float] | None, where: str
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns with depth in place of a pressure, north and east in place of a fix, and notes.

    depth = (p − p_0)/(ρg) with g = 9.80665 m/s²; north = M(φ_0)(φ − φ_0), east = N(φ_0) cos φ_0 (λ − λ_0) with the
    radii of curvature of WGS 84, at most 50 km away. origin: φ_0 and λ_0, °; by default the first fix.
    Raises FileError for a fix without one of both, for places beyond that, and for duplicate columns.
    """
    found = {name: values for name, values in given.items() if name not in OTHERS}
    notes: list[str] = []
    if "pressure" in given:
        _require_once(found, ("depth", "z", "down", "up"), "pressure", where)
        found["depth"] = (given["pressure"] - water.surface) / (water.density * GRAVITY)
        notes.append(f"Depth is from the pressure of {where}: {water.surface:g} Pa above, {water.density:g} kg/m³.")
    fix = [name for name in ("latitude", "longitude") if name in given]
    if len(fix) == 1:
        raise FileError(f"{where}: a fix needs latitude and longitude, but has {fix[0]} alone.")
    if fix:
        _require_once(found, ("north", "east", "x", "y"), "latitude", where)
        north, east, at = _local(given["latitude"], given["longitude"], origin, where)
        found |= {"north": north, "east": east}
        if origin is None and at is not None:
            notes.append(f"North and east of {where} count from its first fix, {at[0]:.7f}°, {at[1]:.7f}°.")
    return found, notes


def _local(
    latitude: np.ndarray, longitude: np.ndarray, origin: tuple[float, float] | None, where: str
) -> tuple[np.ndarray, np.ndarray, tuple[float, float] | None]:
    good = np.flatnonzero(np.isfinite(latitude) & np.isfinite(longitude))
    if not len(good):
        return latitude, longitude, None
    at = origin or (float(latitude[good[0]]), float(longitude[good[0]]))
    meridian, across = _radii(at[0])
    north = meridian * np.radians(latitude - at[0])
    east = across * np.radians((longitude - at[1] + 180) % 360 - 180)
    far = np.nanmax(np.hypot(north, east))
    if far > 50_000 or abs(at[0]) > MOST_NORTH:
        raise FileError(
            f"{where}: a fix is {far / 1000:.0f} km from {at[0]:g}°, {at[1]:g}°: fixes are read up to 50 km from the "
            "origin; give another `origin`, and leave out fixes that are none."
        )
    return north, east, at


def _radii(latitude: float) -> tuple[float, float]:
    """M(φ) and N(φ) cos φ, m, of a latitude in degrees."""
    phi = np.radians(latitude)
    bend = 1 - SQUARE * np.sin(phi) ** 2
    return float(AXIS * (1 - SQUARE) / bend**1.5), float(AXIS / np.sqrt(bend) * np.cos(phi))


def fixes(position: np.ndarray, origin: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Latitude and longitude, °, of north and east of an origin; raises ArgumentError for an invalid origin."""
    fits = len(origin) == 2 and (np.all(np.isfinite(origin)) and abs(origin[0]) <= MOST_NORTH)
    checks.expect(fits, origin, "origin", "a latitude within 89° and a longitude")
    meridian, across = _radii(origin[0])
    east = (origin[1] + np.degrees(position[:, 1] / across) + 180) % 360 - 180
    return origin[0] + np.degrees(position[:, 0] / meridian), east


def along_body(given: Mapping[str, np.ndarray], columns: Mapping[str, np.ndarray], where: str) -> dict[str, np.ndarray]:
    """u, v, w, Rᵀv of the north, east and down speeds in `given`, with the attitude in `columns` of the same messages.

    columns: in north, east, down and forward, starboard, down. Empty where no such speed is given; raises FileError for
    some of three, and where u, v or w is there already.
    """
    if not any(name in given for name in SPEEDS):
        return {}
    both = {**given, **{name: columns[name] for name in ATTITUDE if name in columns}}
    for name in (*SPEEDS, *ATTITUDE):
        if name not in both or (name in ATTITUDE and name not in columns):
            needed = ", ".join((*SPEEDS, *ATTITUDE))
            raise FileError(f"{where}: speeds along axes of space need {needed}, but {name} is missing.")
    _require_once(columns, VELOCITY, SPEEDS[0], where)
    R = np.asarray(attitude.zyx(both["heading"], both["pitch"], both["roll"]))
    velocity = np.einsum("kij,ki->kj", R, np.stack([given[name] for name in SPEEDS], axis=1))
    return dict(zip(VELOCITY, velocity.T, strict=True))


def _require_once(found: Mapping[str, np.ndarray], names: tuple[str, ...], other: str, where: str) -> None:
    if twice := [name for name in names if name in found]:
        raise FileError(f"{where}: `{other}` says again what `{twice[0]}` says: leave one out.")
