"""The mounting of a log's sensor in the body, and its measurements along the axes of the body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError, FileError
from coadjoint.groups import attitude
from coadjoint.identification.channels import ATTITUDE, POSITION, RATES, VELOCITY

FARTHEST = 100.0
"""m from O; beyond it no sensor of a vehicle is."""


class Mounting(NamedTuple):
    """r of a sensor in the body, m, and yaw, pitch and roll of its axes in those of the body, rad, both in FRD.

    None is not known, and counts as O and as the axes of the body.
    """

    position: tuple[float, float, float] | None = None
    euler_zyx: tuple[float, float, float] | None = None

    @property
    def M(self) -> np.ndarray:
        """From the axes of the sensor to those of the body, (3, 3)."""
        return np.asarray(attitude.zyx(*(self.euler_zyx or (0.0, 0.0, 0.0))))

    def completed(self, by: Mounting) -> Mounting:
        """This mounting, with unknown values taken from the other."""
        return Mounting(*(there if here is None else here for here, there in zip(self, by, strict=True)))

    def said(self) -> str:
        """Where it sits and how it is turned, in words with units; empty at O along the axes of the body."""
        at, turned = self.position or (), np.degrees(self.euler_zyx or ())
        place = f"at {', '.join(f'{x:g}' for x in at)} m forward, starboard and down of the origin O" if any(at) else ""
        turn = f"turned by yaw, pitch and roll of {', '.join(f'{x:.4g}' for x in turned)}°" if any(turned) else ""
        return " and ".join(part for part in (place, turn) if part)


def require_place(position: np.ndarray, where: str) -> None:
    """Raise FileError for a place where no sensor is."""
    if not np.all(np.abs(position) <= FARTHEST):
        raise FileError(f"{where}: a sensor sits at most {FARTHEST:g} m from the origin O: give `position_m` in m.")


def along_the_body(columns: Mapping[str, np.ndarray], mounting: Mounting, where: str) -> dict[str, np.ndarray]:
    """Columns whose velocity and rates are M y, and whose attitude is R Mᵀ, of a sensor that measured y and R.

    Raises FileError if it measured only some of three components, which do not determine the others.
    """
    found = dict(columns)
    if not any(mounting.euler_zyx or ()):
        return found
    for names in (VELOCITY, RATES, ATTITUDE):
        there = [name for name in names if name in columns]
        if there and len(there) < 3:
            raise FileError(
                f"{where}: a sensor that is turned in the body needs {', '.join(names)} together, but has "
                f"{', '.join(there)}."
            )
    for names in (VELOCITY, RATES):
        if names[0] in columns:
            turned = np.stack([columns[name] for name in names], axis=1) @ mounting.M.T
            found |= dict(zip(names, turned.T, strict=True))
    if ATTITUDE[0] in columns:
        angles = np.stack([columns[name] for name in ATTITUDE[::-1]])
        told = np.isfinite(angles).all(axis=0)
        body = np.full_like(angles, np.nan)
        R = np.asarray(attitude.zyx(*angles[:, told]))
        body[:, told] = np.stack(attitude.zyx_angles(R @ mounting.M.T))
        found |= dict(zip(ATTITUDE[::-1], body, strict=True))
    return found


def positions(columns: Mapping[str, np.ndarray], mounting: Mounting) -> dict[str, tuple[float, float, float]]:
    """r by the columns that depend on where the sensor sits; none of a sensor at O."""
    r = mounting.position
    if r is None or not any(r):
        return {}
    return {name: r for name in columns if name in (*POSITION, *VELOCITY)}


def mounting_of(own: Mapping[str, str], name: str, where: str) -> Mounting:
    """The mounting of a sensor in the metadata of a bag; raises FileError for an invalid one."""
    found = {}
    for key in ("position", "euler_zyx"):
        try:
            numbers = [float(word) for word in own.get(f"{key}.{name}", "0 0 0").split()]
        except ValueError:
            numbers = []
        if len(numbers) != 3 or not np.all(np.isfinite(numbers)):
            raise FileError(f"{where}: `{key}.{name}` in the metadata must be three numbers.")
        found[key] = tuple(numbers)
    require_place(np.asarray(found["position"]), where)
    return Mounting(**found)


def require_at_origin(positions: Mapping[str, tuple[float, float, float]], what: str) -> None:
    """Raise ArgumentError for a log that a file cannot hold, because it does not say where sensors sit."""
    if positions:
        name, r = next(iter(positions.items()))
        raise ArgumentError(
            f"{what} does not say where sensors sit, but `{name}` of this log was measured at {list(r)} m: keep the "
            "bag that it was read from with its declaration."
        )
