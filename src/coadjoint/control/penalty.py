"""Soft constraints: what a violation costs, and the slack variables that measure it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.control.numbers import number
from coadjoint.errors import ArgumentError


@dataclass(frozen=True, eq=False)
class Penalty:
    """The cost ρ₁ v + ½ ρ₂ v² of a violation v of a soft constraint, at each of its sides.

        path={"slow": co.control.Bounds(lambda motion, p: motion.xi, -1, 1, soft=co.control.Penalty(linear=100.0))}

    linear, quadratic: ρ₁ and ρ₂ in units of the cost over those of the constraint and their square, numbers or vectors
    of its shape, by default 0. Of a path they are costs a second, of an end costs. With a linear penalty above the
    multiplier of the hard constraint the optimum is that of the hard one wherever this has one; a quadratic penalty
    alone is always violated a little.

    Raises ArgumentError unless both are finite, none is negative and one is positive.
    """

    linear: Any = 0.0
    quadratic: Any = 0.0

    def __post_init__(self):
        for name in ("linear", "quadratic"):
            value = number(getattr(self, name), name)
            fits = value.ndim <= 1 and np.all(np.isfinite(value)) and np.all(value >= 0)
            checks.expect(fits, getattr(self, name), name, "numbers from 0 on, one or as many as the constraint has")
            object.__setattr__(self, name, value)
        try:
            both = self.linear + self.quadratic
        except ValueError:
            both = np.zeros(1)
        if not np.all(both > 0):
            raise ArgumentError("co.control.Penalty needs a positive `linear` or `quadratic` for every number.")

    def of(self, count: int, what: str) -> tuple[np.ndarray, np.ndarray]:
        """ρ₁ and ρ₂ of `count` numbers; raises ArgumentError for other shapes."""
        try:
            return np.broadcast_to(self.linear, count), np.broadcast_to(self.quadratic, count)
        except ValueError:
            raise ArgumentError(f"The penalty of {what} must have one number or {count}.") from None


def require_soft(given: object, what: str) -> None:
    """Raise ArgumentError unless `soft` is a penalty or None."""
    fits = given is None or isinstance(given, Penalty)
    checks.expect(fits, given, f"Argument `soft` of {what}", "a co.control.Penalty(linear=…, quadratic=…) or None")


class Slack(NamedTuple):
    """The slack variables s ≥ 0 of soft rows c at one node: lower ≤ c + S s ≤ upper, at the cost ρ₁·s + ½ ρ₂·s²."""

    matrix: np.ndarray
    linear: np.ndarray
    quadratic: np.ndarray

    @property
    def size(self) -> int:
        """Their count."""
        return len(self.linear)

    def violations(self, values: np.ndarray) -> np.ndarray:
        """The violation of each row, (nodes, rows), by slack variables (nodes, size), which are ≥ 0 up to round-off."""
        return np.maximum(values, 0.0) @ np.abs(self.matrix).T


def slack_of(penalty: Penalty, lower: np.ndarray, upper: np.ndarray, what: str) -> Slack:
    """One variable for each side of a row that has a bound."""
    count = len(lower)
    sides = [np.flatnonzero(np.isfinite(side)) for side in (lower, upper)]
    matrix = np.concatenate([np.eye(count)[:, sides[0]], -np.eye(count)[:, sides[1]]], axis=1)
    linear, quadratic = (np.concatenate([weights[side] for side in sides]) for weights in penalty.of(count, what))
    return Slack(matrix, linear, quadratic)


def joined(slacks: list[tuple[int, Slack | None, float]]) -> Slack:
    """The variables of several blocks of rows, (rows, slack, weight) each; hard blocks have none."""
    rows, size = sum(count for count, _, _ in slacks), sum(one.size for _, one, _ in slacks if one)
    matrix, row, column = np.zeros((rows, size)), 0, 0
    for count, one, _ in slacks:
        if one:
            matrix[row : row + count, column : column + one.size] = one.matrix
            column += one.size
        row += count
    costs = [[weight * getattr(one, name) for _, one, weight in slacks if one] for name in ("linear", "quadratic")]
    linear, quadratic = (np.concatenate([*parts, np.zeros(0)]) for parts in costs)
    return Slack(matrix, linear, quadratic)
