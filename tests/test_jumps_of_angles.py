"""Angles in degrees that are given as radians show by their jumps of a turn, within 30."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.units import jumps_by_degrees


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("angles", "jump"),
    [
        ([359.0, 1.0], True),
        ([-179.0, 179.0, 178.0], True),
        ([0.0, 331.0], True),
        ([0.0, 330.0], False),
        ([0.0, -389.0], True),
        ([0.0, 390.0], False),
        ([0.0, 2 * np.pi, 0.0], False),
        ([10.0, 20.0, 30.0], False),
    ],
)
def test_a_jump_of_a_turn_is_of_degrees(angles, jump):
    assert jumps_by_degrees(np.array(angles)) is jump
    assert jumps_by_degrees(np.array(angles)[:1]) is False
