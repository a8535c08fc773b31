"""Fewer points for the same picture: a long run with every extreme kept, and a random choice of many members."""

from __future__ import annotations

import numpy as np

CAPACITY = 4000
"""The most points of a curve before it is thinned: some ten for every dot of a column's width in print."""


def thin(*series: np.ndarray, capacity: int = CAPACITY) -> np.ndarray:
    """The indices to draw: of every stretch of time where any of the series is lowest or highest, and both ends.

    series: (nodes,) or (nodes, components), all with the same nodes. All indices if there are few. The result is
    increasing, and every series has the same minimum and maximum on it as on all nodes.
    """
    columns = np.column_stack([np.asarray(values, dtype=np.float64).reshape(len(values), -1) for values in series])
    nodes, count = columns.shape
    stretches = max(capacity // (2 * count), 1)
    if nodes <= capacity or nodes <= stretches:
        return np.arange(nodes)
    starts = np.linspace(0, nodes, stretches, endpoint=False).astype(int)
    ends = np.append(starts[1:], nodes)
    lowest, highest = np.minimum.reduceat(columns, starts), np.maximum.reduceat(columns, starts)
    stretch = np.repeat(np.arange(stretches), ends - starts)
    kept = [np.array([0, nodes - 1])]
    for bound in (lowest, highest):
        for column in range(count):
            hits = np.flatnonzero(columns[:, column] == bound[stretch, column])
            # The first hit of each stretch is enough: a constant curve hits everywhere.
            kept.append(hits[np.unique(stretch[hits], return_index=True)[1]])
    return np.unique(np.concatenate(kept))


def some(count: int, most: int) -> np.ndarray:
    """The indices of `most` of so many members, or of all, increasing: a random choice, reproducible.

    Members are often in an order, as those of a grid or of Sobol' points, of which every k-th shows a part alone.
    """
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))
