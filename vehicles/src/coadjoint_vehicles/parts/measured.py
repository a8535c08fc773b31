"""The dimension of a field of a part or a controller: declared once, read by files, checks and units of keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.models.quantities import angles, direction, number, positive, vector
from coadjoint.models.quantities import not_negative as not_negative
from coadjoint.sections import checked, key, keys
from coadjoint.units import LENGTH, NUMBER, Dimension
from coadjoint_vehicles import axes as border

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from coadjoint.mechanics.members import Each

    class Measured:
        """A field that takes numbers, those of members as `co.each(…)`, or None where it may be left out."""

        def __get__(self, of: object, kind: type) -> PyTree: ...

        def __set__(self, of: object, value: ArrayLike | Mapping[str, ArrayLike] | Each | None) -> None: ...
else:  # read by type checkers alone
    Measured = Any


def measured(
    dimension: Dimension | None,
    check: Callable[[PyTree, str], PyTree] | None = number,
    *,
    turn: Callable[[PyTree, PyTree], PyTree] | None = None,
    words: tuple[str, ...] = (),
    default: object = MISSING,
) -> Any:
    """A field with its dimension, `area: Measured = measured(AREA, not_negative)`, as `sections.key` declares it.

    dimension: None where the numbers measure several things, in SI units. check: (value, name) → the value, or
    ArgumentError. turn: (value, axes) → the value in forward, starboard, down. words: those that the field may be.
    """
    return key("", dimension, check=check, turn=turn, words=words, default=default)


def share(value: object, name: str) -> PyTree:
    """A number from 0 to 1; raises ArgumentError."""
    found = not_negative(value, name)
    if not traced(found) and found > 1:
        raise ArgumentError(f"Argument `{name}` must be at most 1, but is {float(found):g}.")
    return found


def lag_or_none(value: object, name: str) -> PyTree:
    """A time of at least 0, None for 0; raises ArgumentError."""
    return not_negative(value, name) or None


def numbers(size: int) -> Callable[[PyTree, str], PyTree]:
    """The check of a vector (size,)."""
    return partial(vector, size=size)


def six(value: Any, axes: PyTree) -> Array:
    """A (6, 6) matrix turned from other axes; a diagonal keeps its signs."""
    return value if np.ndim(value) == 1 else border.twist_matrix(value, axes)


place = partial(measured, LENGTH, vector, turn=border.body_vector)
"""A point of the body, (3,) m."""
way = partial(measured, NUMBER, direction, turn=border.body_vector)
"""A unit vector of the body, (3,)."""


def angle_within(most: float, words: str) -> Callable[[PyTree, str], PyTree]:
    """The check of angles, rad, of at most `most` in size, which sentences call `words`."""

    def check(value: object, name: str) -> PyTree:
        found = angles(value, name)
        if not traced(found) and np.any(np.abs(found) > most * (1 + 1e-12)):
            raise ArgumentError(
                f"Argument `{name}` must be at most {words} rad, but is {np.asarray(found).tolist()} rad: give degrees "
                "by np.radians, or in a file with their unit."
            )
        return found

    return check


def acute(value: object, name: str) -> PyTree:
    """A positive angle of at most π/2, rad; raises ArgumentError."""
    return angle_within(0.5 * np.pi, "a right angle, π/2")(positive(value, name), name)


def check_fields(of: Any, whose: str = "") -> None:
    """Give every measured field its checked value; raises ArgumentError, naming the field and `whose` it is.

    A field that is None by default may be None.
    """
    usual = {f.name: f.default for f in fields(of)}
    for name, declared in keys(of).items():
        value = getattr(of, name)
        if value is not None or usual[name] is not None:
            object.__setattr__(of, name, checked(declared, value, f"{name}` of the {whose}" if whose else name))
