"""Motions and measurements drawn from the model of a filter, for many members at once."""

from __future__ import annotations

import numpy as np

from coadjoint.estimation import Filter


def drawn(process, rows, noises, steps, h, random):
    """Rows (steps + 1, members, size) of a process with white noise of the roots `noises` (n,) in its errors."""
    found = [rows]
    for _ in range(steps):
        e = noises * np.sqrt(h) * random.normal(size=(len(rows), process.width))
        rows = process.moved(process.advanced(rows, h), e)
        found.append(rows)
    return np.stack(found)


def around(process, row, P, members, random):
    """Rows (members, size) whose errors about a row are normal with the covariance P."""
    values, vectors = np.linalg.eigh(P)
    e = (random.normal(size=(members, len(P))) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return process.moved(np.repeat(row[None], members, axis=0), e)


def measured(filter: Filter, truth, times, every, random):
    """name → (times, values (K, members, m)) of what is measured at every so many steps of true rows."""
    seen = {}
    for name, one in filter._prepared.items():
        rows = truth[every[name] :: every[name]]
        shape = rows.shape[:2]
        values, _ = one.function(np.zeros((shape[0] * shape[1], filter.process.width)), rows.reshape(-1, rows.shape[2]))
        noise = random.normal(size=(*shape, len(one.covariance))) @ np.linalg.cholesky(one.covariance).T
        seen[name] = times[every[name] :: every[name]], values.reshape(*shape, -1) + noise
    return seen
