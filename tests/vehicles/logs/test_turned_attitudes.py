"""Columns of a log in its own axes, turned to north, east, down, and what says a thing twice."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coadjoint.errors import FileError
from coadjoint.groups import attitude
from coadjoint_vehicles.logs.turned import turned

NAN = np.nan


def column(*values: float) -> np.ndarray:
    return np.array(values)


def quaternion(heading: float, pitch: float, roll: float, scale: float = 1.0) -> dict[str, np.ndarray]:
    """(qw, qx, qy, qz) of an attitude, once good and once missing."""
    found = scale * np.asarray(attitude.to_quaternion(attitude.zyx(heading, pitch, roll)))
    return {name: column(value, NAN) for name, value in zip(("qw", "qx", "qy", "qz"), found, strict=True)}


def test_a_quaternion_is_heading_pitch_and_roll_and_nan_where_one_of_it_is_missing():
    given = quaternion(0.3, 0.2, -0.1)
    given["qw"][1], given["qx"][1], given["qy"][1] = 1.0, 0.0, 0.0
    found = turned("a.csv", given, "NED/FRD")
    assert [found[name][0] for name in ("heading", "pitch", "roll")] == pytest.approx([0.3, 0.2, -0.1])
    assert all(np.isnan(found[name][1]) for name in ("heading", "pitch", "roll"))


def test_angles_of_east_north_up_are_those_of_north_east_down_turned():
    found = turned("a.csv", {"yaw": column(0.3), "pitch": column(0.2), "roll": column(-0.1)}, "ENU/FLU")
    assert (found["heading"][0], found["pitch"][0], found["roll"][0]) == pytest.approx((np.pi / 2 - 0.3, -0.2, -0.1))
    assert turned("a.csv", {"yaw": column(0.3), "pitch": column(0.2)}, "NED/FRD")["heading"][0] == 0.3


def test_places_and_velocities_are_turned_by_their_names():
    given: dict[str, Any] = {"x": column(1.0), "y": column(2.0), "z": column(3.0), "u": column(4.0), "v": column(5.0)}
    inside = turned("a.csv", given, "NED/FRD")
    assert [inside[n][0] for n in ("north", "east", "depth", "u", "v")] == [1.0, 2.0, 3.0, 4.0, 5.0]
    inside = turned("a.csv", given | {"r": column(6.0)}, "ENU/FLU")
    assert [inside[n][0] for n in ("north", "east", "depth", "u", "v", "r")] == [2.0, 1.0, -3.0, 4.0, -5.0, -6.0]
    assert turned("a.csv", {"up": column(3.0)}, "NED/FRD")["depth"][0] == -3.0
    assert turned("a.csv", {"down": column(3.0)}, "ENU/FLU")["depth"][0] == 3.0


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"x": column(1.0), "north": column(1.0)}, "`x` says again what another column says, `north`"),
        ({"qw": column(1.0), "qz": column(0.0)}, "needs qw, qx, qy and qz, but qx, qy is missing"),
        ({**quaternion(0.3, 0.2, 0.1), "yaw": column(0.3, 0.3)}, "attitude is given twice"),
        ({"yaw": column(0.3), "heading": column(0.3)}, "`yaw` says again what `heading` says"),
        (quaternion(0.3, 0.2, 0.1, 1.06), "must have length 1, but one has 1.06"),
        (quaternion(0.3, 0.2, 0.1, 0.94), "must have length 1, but one has 0.94"),
    ],
)
def test_what_is_said_twice_or_is_no_quaternion_raises_file_error(given, sentence):
    with pytest.raises(FileError, match=f"a.csv: .*{sentence}"):
        turned("a.csv", given, "NED/FRD")


def test_quaternions_may_be_off_their_length_by_a_twentieth():
    found = turned("a.csv", quaternion(0.3, 0.2, 0.1, 1.049), "NED/FRD")
    assert found["heading"][0] == pytest.approx(0.3) and found["roll"][0] == pytest.approx(0.1)
