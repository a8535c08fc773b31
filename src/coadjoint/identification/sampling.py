"""How a log is cut into segments, what drives each step of them, and how nodes become samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.identification.log import Log

Between = Literal["held", "linear"]
"""How inputs run between samples."""

ON_NODE = 1e-6
"""A sample this part of a step away from a node is at the node."""


@dataclass(frozen=True)
class Samples:
    """Segments of a log on grids of step h.

    `starts`: (segments,) s. `table`: (steps, segments, numbers), the mean of the inputs over each step. `rows`:
    (segments, samples), which sample of the log, −1 where there is none. `nodes`, `weights`: (segments, samples, 1 or
    4), the nodes that a sample lies between and their parts in it: cubic interpolation. `turning`: the channels that
    are angles. `nodes_to_next`: at which node the next segment starts.
    """

    h: float
    starts: np.ndarray
    table: np.ndarray
    rows: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray
    turning: np.ndarray
    nodes_to_next: np.ndarray

    def taken(self, records: np.ndarray) -> np.ndarray:
        """Records (segments, steps, channels) at the samples (segments, samples, channels)."""
        records = records.copy()
        records[..., self.turning] = np.unwrap(records[..., self.turning], axis=1)
        return self.weighed(records)

    def weighed(self, rows: np.ndarray) -> np.ndarray:
        """(segments, steps, …) at the samples (segments, samples, …)."""
        segments = np.arange(len(rows))[:, None]
        spread = (..., *[None] * (rows.ndim - 2))
        if self.nodes.shape[2] == 1:
            return rows[segments, self.nodes[..., 0]]
        parts = (rows[segments, self.nodes[..., k]] * self.weights[..., k][spread] for k in range(4))
        return sum(parts)  # type: ignore[return-value]


def samples(log: Log, turning: np.ndarray, h: float, segment: float | None, between: Between) -> Samples:
    """Segments of about `segment` s, or one; raises ArgumentError where one would hold fewer than four samples."""
    count = 1 if segment is None else max(1, round(log.duration / segment))
    borders = log.time[0] + log.duration / count * np.arange(count)
    first = np.searchsorted(log.time, borders - 1e-9 * log.duration)
    if np.any(np.diff([*first, len(log)]) < 4):
        raise ArgumentError(
            f"Segments of {segment:g} s hold fewer than four samples somewhere: take longer ones than `segment`."
        )
    starts = log.time[first]
    owner = np.searchsorted(first, np.arange(len(log)), side="right") - 1
    place = np.arange(len(log)) - first[owner]
    rows = np.full((count, place.max() + 1), -1)
    rows[owner, place] = np.arange(len(log))
    steps_away = np.where(rows >= 0, (log.time[rows] - starts[:, None]) / h, 0.0)
    steps = int(np.ceil(max(steps_away.max(), (np.diff(starts) / h).max(initial=0.0)))) + 2
    nodes, weights = _interpolation(steps_away, steps)
    inputs = np.concatenate([np.zeros((len(log), 0)), *(v.reshape(len(log), -1) for v in log.inputs.values())], axis=1)
    edges = starts[None, :] + h * np.arange(steps + 1)[:, None]
    table = np.diff(_integral(log.time, inputs, edges, between), axis=0) / h
    return Samples(h, starts, table, rows, nodes, weights, turning, np.rint(np.diff(starts) / h).astype(int))


def _interpolation(x: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """The nodes around each x, in steps, and Lagrange's weights."""
    if np.all(np.abs(x - np.rint(x)) < ON_NODE):
        return np.rint(x).astype(int)[..., None], np.ones((*x.shape, 1))
    nodes = np.clip(np.floor(x).astype(int) - 1, 0, max(steps - 4, 0))[..., None] + np.arange(4)
    weights = np.ones(nodes.shape)
    for k in range(4):
        for j in range(4):
            if j != k:
                weights[..., k] *= (x - nodes[..., j]) / (nodes[..., k] - nodes[..., j])
    return nodes, weights


def _integral(time: np.ndarray, values: np.ndarray, at: np.ndarray, between: Between) -> np.ndarray:
    """∫ u dt from the first sample to `at`; the first and the last value go on outside."""
    gaps = np.diff(time)[:, None]
    slopes = np.diff(values, axis=0) / gaps if between == "linear" else np.zeros((len(time) - 1, values.shape[1]))
    pieces = values[:-1] * gaps + 0.5 * slopes * gaps**2
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(pieces, axis=0)])
    slopes = np.concatenate([slopes, np.zeros((1, values.shape[1]))])
    i = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)
    d = (at - time[i])[..., None]
    return total[i] + values[i] * d + 0.5 * np.where(d < 0, 0.0, slopes[i]) * d**2
