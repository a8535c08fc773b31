"""Named arrays in a row of numbers, and the numbers that a caller gives for them. NumPy alone."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError, shown
from coadjoint.paths import respelled


class Fields(NamedTuple):
    """Names and shapes, one after the other in a row. Knows NumPy only: a saved stepper is without JAX."""

    shapes: tuple[tuple[str, tuple[int, ...]], ...]

    @classmethod
    def of(cls, shapes: Mapping[str, tuple[int, ...]]) -> Fields:
        """From name → shape, in its order."""
        return cls(tuple((name, tuple(shape)) for name, shape in shapes.items()))

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in the order of the row."""
        return tuple(name for name, _ in self.shapes)

    @property
    def size(self) -> int:
        """How many numbers a row has."""
        return sum(math.prod(shape) for _, shape in self.shapes)

    @property
    def scalar(self) -> bool:
        """Whether every field is one number."""
        return all(shape == () for _, shape in self.shapes)

    def places(self) -> Iterator[tuple[str, tuple[int, ...], slice]]:
        """Name, shape and place of each field in the row."""
        start = 0
        for name, shape in self.shapes:
            end = start + math.prod(shape)
            yield name, shape, slice(start, end)
            start = end

    def place(self, name: str) -> slice:
        """The place of one field in the row."""
        return next(place for known, _, place in self.places() if known == name)

    def views(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Name → view (*lead, *shape) of rows (*lead, size)."""
        return {name: rows[..., place].reshape((*rows.shape[:-1], *shape)) for name, shape, place in self.places()}

    def unknown(self, name: object, what: str) -> str:
        """The message about an unknown name."""
        if path := respelled(str(name), self.names):
            return f"There is no {what} `{name}`: it is `{path}`."
        return f"There is no {what} `{name}`; there is: {', '.join(self.names) or 'none'}."


def variables(fields: Fields) -> list[str]:
    """The names of all numbers in a row, an array's with indices from 1 (FMI 2.0, 2.2.9: structured names)."""
    found = []
    for name, shape in fields.shapes:
        indices = product(*(range(1, size + 1) for size in shape))
        found += [name + (f"[{','.join(map(str, index))}]" if index else "") for index in indices]
    return found


MOST = 2**63 - 1
"""The most steps of one call."""


def whole(n: object) -> int:
    if isinstance(n, (bool, np.bool_)) or not isinstance(n, (int, np.integer)) or not 1 <= n <= MOST:
        raise ArgumentError(f"Argument `n` must be a whole number of at least 1, below 2⁶³, but is {shown(n)}.")
    return int(n)


def real(value: Any, what: str) -> np.ndarray:
    """Real numbers as a float64 array."""
    try:
        array = np.asarray(float(value) if value.__class__ is int else value)
    except (TypeError, ValueError, OverflowError):
        array = np.asarray(None)
    if array.dtype.kind not in "fiu" or truths(value):
        raise ArgumentError(f"{what} must be a number or an array of numbers, but is {shown(value)}.")
    return array.astype(np.float64, copy=False)


def truths(value: object) -> bool:
    """Whether there are truth values in a row, which NumPy takes for numbers among numbers."""
    return isinstance(value, (list, tuple)) and not _TRUTHS.isdisjoint(map(type, value))


_TRUTHS = frozenset((bool, np.bool_))


def write(place: np.ndarray, value: Any, what: str, members: int | None) -> None:
    """Write numbers into an array, of many members also the same ones into each member's."""
    array = value if value.__class__ is float else real(value, what)
    shape = np.shape(array)
    if shape != place.shape and (members is None or shape != place.shape[1:]):
        expected = "one number" if place.shape == () else f"shape {place.shape}"
        raise ArgumentError(f"{what} must have {expected}, but has shape {shape}.")
    place[...] = array


def seeds(given: object, members: int | None, which: np.ndarray) -> np.ndarray:
    """Seeds of the chosen members, non-negative integers."""
    try:
        array = np.asarray(given)
    except ValueError:
        array = np.asarray(None)
    expected = [()] if members is None else [(members,), (len(which),)]
    if array.dtype.kind not in "iu" or array.shape not in expected or np.any(array < 0):
        wanted = "a whole number from 0 on" if members is None else f"whole numbers, one for each of {members} members"
        raise ArgumentError(f"Argument `seed` must be {wanted}, but is {shown(given)}.")
    return array[which] if array.shape == (members,) else array.reshape(-1)


def named_file(given: object) -> Path:
    if not isinstance(given, (str, os.PathLike)):
        raise ArgumentError(f"Argument `path` must be the name of a file, such as remus.step, but is {shown(given)}.")
    return Path(given)
