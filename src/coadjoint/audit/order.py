"""The measured order of convergence: the slope of log error against log h, by least squares.

    e(h) = C hᵖ (1 + O(h)) + round-off,      p = slope of log e over log h.

Steps are halved, for order 6 divided by √2 and from 7 on by its root, because halving would meet round-off immediately.
Left out are the fine end, where round-off has a share in e, and the coarse end, where O(h) is not small: of the errors
that are clear of round-off, the finest few are fitted. Nothing in that choice knows the order that is claimed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coadjoint.audit.stepper import AuditStepper, distance, exact, uncertainty
from coadjoint.audit.systems import AuditSystem
from coadjoint.errors import StepError

CLEAR = 50.0
"""How many times above the round-off of the reference and of the run an error counts."""

FINEST = 1024
"""The most steps a run has."""

RATIOS = ((5, 2.0), (7, 2**0.5), (99, 2**0.25))
"""Orders under the first number are measured with steps that are divided by the second."""

FITTED = 4
"""How many errors are fitted."""


class Convergence(NamedTuple):
    """Step sizes with their errors, which of them were fitted, and the slope.

    h, error, fitted: (steps,).
    """

    h: np.ndarray
    error: np.ndarray
    fitted: np.ndarray
    order: float


def convergence(stepper: AuditStepper, problem: AuditSystem) -> Convergence:
    """The errors at the end of `problem.duration` over refined steps, and their slope."""
    claims = stepper.method.claims
    expected = claims.order_with_internal if problem.internal else claims.order
    ratio = next(ratio for below, ratio in RATIOS if expected < below)
    steps, rows, below = 4.0, [], 0
    while round(steps) <= FINEST and below < 2:
        h = problem.duration / round(steps)
        floor = CLEAR * (uncertainty(problem) + np.finfo(float).eps * np.sqrt(round(steps)))
        error = error_after(stepper, problem, h, round(steps))
        rows.append((h, error, error > floor))
        below += bool(error <= floor)
        steps *= ratio
    h, error, clear = (np.array(column) for column in zip(*rows, strict=True))
    return fit(h, error, clear & np.isfinite(error), FITTED)


def fit(h: np.ndarray, error: np.ndarray, usable: np.ndarray, count: int) -> Convergence:
    """The slope of the finest `count` usable errors; NaN for fewer than three. h, error, usable: (steps,)."""
    fitted = np.zeros(len(h), bool)
    fitted[np.flatnonzero(usable)[-count:]] = True
    slope = np.polyfit(np.log(h[fitted]), np.log(error[fitted]), 1)[0] if fitted.sum() >= 3 else np.nan
    return Convergence(h, error, fitted, float(slope))


def error_after(stepper: AuditStepper, problem: AuditSystem, h: float, steps: int) -> float:
    """The distance from the exact motion after the steps; infinite where a step is too large to be solved."""
    try:
        end = stepper.end(h, steps)
    except StepError:
        return np.inf
    return distance(end, exact(problem, float(end.t)))
