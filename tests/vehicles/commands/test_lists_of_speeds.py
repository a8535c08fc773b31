"""Speeds of `coadjoint stability`: a number, a list or a range, from 0 to below 1000 m/s."""

from __future__ import annotations

import pytest

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.commands.stability import MOST, speeds_from

RIGHT = {
    "1.5": [1.5],
    "0": [0.0],
    "999.9": [999.9],
    "0.5,1,2": [0.5, 1.0, 2.0],
    "1:2:0.5": [1.0, 1.5, 2.0],
    "0:0.3:0.1": [0.0, 0.1, 0.2, 0.3],
    "2:2:1": [2.0],
}


@pytest.mark.parametrize(("text", "speeds"), RIGHT.items(), ids=RIGHT.keys())
def test_speeds_are_a_number_a_list_or_a_range_with_its_end(text, speeds):
    assert speeds_from(text) == speeds


WRONG = "fast", "-1", "-1,2", "2,-1", "1000", "1,1000", "nan", "1:2", "1:2:0", "2:1:1", "0:inf:1", ""


@pytest.mark.parametrize("text", WRONG)
def test_other_speeds_raise_what_they_must_be(text):
    with pytest.raises(ArgumentError, match=f"--speed must be a speed in m/s.*but is {text!r}"):
        speeds_from(text)


def test_a_range_has_at_most_so_many_speeds():
    assert len(speeds_from(f"1:{MOST}:1")) == MOST
    with pytest.raises(ArgumentError, match=f"at most {MOST}"):
        speeds_from(f"1:{MOST + 1}:1")
