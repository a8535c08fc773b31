"""Accuracy of the steps of a filter by a system's own model, relative to the motion and to the claimed deviations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from coadjoint.arrays import PyTree, Scalar
from coadjoint.estimation.process import Process
from coadjoint.estimation.timetable import Orders
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.simulation.accuracy.local_error import HALVES, PartsOfSteps
from coadjoint.simulation.accuracy.verdict import MEMBERS, SampledSteps

TOO_MUCH = 2.0
"""The number of deviations that the errors of the steps may add up to."""

SAFELY, LONG = 10.0, 100
"""The time over which errors of steps of the proposed dt may add up, in times until now, and its least number of
steps."""

NODES = 16
"""The number of nodes of a log at which steps are judged."""


class FilterSample:
    """The steps of a filter that are judged, as `SampledSteps`, and besides by its covariance.

    Each step is off by e, the same way as the last one. Measurements of a coordinate take the share 1 − ρ of its error
    away in a step, with ρ = Pᵢᵢ/P⁺ᵢᵢ before and after the prediction, where the filter has settled. So the errors add
    up to eᵢ min(ρ/(1 − ρ), k) in k steps, which is compared with √P⁺ᵢᵢ.
    """

    def __init__(self, process: Process, parts: PartsOfSteps):
        self._process, self.steps = process, SampledSteps(parts)

    def of_prediction(
        self, rows: np.ndarray, P: np.ndarray, after: np.ndarray, h: float, inputs: dict[str, PyTree]
    ) -> str | None:
        """The warning about a prediction by h from rows and P to the covariances `after`, if the sample has it."""
        steps = self.steps
        due, steps.count = steps.due(), steps.count + 1
        if not due:
            return None
        some = _judged_members(len(rows))
        rows = self._process.with_inputs(rows, inputs)[some]
        before, then = (np.diagonal(one[some], axis1=1, axis2=2) for one in (P, after))
        return self.judge(rows, before, then, h, steps.count - 1)

    def of_log(self, times: np.ndarray, plan: Orders, output: np.ndarray, every: int, full: bool) -> str | None:
        """The warning about steps of a log, from its saved nodes in `output`; full: all of P is there."""
        size, n, nodes = len(self._process.example), self._process.width, np.arange(0, len(times), every)
        rows = output[plan.rows : plan.rows + len(nodes) * size].reshape(len(nodes), size)
        width = n * n if full else n
        P = output[plan.P : plan.P + len(nodes) * width].reshape(len(nodes), width)
        P = np.diagonal(P.reshape(len(nodes), n, n), axis1=1, axis2=2) if full else P
        return _judged_log(self, times, nodes, rows, P)

    def judge(self, rows: np.ndarray, before: np.ndarray, after: np.ndarray, h: Scalar, count: int) -> str | None:
        """The warning about a step of h from rows (k, size), after `count` others.

        before, after: the variances of the errors (k, n) before the prediction and after it.
        """
        return self.steps.judge(rows, h) or self._by_deviations(rows, before, after, h, count)

    def _by_deviations(
        self, rows: np.ndarray, before: np.ndarray, after: np.ndarray, h: Scalar, count: int
    ) -> str | None:
        parts, length = self.steps.parts, np.full(len(rows), h)
        once, good = parts.over(self.steps.records(rows, length), length, (1.0,))
        halves, well = parts.over(self.steps.records(rows, length), length, HALVES)
        if not (good & well).all():
            return None
        e = np.array([self._differ(*pair) for pair in zip(once, halves, strict=True)]) / parts.shrinks(HALVES)
        doubtful = before > np.finfo(float).tiny  # quantities given as known exactly claim nothing
        with np.errstate(all="ignore"):
            rho = np.clip(before / after, 0.0, 1.0)
            times = np.minimum(np.where(rho < 1.0, rho / (1.0 - rho), np.inf), count + 1.0)
            shares = np.where(doubtful, np.maximum(times, 1.0) * np.abs(e) / np.sqrt(after), 0.0)
        i, k = np.unravel_index(int(np.argmax(np.nan_to_num(shares))), shares.shape)
        share = float(shares[i, k])
        if not share > TOO_MUCH:
            return None
        steps = max(float(times[i, k]), 1.0)
        longer = max(SAFELY, LONG / steps)
        proposed = h * (0.5 / (longer * share)) ** (1.0 / parts.order)
        return (
            f"dt = {h:g} does not resolve this motion as well as the filter claims: within {steps * h:.3g} s the "
            f"errors of its steps add up to {share:.2g} deviations of {self._process.names[k]}. Take dt = "
            f"{proposed:.2g} or less, or more noise."
        )

    @cached_property
    def _differ(self) -> Callable[..., PyTree]:
        return tabulate(self._process.differ, self._process.example, self._process.example)


def _judged_members(count: int) -> np.ndarray:
    """Which of many filters are judged, evenly among all."""
    return np.unique(np.linspace(0, count - 1, MEMBERS).astype(int))


def _judged_log(
    sample: FilterSample, times: np.ndarray, nodes: np.ndarray, rows: np.ndarray, variances: np.ndarray
) -> str | None:
    """The warning about the steps of a log.

    times: of all its nodes, s. nodes: which of them were saved; rows (nodes, size), variances (nodes, n): there.
    """
    process = sample._process
    h = np.diff(times)
    chosen = np.unique(np.concatenate([np.arange(3), np.linspace(0, len(nodes) - 1, NODES)]).astype(int))
    for k in chosen:
        if k >= len(nodes) or nodes[k] >= len(h) or h[nodes[k]] < 0.5 * np.median(h):
            continue
        row, step = rows[k : k + 1], float(h[nodes[k]])
        after, _, code = sample.steps.parts.probe(row, np.full(1, step))
        if code.any():
            continue
        Phi, Q = process.linearised(row, after, step)
        later = (Phi[0] ** 2 @ variances[k] + np.diagonal(Q[0]))[None]
        if sentence := sample.judge(row, variances[k : k + 1], later, step, int(nodes[k])):
            return sentence
    return None
