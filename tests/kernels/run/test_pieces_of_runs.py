"""Parameters that change in the midst of runs, and the columns of their derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.kernels.run.batch import PiecewiseParameters, _move, _turn


def wandering(knots: int, steps: int = 4) -> PiecewiseParameters:
    """Two runs with two parameters, the third and the first, and two components of derivatives."""
    values = np.arange(2.0 * knots * 2).reshape(2, knots, 2)
    return PiecewiseParameters(np.array([2, 0]), 2, steps, values)


@pytest.mark.parametrize(
    ("steps", "knots"),
    [(3, [(0, 0, 3)]), (4, [(0, 0, 4)]), (5, [(0, 0, 4), (1, 4, 1)]), (20, [(0, 0, 4), (1, 4, 4), (2, 8, 12)])],
)
def test_the_last_knot_lasts_to_the_end(steps, knots):
    assert wandering(3).knots(steps) == knots


def test_a_knot_adds_its_values_to_the_parameters_of_each_run():
    p, numbers = np.array([10.0, 20.0, 30.0]), np.zeros((1, 3, 4))
    _move(numbers, p, wandering(3), 1)
    assert numbers[0, 2, :2].tolist() == [30.0 + 2.0, 30.0 + 8.0]
    assert numbers[0, 0, :2].tolist() == [10.0 + 3.0, 10.0 + 9.0] and np.all(numbers[0, 1] == 0.0)


def test_directions_of_parameters_go_from_a_knot_to_the_next():
    """One direction of all steps, then two for each of three knots, of which one pair at a time moves parameters."""
    directions, along = np.zeros((7, 2)), np.array([[1.0, 2.0], [3.0, 4.0]])
    directions[0], directions[1:3] = 9.0, along
    assert _turn(directions, wandering(3), 0) == 3 and np.array_equal(directions[1:3], along)
    assert _turn(directions, wandering(3), 1) == 5
    assert np.array_equal(directions[3:5], along) and not np.any(directions[1:3]) and not np.any(directions[5:])
    assert _turn(directions, wandering(3), 2) == 7
    assert np.array_equal(directions[5:], along) and not np.any(directions[1:5]) and np.all(directions[0] == 9.0)
