"""Rows of numbers in the SIMD lanes of machine code, and back. NumPy alone, for saved steppers."""

from __future__ import annotations

import numpy as np


def in_lanes(rows: np.ndarray, width: int, groups: int | None = None) -> np.ndarray:
    """Rows (count, n) as (groups, n, width); idle lanes and groups repeat the last row.

    groups: by default as many as hold all rows.
    """
    groups = -(-len(rows) // width) if groups is None else groups
    if width == 1 and groups == len(rows):
        return np.array(rows, np.float64, order="C")[:, :, None]
    index = np.minimum(np.arange(groups * width), len(rows) - 1).reshape(groups, width)
    return np.ascontiguousarray(rows[index].swapaxes(1, 2), np.float64)


def of_lanes(grouped: np.ndarray, count: int | None = None) -> np.ndarray:
    """An array (groups, …, width) by rows, (count, …), without idle lanes; by default all lanes.

    A copy of numbers (groups, n, width); of more axes it may be a view.
    """
    if grouped.ndim == 3:
        groups, size, width = grouped.shape
        return grouped.swapaxes(1, 2).reshape(groups * width, size)[:count].copy()
    if grouped.shape[-1] == 1:
        return grouped[:count, ..., 0]
    moved = np.moveaxis(grouped, -1, 1)
    return moved.reshape(moved.shape[0] * moved.shape[1], *moved.shape[2:])[:count]
