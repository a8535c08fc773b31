"""Coordinates of rotations and directions: their order, what is an angle, and the way back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from coadjoint.groups.overrides import _name
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.charts import CHARTS, along_bearing, bearing, bearing_frame, wrapped

ROLL, PITCH, YAW = 0.3, -0.4, 2.5
ROTATION = Rotation.from_euler("ZYX", [YAW, PITCH, ROLL])
X, Y, Z, W = ROTATION.as_quat(canonical=True)


@pytest.mark.parametrize(
    ("name", "numbers", "angles"),
    [
        ("wxyz", (W, X, Y, Z), False), ("xyzw", (X, Y, Z, W), False), ("zyx", (YAW, PITCH, ROLL), True),
        ("rpy", (ROLL, PITCH, YAW), True),
    ],
)  # fmt: skip
def test_a_rotation_has_its_numbers_in_their_order_and_comes_back_from_them(name, numbers, angles):
    chart, R = CHARTS[name], ROTATION.as_matrix()
    found, back = evaluate(lambda R, y: (chart.numbers(R), chart.element(y)), R, 1.0 * np.array(numbers))
    assert found == pytest.approx(numbers, abs=1e-14) and back == pytest.approx(R, abs=1e-14)
    assert chart.size == len(numbers) == len(chart.angles) and set(chart.angles.tolist()) == {angles}
    off = chart.off(np.array([numbers, 3.0 * np.array(numbers), -0.5 * np.array(numbers)]))
    assert off == pytest.approx([0, 0, 0] if angles else [0, 2, 0.5])


def test_a_bearing_is_clockwise_from_x_and_its_elevation_up_with_z_down():
    y = np.array([2.5, 0.4])
    u, back, frame = evaluate(lambda y: (along_bearing(y), bearing(along_bearing(y)), bearing_frame(y)), y)
    assert u == pytest.approx([np.cos(0.4) * np.cos(2.5), np.cos(0.4) * np.sin(2.5), -np.sin(0.4)])
    assert back == pytest.approx(y)
    assert frame.T @ frame == pytest.approx(np.eye(2)) and frame.T @ u == pytest.approx([0, 0])
    assert frame[:, 0] @ [-np.sin(2.5), np.cos(2.5), 0] == pytest.approx(1) and frame[2, 1] == pytest.approx(
        -np.cos(0.4)
    )
    angles = np.array([-np.pi, np.pi, 3.0, 7.0, -7.0])
    assert wrapped(angles) == pytest.approx([-np.pi, -np.pi, 3.0, 7.0 - 2 * np.pi, 2 * np.pi - 7.0], abs=1e-6)


class Shown:
    def __init__(self, words: str):
        self.words = words

    def __repr__(self) -> str:
        return self.words


@pytest.mark.parametrize(
    ("words", "name"), [("Shown(3)", "Shown(3)"), ("three", "Shown"), ("Shown(" + "3, " * 200 + ")", "Shown")]
)
def test_what_is_compared_is_named_by_its_words_unless_they_are_long_or_say_no_kind(words, name):
    assert _name(Shown(words)) == name
