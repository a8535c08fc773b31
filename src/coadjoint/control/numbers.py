"""Numbers that a user gave."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError, shown


def number(value: Any, name: str, nan: bool = False) -> np.ndarray:
    """A number or an array of them, of NaN too where that is allowed; raises ArgumentError for anything else."""
    try:
        found = np.asarray(np.nan if np.iscomplexobj(value) else value, float)
    except (TypeError, ValueError):
        raise ArgumentError(f"Argument `{name}` must be numbers, but is {shown(value)}.") from None
    if np.iscomplexobj(value) or (np.any(np.isnan(found)) and not nan):
        raise ArgumentError(f"Argument `{name}` must be numbers, but is {shown(value)}.")
    return found
