"""Times, depths and axes of tables of water at their limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.water.bottom import _axis
from coadjoint_vehicles.water.tables import CurrentTable

TWO = np.zeros((2, 3))


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"velocities": TWO}, "needs `times`, `depths` or both"),
        ({"velocities": TWO, "times": 3.0}, r"`times` must have shape \(k,\), but has shape \(\)"),
        ({"velocities": TWO, "times": []}, r"`times` must have shape \(k,\), but has shape \(0,\)"),
        ({"velocities": TWO, "depths": [[0.0], [1.0]]}, r"`depths` must have shape \(k,\), but has shape \(2, 1\)"),
        ({"velocities": TWO, "depths": [-0.1, 1.0]}, "`depths` must be 0 m or more, but has -0.1 m"),
        ({"velocities": TWO, "depths": [1.0, 1.0]}, "`depths` must"),
        ({"velocities": TWO, "times": [2.0, 1.0]}, "`times` must"),
        ({"velocities": TWO, "times": [0.0, 1.0, 2.0]}, r"must have shape \(3, 3\), but has shape \(2, 3\)"),
        ({"velocities": TWO, "times": [0.0, 1.0], "depths": [0.0]}, r"must have shape \(2, 1, 3\)"),
    ],
)
def test_another_table_is_refused(given: dict[str, Any], sentence: str):
    with pytest.raises(ArgumentError, match=sentence):
        CurrentTable(**given)


def test_a_table_of_one_row_and_one_from_the_surface_on_are_kept():
    assert CurrentTable(np.ones((1, 3)), times=[5.0]).velocities.shape == (1, 3)
    assert CurrentTable(np.ones((2, 3)), depths=[0.0, 1.0]).depths.tolist() == [0.0, 1.0]


@pytest.mark.parametrize("given", [[1.0], 3.0, [1.0, 1.0], [2.0, 1.0], [0.0, 1.0, 0.5], [0.0, np.inf], [[0.0, 1.0]]])
def test_an_axis_is_two_numbers_or_more_that_rise(given):
    with pytest.raises(ArgumentError, match="`north` must be two numbers or more that rise"):
        _axis(given, "north")


def test_an_axis_is_evenly_spaced_to_a_millionth():
    assert _axis([0.0, 1.0, 2.0 + 9e-7], "north").shape == (3,) and _axis([-1, 0], "north").tolist() == [-1.0, 0.0]
    with pytest.raises(ArgumentError, match=r"must be evenly spaced, but its steps are 1 to 1\.1 m"):
        _axis([0.0, 1.0, 2.1], "north")
