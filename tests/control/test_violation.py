"""By how much a solution of a quadratic program leaves its steps and its limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coadjoint.control.quadratic import Stages, violation

STAGES: dict[str, Any] = {
    "M": np.array([[[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]]]),
    "c": np.array([[0.0, 2.0]]),
    "C": np.array([[[1.0, 0.0, 1.0]]]),
    "C_limits": (np.array([[-1.0]]), np.array([[4.0]])),
    "u_limits": (np.array([[-3.0]]), np.array([[2.0]])),
    "last_C": np.array([[1.0, -1.0]]),
    "last_limits": (np.array([-5.0]), np.array([0.5])),
}


def left(u: float, end: tuple[float, float]) -> float:
    """The violation of a step from (1, 1) with this input to this end; x⁺ = x + (u/2, 2)."""
    made = Stages(**(dict.fromkeys(Stages._fields) | STAGES))  # pyright: ignore[reportArgumentType]
    return violation(made, np.array([[1.0, 1.0], end]), np.array([[u]]), np.zeros(0))


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("u", "end", "size"),
    [
        (1.0, (1.5, 3.0), 0.0),
        (1.0, (1.5, 2.75), 0.25),
        (1.0, (1.25, 3.0), 0.25),
        (2.5, (2.25, 3.0), 0.5),
        (-2.5, (-0.25, 3.0), 0.5),
        (-3.5, (-0.75, 3.0), 1.5),
        (2.0, (2.0, 1.0), 2.0),
    ],
    ids=["none", "too low an end", "too near an end", "above u", "below C", "below C and u", "above the last"],
)
def test_the_violation_is_the_largest_of_steps_and_limits_on_both_sides(u, end, size):
    assert left(u, end) == pytest.approx(size, abs=1e-15)
