"""The measured fields of a part in a vehicle file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from coadjoint import units as u
from coadjoint.errors import ArgumentError
from coadjoint.vehicles import axes as border
from coadjoint.vehicles.files.table import Section
from coadjoint.vehicles.parts.measured import measures
from coadjoint.vehicles.parts.thrusters import COMMANDED


def read_fields(
    section: Section, cls: type, axes: border.Axes, commands: tuple[str, float, u.Dimension] | None = None
) -> dict[str, Any]:
    """The measured fields of a class of parts that are given, in SI units and FRD.

    commands: the unit of its commands, its size and what it measures. Raises ArgumentError for one that is missing.
    """
    values: dict[str, Any] = {}
    needed = {field.name for field in fields(cls) if field.default is MISSING}
    for name, found in measures(cls).items():
        if name not in section and name not in needed:
            continue
        if found.dimension == COMMANDED and commands is not None:
            unit, size, dimension = commands
            value, told = section.quantity(name, dimension, special=(unit, "SI"))
            values[name] = value if told in (unit, "SI") else (np.asarray(value) / size).tolist()
        else:
            value, _ = section.quantity(name, found.dimension)
            values[name] = value if found.turn is None else _turned(section, name, value, found.turn, axes)
    return values


def _turned(section: Section, name: str, value: Any, turn: Callable[[Any, Any], Any], axes: border.Axes) -> Any:
    """The value in FRD; raises ArgumentError for a shape that cannot turn."""
    try:
        return turn(np.asarray(value, dtype=float), axes)
    except (ArgumentError, ValueError) as error:
        shape = np.shape(value)
        raise section.fail(f"{name} must hold rows of three, or of six, numbers, but has the shape {shape}.") from error
