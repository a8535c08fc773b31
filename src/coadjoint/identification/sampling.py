"""Segments of a log, the inputs of each of their steps, and the interpolation from nodes to samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.identification.log import Log

Between = Literal["held", "linear"]
"""The interpolation of inputs between samples."""

ON_NODE = 1e-6
"""A sample this part of a step away from a node is at the node."""


BREAK = 0.25
"""A gap of this part of a segment, or more, ends it: the next begins after the gap from a separate start."""

FEWEST = 4
"""The fewest samples of a segment."""

FEWEST_STEPS = 3
"""The fewest steps of the longest segment."""

GAP_STEPS = 1000
"""The most steps in which actuators are followed over a gap."""


class Interpolation(NamedTuple):
    """The nodes between which each number of the record is interpolated, (segments, samples, numbers, 4), with their
    weights and the derivatives of the weights by time, 1/s."""

    nodes: np.ndarray
    weights: np.ndarray
    slopes: np.ndarray


class StepsBetween(NamedTuple):
    """The steps from the start of the first segment to that of the last, (steps,): their start times, their lengths,
    and the mean of the inputs, (steps, numbers); `begins`: the step at which each segment starts."""

    times: np.ndarray
    lengths: np.ndarray
    inputs: np.ndarray
    begins: np.ndarray


@dataclass(frozen=True)
class Samples:
    """Segments of a log on grids of step h.

    `starts`: (segments,) s. `table`: (steps, segments, numbers), the mean of the inputs over each step. `rows`:
    (segments, samples), the sample of the log, −1 for none. `nodes`, `weights`: (segments, samples, 1 or 4), the nodes
    that a sample lies between and their parts in it: cubic interpolation. `turning`: the channels that are angles.
    `nodes_to_next`: the node at which the next segment starts. `steps_away`: (segments, samples), from the start of the
    segment. `early`: samples that a delay would put before the start. `after_gap`: segments before which the log has a
    gap that ended the one before.
    """

    h: float
    starts: np.ndarray
    table: np.ndarray
    rows: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray
    turning: np.ndarray
    nodes_to_next: np.ndarray
    steps_away: np.ndarray
    early: np.ndarray
    after_gap: np.ndarray

    def unwrapped(self, records: np.ndarray) -> np.ndarray:
        """Records whose angles do not jump."""
        records = records.copy()
        records[..., self.turning] = np.unwrap(records[..., self.turning], axis=1)
        return records

    def interpolation(self, delays: np.ndarray, steps: int) -> Interpolation:
        """The places of each number of the record for `delays` s in the log; records have so many steps."""
        x = self.steps_away[..., None] - delays / self.h
        nodes = _around(x, steps)
        return Interpolation(nodes, _lagrange(x, nodes), _lagrange_slopes(x, nodes) / self.h)

    def read(self, rows: np.ndarray, nodes: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(segments, steps, …, numbers) as (segments, samples, …, numbers), each number at its own time."""
        segments, numbers = np.arange(len(rows))[:, None, None], np.arange(rows.shape[-1])
        spread = (..., *[None] * (rows.ndim - 3))
        parts = (rows[segments, nodes[..., k], ..., numbers] * weights[..., k][spread] for k in range(4))
        return np.moveaxis(sum(parts), 2, -1)  # type: ignore[arg-type]

    def weighed(self, rows: np.ndarray) -> np.ndarray:
        """(segments, steps, …) at the samples (segments, samples, …)."""
        segments = np.arange(len(rows))[:, None]
        spread = (..., *[None] * (rows.ndim - 2))
        if self.nodes.shape[2] == 1:
            return rows[segments, self.nodes[..., 0]]
        parts = (rows[segments, self.nodes[..., k]] * self.weights[..., k][spread] for k in range(4))
        return sum(parts)  # type: ignore[return-value]


