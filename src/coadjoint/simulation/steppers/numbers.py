"""Numbers, and names of files, that a caller gives to a stepper, checked with NumPy alone."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError, shown

MOST = 2**63 - 1
"""The most steps of one call."""


def whole(n: Any) -> int:
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


def truths(value: Any) -> bool:
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


def seeds(given: Any, members: int | None, which: np.ndarray) -> np.ndarray:
    """Seeds of the members that are meant, whole numbers from 0 on."""
    try:
        array = np.asarray(given)
    except ValueError:
        array = np.asarray(None)
    expected = [()] if members is None else [(members,), (len(which),)]
    if array.dtype.kind not in "iu" or array.shape not in expected or np.any(array < 0):
        wanted = "a whole number from 0 on" if members is None else f"whole numbers, one for each of {members} members"
        raise ArgumentError(f"Argument `seed` must be {wanted}, but is {shown(given)}.")
    return array[which] if array.shape == (members,) else array.reshape(-1)


def named_file(given: Any) -> Path:
    if not isinstance(given, (str, os.PathLike)):
        raise ArgumentError(f"Argument `path` must be the name of a file, such as remus.step, but is {shown(given)}.")
    return Path(given)
