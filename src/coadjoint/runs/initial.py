"""Initial values in the form of run files: units in key names, and yaw, pitch, roll one by one."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from coadjoint import units as u
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.sections import in_si
from coadjoint.texts import Table

KINDS = {
    "t": u.TIME,
    "position": u.LENGTH,
    "velocity": u.SPEED,
    "speed": u.SPEED,
    "euler_zxz": u.ANGLE,
    "euler_zyx": u.ANGLE,
    "yaw": u.ANGLE,
    "pitch": u.ANGLE,
    "roll": u.ANGLE,
    "angular_velocity": u.ANGULAR_VELOCITY,
    "euler_rates": u.ANGULAR_VELOCITY,
}
"""The quantities of initial values."""

_ANGLES = ("yaw", "pitch", "roll")


def initial_values(given: Mapping[str, object], known: Collection[str]) -> Table:
    """A section [initial] under its known names, in SI units.

    Where `euler_zyx` is known, `yaw`, `pitch` and `roll` are too, 0 unless given. Raises ArgumentError.
    """
    if "euler_zyx" not in known:
        return in_si("initial", given, known, KINDS)
    found = in_si("initial", given, [*known, *_ANGLES], KINDS)
    angles = {name: found.pop(name) for name in _ANGLES if name in found}
    if angles:
        if "euler_zyx" in found:
            raise ArgumentError(f"[initial] gives both `euler_zyx` and `{next(iter(angles))}`: leave one out.")
        found["euler_zyx"] = together([angles.get(name, 0.0) for name in _ANGLES])
    return found


def together(values: list[Any]) -> PyTree:
    """Numbers as one vector; with `co.each` among them, one for each member."""
    many = {len(value): value for value in values if hasattr(value, "member")}
    if not many:
        return values
    ((count, some),) = many.items()
    columns = [value.values if hasattr(value, "member") else [value] * count for value in values]
    return type(some)(np.stack([np.asarray(column, dtype=float) for column in columns], axis=-1))
