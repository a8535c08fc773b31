"""Checks that arguments are numbers: truth values and texts are not, although NumPy would convert them."""

from __future__ import annotations

import numpy as np

from coadjoint.checks import is_number


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