def samples(
    log: Log, turning: np.ndarray, h: float, segment: float | None, between: Between, reach: float = 0.0
) -> Samples:
    """Segments of about `segment` s, or one; raises ArgumentError where one would hold fewer than four samples.

    A gap in the log of BREAK segments ends a segment; parts of fewer than four samples between gaps are not used.
    `reach`: the time before and after its samples for which a segment is simulated, for sensors with delays, s; the
    first one, and one after a gap, starts at its first sample.
    """
    first, last, continued = _cuts(log, segment)
    count, number = len(first), np.arange(len(log))
    owner = np.searchsorted(first, number, side="right") - 1
    owner = np.where((owner >= 0) & (number <= last[owner]), owner, -1)
    here, place = owner >= 0, number - first[owner]
    ahead = np.where(continued, np.ceil(reach / h - 1e-9) * h, 0.0)
    starts = log.time[first] - ahead
    rows = np.full((count, place[here].max() + 1), -1)
    rows[owner[here], place[here]] = number[here]
    steps_away = np.where(rows >= 0, (log.time[rows] - starts[:, None]) / h, 0.0)
    to_next = np.diff(starts) / h
    longest = float(np.max(log.time[last] - log.time[first]))
    if longest < (FEWEST_STEPS - ON_NODE) * h:
        what, or_ = ("The log", "") if segment is None else ("The longest segment", ", or a longer `segment`")
        raise ArgumentError(
            f"{what} lasts {longest:.3g} s, shorter than {FEWEST_STEPS} steps of {h:.3g} s: take a smaller `dt`{or_}; "
            "are times in seconds?"
        )
    farthest = max(steps_away.max(), np.where(continued[1:], to_next, 0.0).max(initial=0.0))
    steps = int(np.ceil(farthest + reach / h)) + 2
    nodes, weights = _interpolation(steps_away, steps)
    inputs = _columns(log)
    edges = starts[None, :] + h * np.arange(steps + 1)[:, None]
    table = np.diff(_integral(log.time, inputs, edges, between), axis=0) / h
    following = np.minimum(np.rint(to_next).astype(int), steps - 1)
    after_gap = ~continued & (number[:count] > 0)
    early = steps_away * h < np.where(continued, 0.0, reach)[:, None]
    return Samples(h, starts, table, rows, nodes, weights, turning, following, steps_away, early, after_gap)


def steps_between(log: Log, cut: Samples, between: Between) -> StepsBetween:
    """The steps of each segment's grid, the last before the next start shorter; over a gap, no more than GAP_STEPS."""
    starts, last = np.maximum.accumulate(cut.starts), cut.starts + cut.h * cut.steps_away.max(axis=1)
    edges, begins = [starts[:1]], [0]
    for start, end, following, gap in zip(starts, last, starts[1:], cut.after_gap[1:], strict=False):
        parts = [_grid(start, end if gap else following, cut.h)]
        if gap:
            parts.append(_grid(end, following, max(cut.h, (following - end) / GAP_STEPS)))
        edges += parts
        begins.append(begins[-1] + sum(map(len, parts)))
    times = np.concatenate(edges)
    lengths = np.diff(times)
    means = np.diff(_integral(log.time, _columns(log), times, between), axis=0) / lengths[:, None]
    return StepsBetween(times[:-1], lengths, means, np.array(begins))


def _grid(first: float, last: float, h: float) -> np.ndarray:
    """The ends of steps of h from `first`, of which the last is `last`; none where that is not later."""
    count = int(np.ceil((last - first) / h - ON_NODE))
    return np.append(first + h * np.arange(1, count), [last] if count > 0 else [])


def _columns(log: Log) -> np.ndarray:
    """All numbers of the inputs, (samples, numbers)."""
    return np.concatenate([np.zeros((len(log), 0)), *(v.reshape(len(log), -1) for v in log.inputs.values())], axis=1)


