"""Motions and measurements drawn from the model of a filter, for many members at once."""

from __future__ import annotations

import numpy as np

from coadjoint.estimation import Filter


def drawn(process, rows, steps, h, random):
    """Rows (steps + 1, members, size) of a process with its own noise."""
    found = [rows]
    for _ in range(steps):
        found.append(process.drawn(found[-1], h, random))
    return np.stack(found)


def around(process, row, P, members, random):
    """Rows (members, size) whose errors about a row are normal with the covariance P."""
    e = random.multivariate_normal(np.zeros(len(P)), P, members)
    return process.moved(np.repeat(row[None], members, axis=0), e)


def measured(filter: Filter, truth, times, every, random):
    """name → (times, values (K, members, m)) of what is measured at every so many steps of true rows."""
    seen = {}
    for name, values in filter.expected(truth).items():
        R, k = filter.measurements[name].covariance, every[name]
        R = R if R.ndim == 2 else np.diag(np.broadcast_to(R, values.shape[-1:]))
        noise = random.multivariate_normal(np.zeros(len(R)), R, values[k::k].shape[:2])
        seen[name] = times[k::k], values[k::k] + noise
    return seen
