"""What a field of a part or a controller measures: declared once, read by files, checks and units of keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, field, fields
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.models.quantities import direction, not_negative, number, vector
from coadjoint.units import LENGTH, NUMBER, Dimension
from coadjoint.vehicles import axes as border


class Measured(NamedTuple):
    """dimension: None where the numbers measure several things, in SI units. check: (value, name) → the value, or
    ArgumentError. turn: (value, axes) → the value in forward, starboard, down. words: those that the field may be."""

    dimension: Dimension | None
    check: Callable[[Any, str], Any] | None = None
    turn: Callable[[Any, Any], Any] | None = None
    words: tuple[str, ...] = ()


def measured(
    dimension: Dimension | None,
    check: Callable[[Any, str], Any] | None = number,
    *,
    turn: Callable[[Any, Any], Any] | None = None,
    words: tuple[str, ...] = (),
    default: Any = MISSING,
) -> Any:
    """A field of a dataclass with what it measures, `area: Any = measured(AREA, not_negative)`; see `Measured`."""
    return field(default=default, metadata={"measured": Measured(dimension, check, turn, words)})


def share(value: Any, name: str) -> Any:
    """A number from 0 to 1; raises ArgumentError."""
    found = not_negative(value, name)
    if not traced(found) and found > 1:
        raise ArgumentError(f"Argument `{name}` must be at most 1, but is {float(found):g}.")
    return found


def lag_or_none(value: Any, name: str) -> Any:
    """A time of at least 0, None for 0; raises ArgumentError."""
    return not_negative(value, name) or None


def numbers(size: int) -> Callable[[Any, str], Any]:
    """The check of a vector (size,)."""
    return partial(vector, size=size)


def six(value: Any, axes: Any) -> Any:
    """A (6, 6) matrix turned from other axes; a diagonal keeps its signs."""
    return value if np.ndim(value) == 1 else border.twist_matrix(value, axes)


place = partial(measured, LENGTH, vector, turn=border.body_vector)
"""A point of the body, (3,) m."""
way = partial(measured, NUMBER, direction, turn=border.body_vector)
"""A unit vector of the body, (3,)."""


def measures(of: Any) -> dict[str, Measured]:
    """What the fields of a class, or of one of it, measure, by name, in their order."""
    return {f.name: f.metadata["measured"] for f in fields(of) if "measured" in f.metadata}


def check_fields(of: Any, whose: str = "") -> None:
    """Give every measured field its checked value; raises ArgumentError, naming the field and `whose` it is.

    A field that is None by default may be None.
    """
    for f in fields(of):
        value, found = getattr(of, f.name), f.metadata.get("measured")
        if found is None or (value is None and f.default is None):
            continue
        name = f"{f.name}` of the {whose}" if whose else f.name
        if found.words and value not in found.words:
            words = " or ".join(f'"{word}"' for word in found.words)
            raise ArgumentError(f"Argument `{name}` must be {words}, but is {value!r}.")
        if found.check is not None:
            object.__setattr__(of, f.name, found.check(value, name))