def _cuts(log: Log, segment: float | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of every segment: its first sample, its last, and whether it follows upon another without a gap."""
    if segment is None and not log.breaks:
        return np.array([0]), np.array([len(log) - 1]), np.array([False])
    longest = np.inf if segment is None else max(BREAK * segment, FEWEST * log.interval)
    gaps = np.union1d(np.flatnonzero(np.diff(log.time) > longest), np.array(log.breaks, int) - 1)
    first: list[int] = []
    last: list[int] = []
    continued: list[bool] = []
    ends = [int(i) for i in gaps]
    for begin, end in zip([0, *(i + 1 for i in ends)], [*ends, len(log) - 1], strict=True):
        if end - begin + 1 < FEWEST and len(gaps):
            continue
        length = log.time[end] - log.time[begin]
        count = 1 if segment is None else max(1, round(length / segment))
        borders = log.time[begin] + length / count * np.arange(count)
        cut = np.searchsorted(log.time, borders - 1e-9 * log.duration)
        if np.any(np.diff(np.append(cut, end + 1)) < FEWEST):
            seldom = segment is not None and log.interval * FEWEST > segment
            raise ArgumentError(
                f"Segments of {segment or length:g} s hold fewer than four samples somewhere: take longer ones "
                "than `segment`" + (f"; samples are {log.interval:g} s apart: are times in seconds?" if seldom else ".")
            )
        first += list(cut)
        last += [*(cut[1:] - 1), end]
        continued += [False] + [True] * (count - 1)
    if not first:
        gap, remedy = ("", "") if segment is None else (f" of {BREAK * segment:g} s", ": take a longer `segment`")
        raise ArgumentError(f"No stretch of the log between gaps{gap} holds four samples{remedy}.")
    return np.array(first), np.array(last), np.array(continued)


def _interpolation(x: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """The nodes around each x, in steps, and Lagrange's weights."""
    if np.all(np.abs(x - np.rint(x)) < ON_NODE):
        return np.rint(x).astype(int)[..., None], np.ones((*x.shape, 1))
    nodes = _around(x, steps)
    return nodes, _lagrange(x, nodes)


def _around(x: np.ndarray, steps: int) -> np.ndarray:
    """The four nodes around each x, a last axis; there are at least so many steps."""
    return np.clip(np.floor(x).astype(int) - 1, 0, steps - 4)[..., None] + np.arange(4)


def _lagrange(x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Π_{j≠k}(x − x_j)/(x_k − x_j)."""
    weights = np.ones(nodes.shape)
    for k in range(4):
        for j in range(4):
            if j != k:
                weights[..., k] *= (x - nodes[..., j]) / (nodes[..., k] - nodes[..., j])
    return weights


def _lagrange_slopes(x: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Derivatives by x: Σ_{i≠k} 1/(x_k − x_i) Π_{j≠i,k}(x − x_j)/(x_k − x_j)."""
    slopes = np.zeros(nodes.shape)
    for k in range(4):
        for i in range(4):
            if i == k:
                continue
            part = 1.0 / (nodes[..., k] - nodes[..., i])
            for j in range(4):
                if j not in (i, k):
                    part = part * (x - nodes[..., j]) / (nodes[..., k] - nodes[..., j])
            slopes[..., k] += part
    return slopes


def _integral(time: np.ndarray, values: np.ndarray, at: np.ndarray, between: Between) -> np.ndarray:
    """∫ u dt from the first sample to `at`; the first and the last value extend outside."""
    gaps = np.diff(time)[:, None]
    slopes = np.diff(values, axis=0) / gaps if between == "linear" else np.zeros((len(time) - 1, values.shape[1]))
    pieces = values[:-1] * gaps + 0.5 * slopes * gaps**2
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(pieces, axis=0)])
    slopes = np.concatenate([slopes, np.zeros((1, values.shape[1]))])
    i = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)
    d = (at - time[i])[..., None]
    return total[i] + values[i] * d + 0.5 * np.where(d < 0, 0.0, slopes[i]) * d**2
