"""Where a function that is known at the nodes of a run crosses zero between them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from coadjoint.roots import brent

AT_START = 1e-9
"""A run that starts so near to a zero, as a part of its change over the first step, starts from that zero."""


LOCATED = 1e-13
"""The accuracy of the location of a crossing, as a part of a step."""


AHEAD = 3
"""The number of nodes examined after an interval: the cubic through four nodes shows where it may turn."""


Function = Callable[[float], float]


class Crossing(NamedTuple):
    """A crossing after the part θ of a step, and whether the function rises there."""

    theta: float
    rises: bool


def candidates(values: np.ndarray, count: int) -> np.ndarray:
    """Those of the first `count` intervals between nodes in which a function with these values may cross zero.

    Its sign differs between both nodes, or the cubic through four nodes turns back in between so near to zero that it
    may have crossed twice; `crossings` decides.
    """
    v = np.asarray(values)
    signs = np.sign(v)
    changed = (signs[:count] != 0) & (signs[:count] != signs[1 : count + 1])
    if len(v) < 4:
        return np.flatnonzero(changed)
    cubic, first = _cubics(v, count)
    turns = _turns(cubic, np.arange(count) - first)
    here = np.where(np.isnan(turns), 0.0, turns)
    lowest = _value(cubic, here) * np.where(signs[:count] != 0, signs[:count], signs[1 : count + 1])
    near = ~np.isnan(turns) & (lowest <= _doubt(cubic))
    return np.flatnonzero(changed | np.any(near, axis=0))


def crossings(values: np.ndarray, interval: int, f: Function) -> list[Crossing]:
    """The crossings in (0, 1] of an interval between two nodes, in order. f: the function after a part of the step.

    A zero at the node where the interval begins belongs to the one before.
    """
    v = np.asarray(values)
    ends: list[tuple[float, float]] = [(0.0, float(v[interval])), (1.0, float(v[interval + 1]))]
    guess = None
    if len(v) >= 4:
        cubics, first = _cubics(v, interval + 1)
        cubic, shift = cubics[:, interval], interval - int(first[interval])
        turns = [t - shift for t in np.ravel(_turns(cubic[:, None], np.array([shift]))) if np.isfinite(t)]
        ends = [ends[0], *(_turning_point(f, t, ends) for t in sorted(turns)), ends[1]]
        guess = partial(_at, cubic, shift)
    found = []
    for (a, left), (b, right) in pairwise(ends):
        if left != 0 and np.sign(left) != np.sign(right):
            found.append(Crossing(_root(f, (a, left), (b, right), guess), right > left))
    return found


def from_zero(values: np.ndarray) -> np.ndarray:
    """The values of a run from its start; the first one is 0 if it is round-off, as after a restart at an event."""
    if len(values) > 1 and abs(values[0]) <= AT_START * abs(values[1] - values[0]):
        return np.concatenate([[0.0], values[1:]])
    return values


def _cubics(v: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The coefficients (4, count) of the cubic through four nodes for each interval, and the first of these nodes."""
    first = np.minimum(np.arange(count), len(v) - 4)
    a, b, c, d = (v[first + k] for k in range(4))
    d1, d2, d3 = b - a, c - 2 * b + a, d - 3 * c + 3 * b - a
    return np.stack([a, d1 - d2 / 2 + d3 / 3, (d2 - d3) / 2, d3 / 6]), first


def _value(cubic: np.ndarray, x: np.ndarray | float) -> np.ndarray:
    return cubic[0] + x * (cubic[1] + x * (cubic[2] + x * cubic[3]))


def _at(cubic: np.ndarray, shift: int, theta: float) -> float:
    return float(_value(cubic, theta + shift))


def _turns(cubic: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Both zeros (2, count) of the cubic's slope that lie in (shift, shift + 1), NaN elsewhere."""
    _, b, c, d = cubic
    with np.errstate(all="ignore"):
        q = -(c + np.where(c >= 0, 1, -1) * np.sqrt(c * c - 3 * b * d))
        x = np.stack([q / (3 * d), b / q])
        return np.where((x > shift) & (x < shift + 1), x, np.nan)


def _doubt(cubic: np.ndarray) -> np.ndarray:
    """By how much the function may differ from its cubic between nodes: as much as the cubic from the parabola."""
    return 2.3 * np.abs(cubic[3])


def _turning_point(f: Function, theta: float, ends: list[tuple[float, float]]) -> tuple[float, float]:
    """Where f turns near θ, and its value there; searched for by parabolas where it may have crossed zero twice."""
    (_, left), (_, right) = ends
    a, b, c = (0.0, left), (theta, f(theta)), (1.0, right)
    if left * right < 0:
        return b
    toward = -np.sign(left or right)
    for _ in range(8):
        if toward * b[1] > 0:
            break
        x = _vertex(a, b, c)
        if not a[0] < x < c[0] or abs(x - b[0]) < 1e-6:
            break
        new = (x, f(x))
        better = toward * new[1] > toward * b[1]
        lower, upper = sorted([b, new])
        if better == (new == lower):
            b, c = lower, upper
        else:
            a, b = lower, upper
    return b


def _vertex(*points: tuple[float, float]) -> float:
    """Where the parabola through three points turns; NaN if it is a line."""
    (a, fa), (b, fb), (c, fc) = points
    p, q = (b - a) * (fb - fc), (b - c) * (fb - fa)
    return b - 0.5 * ((b - a) * p - (b - c) * q) / (p - q) if p != q else float("nan")


def _root(f: Function, left: tuple[float, float], right: tuple[float, float], guess: Function | None) -> float:
    """The zero of f between two points of different sign: by the slope of the cubic where it is good, else Brent's."""
    (a, fa), (b, fb) = left, right
    if fb == 0:
        return b
    theta = a - fa * (b - a) / (fb - fa)
    if guess is not None and guess(a) * guess(b) < 0:
        theta = brent(guess, a, b)
        slope = (guess(min(theta + 1e-4, b)) - guess(max(theta - 1e-4, a))) / (
            min(theta + 1e-4, b) - max(theta - 1e-4, a)
        )
        last = np.inf
        for _ in range(6):
            change = -f(theta) / slope if slope else np.inf
            if abs(change) <= LOCATED or (abs(change) < 1e-9 and abs(change) >= 0.5 * last):
                return float(np.clip(theta + change, a, b)) if abs(change) <= LOCATED else theta
            if not abs(change) < 0.5 * last or not a < theta + change < b:
                break
            theta, last = theta + change, abs(change)
    if np.sign(f(b)) == np.sign(fa):  # f jumps across zero at the node, where values held over a step change
        return b
    return brent(f, a, b, rtol=1e-14)
