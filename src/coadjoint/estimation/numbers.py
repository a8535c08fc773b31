"""Checks that arguments are numbers: truth values and texts are not, although NumPy would convert them."""

from __future__ import annotations

import numpy as np

from coadjoint import checks
from coadjoint.checks import is_number
from coadjoint.errors import ArgumentError


def float64(value: object) -> np.ndarray:
    """Numbers as an array, None among them as NaN; raises TypeError or ValueError for anything else."""
    found = np.asarray(value)
    if found.dtype == object and all(one is None or is_number(one) for one in found.flat):
        return found.astype(float)
    if found.dtype.kind not in "iuf":
        raise TypeError(f"{found.dtype} is not a numeric type")
    return found.astype(float)


def numbers(value: object) -> np.ndarray:
    """Numbers as an array; NaN for anything else."""
    try:
        return float64(value)
    except (TypeError, ValueError):
        return np.asarray(np.nan)


def input_of_members(value: object, name: str, shape: tuple[int, int]) -> np.ndarray:
    """(members, size), or (size,) for all; raises ArgumentError."""
    found = numbers(value)
    members, size = shape
    if found.shape not in ((), (size,), shape) or found.size not in (size, members * size):
        raise ArgumentError(
            f"The input `{name}` is {size} numbers, or ({members}, {size}) of all members, but has the shape "
            f"{found.shape}."
        )
    checks.expect(np.all(np.isfinite(found)), value, f"The input `{name}`", "finite numbers")
    return found.reshape(-1, size)
