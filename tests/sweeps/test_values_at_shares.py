"""The values that members get at their shares of a distribution, and what [vary] may say of a number."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.sweeps.file import _written
from coadjoint.sweeps.numbers import BLOCK, MOST, Number, design, number, read, shares


def test_values_are_equally_likely_and_the_last_share_has_the_last():
    values = np.array([5.0, 7.0, 9.0])
    assert Number("x", values=values).at(np.array([0.0, 0.33, 0.34, 0.66, 0.67, 1 - 2.0**-53, 1.0])).tolist() == [
        5.0, 5.0, 7.0, 7.0, 9.0, 9.0, 9.0,
    ]  # fmt: skip


def test_a_normal_number_is_as_far_above_its_mean_as_below_and_never_infinite():
    at = Number("x", normal=(2.0, 0.5)).at
    below, middle, above = at(np.array([0.15865525393145707, 0.5, 0.8413447460685429]))
    assert (below, middle, above) == pytest.approx((1.5, 2.0, 2.5), rel=1e-14)
    ends = at(np.array([0.0, 1.0]))
    assert np.all(np.isfinite(ends)) and ends[0] < 2.0 - 8 * 0.5 and ends[1] > 2.0 + 8 * 0.5


def test_a_number_between_two_is_even_in_itself_or_in_its_logarithm():
    u = np.array([0.0, 0.25, 1.0])
    assert Number("x", between=(2.0, 6.0)).at(u).tolist() == [2.0, 3.0, 6.0]
    assert Number("x", between=(1.0, 16.0), even=False).at(u) == pytest.approx([1.0, 2.0, 16.0], rel=1e-15)


def test_a_normal_number_of_a_file_is_a_mean_and_a_deviation():
    assert number({"mean": 3, "deviation": 0.5}, "x") == Number("x", normal=(3.0, 0.5))
    for wrong in (0, -1.0):
        with pytest.raises(ArgumentError, match=r"\[vary\.x\] deviation must be positive"):
            number({"mean": 3, "deviation": wrong}, "x")


@pytest.mark.parametrize(
    "given",
    [
        {"mean": 3.0, "deviation": 0.5},
        {"values": [1.0, 5.0]},
        {"from": 1.0, "to": 2.0},
        {"from": 1.0, "to": 2.0, "scale": "log"},
        {"from": 1.0, "to": 2.0, "count": 4},
    ],
)
def test_a_number_of_a_file_is_written_in_results_as_in_the_file(given):
    assert _written([number(given, "x")]) == [given]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"from": 1, "to": 1}, r"\[vary\.x\] is an empty range: `from`, 1, must be less than `to`, 1"),
        ({"from": 2, "to": 1}, "must be less than"),
        ({"from": 0, "to": 1, "scale": "log"}, r"\[vary\.x\] from must be positive with the scale"),
        ({"from": 1, "to": 2, "scale": "cubic"}, 'must be "linear" or "log"'),
        ({"from": 1, "to": 2, "count": 1}, "must be a whole number from 2"),
        ({"from": 1, "to": 2, "count": True}, "must be a whole number from 2"),
        ({"from": 1, "to": 2, "count": 2.0}, "must be a whole number from 2"),
        ({"from": True, "to": 2}, "must be a finite number"),
        ({"from": 1, "to": float("inf")}, "must be a finite number"),
        ({"from": 1}, r"Section \[vary\.x\] needs `to`, greatest value"),
        ({"mean": 1}, r"Section \[vary\.x\] needs `deviation`, standard deviation"),
        ({"values": [1], "count": 2}, r"Section \[vary\.x\] has no key `count`"),
        ({"mean": 1, "deviation": 1, "scale": "log"}, r"Section \[vary\.x\] has no key `scale`"),
        ({"values": []}, "must be a list of finite numbers"),
        ({"values": 3.0}, "must be a list of finite numbers"),
        ({"values": [1, float("nan")]}, "must be a list of finite numbers"),
        ({"values": ["a"]}, "must be a list of finite numbers"),
        ({"form": 1, "to": 2}, "from"),
    ],
)
def test_another_number_raises_its_sentence(given, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        number(given, "x")


def test_a_grid_needs_a_count_and_at_least_two_values_are_its_ends():
    assert Number("x", between=(0.1, 0.3), count=2).on_grid().tolist() == [0.1, 0.3]
    with pytest.raises(ArgumentError, match="has no values of a grid"):
        Number("x", between=(0.0, 1.0)).on_grid()
    with pytest.raises(ArgumentError, match="has no values of a grid"):
        Number("x", normal=(0.0, 1.0)).on_grid()


def test_random_members_go_on_over_the_blocks_in_which_they_are_drawn():
    many = shares("random", BLOCK + 2, 1, 3)
    assert many.shape == (BLOCK + 2, 1) and len(np.unique(many)) == BLOCK + 2
    assert np.array_equal(many[:BLOCK], shares("random", BLOCK, 1, 3))


def test_a_list_goes_through_its_numbers_together_and_they_have_one_length():
    two, three = Number("a", values=np.arange(2.0)), Number("b", values=np.arange(3.0))
    found, count = design([two, Number("c", values=np.array([8.0, 9.0]))], "list", None, 0)
    assert count == 2 and found["a"].tolist() == [0.0, 1.0] and found["c"].tolist() == [8.0, 9.0]
    with pytest.raises(ArgumentError, match="equally many values, but have: a 2, b 3"):
        design([two, three], "list", None, 0)
    with pytest.raises(ArgumentError, match=r"\[vary\] d must be \{ values"):
        design([two, Number("d", between=(0.0, 1.0), count=2)], "list", None, 0)


def test_a_sweep_has_at_most_so_many_members():
    side = Number("a", values=np.zeros(100_000))
    with pytest.raises(ArgumentError, match="at most 1,000,000,000 members, but this one would have 10,000,000,000"):
        design([side, side], "grid", None, 0)
    with pytest.raises(ArgumentError, match="at most 1,000,000,000 members"):
        design([side], "random", MOST + 1, 0)


def test_places_of_an_array_vary_and_the_others_stay():
    (varied,) = read({"initial": {"position_m": [1.0, {"from": 0, "to": 4}, [5.0, {"values": [2.0, 6.0]}][0]]}})
    assert varied.keys == ("initial", "position_m") and [n.name for n in varied.numbers] == ["initial.position_m[1]"]
    rows = {"initial.position_m[1]": np.array([0.0, 4.0])}
    assert varied.values(rows, 2).tolist() == [[1.0, 0.0, 5.0], [1.0, 4.0, 5.0]]
    assert varied.value({"initial.position_m[1]": np.float64(4.0)}) == [1.0, 4.0, 5.0]


@pytest.mark.parametrize(
    ("table", "sentence"),
    [({"mass": 1.0}, "needs the section of `mass`"), ({"parameters": {"mass": [1.0, 2.0]}}, "must vary")],
)
def test_what_does_not_vary_raises_its_sentence(table, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        read(table)
