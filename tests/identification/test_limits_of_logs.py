"""What `identify` and logs are given: times that grow, numbers without gaps where they drive, and their limits."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.identification import Log, identify
from coadjoint.identification.diagnostics import gaps, missed
from coadjoint.identification.log_checks import implausible, wild
from coadjoint.identification.sampling import samples, steps_between

T = np.arange(5.0)
NAN, INF = np.nan, np.inf


def log(**changes: Any) -> Log:
    return Log(
        **{"time": T, "columns": {"depth": [1.0, NAN, 3.0, 4.0, 5.0], "yaw": T}, "inputs": {"rudder": T}} | changes
    )


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"time": [0.0]}, r"at least two samples, but `time` has shape \(1,\)"),
        ({"time": np.zeros((5, 1))}, r"at least two samples, but `time` has shape \(5, 1\)"),
        ({"time": [0.0, 1.0, INF, 3.0, 4.0]}, "must be finite, but sample 2 is at inf s"),
        ({"time": [0.0, 1.0, 1.0, 2.0, 3.0]}, "must increase, but sample 2 is at 1 s after 1 s"),
        ({"time": [0.0, 1.0, 3.0, 2.0, 4.0]}, "must increase, but sample 3 is at 2 s after 3 s"),
        ({"time": ["a"] * 5}, "`time` of a log must hold numbers"),
        ({"columns": [1.0]}, "`columns` of a log must be by names"),
        ({"columns": {"yaw": T[1:]}}, r"`yaw` must have one number for each of 5 times: \(4,\)"),
        ({"columns": {"yaw": np.zeros((5, 2))}}, r"`yaw` must have one number for each of 5 times: \(5, 2\)"),
        ({"inputs": {"rudder": T[1:]}}, r"`rudder` must have one number for each of 5 times"),
        ({"columns": {"yaw": [0.0, 1.0, 2.0, -INF, 4.0]}}, "`yaw` is infinite in sample 3, at 3 s: give NaN where"),
        (
            {"inputs": {"fins": [[0.0, 1.0]] * 4 + [[0.0, INF]]}},
            "`fins` is infinite in sample 4, at 4 s: give what",
        ),
        ({"inputs": {"fins": [[0.0, 1.0], [NAN, 0.0]] + [[0.0, 0.0]] * 3}}, "Input `fins` is missing at 1 s"),
        ({"actual": {"rudder": [0.0, 1.0, NAN, NAN, 4.0]}}, r"`actual\['rudder'\]` is missing at 2 s"),
        ({"columns": {"yaw": [NAN] * 5}}, "Column `yaw` holds no number"),
        (
            {"positions": {"u": (0.0, 0.0, 0.0)}},
            "`positions` names `u`, but only these have a place of a sensor: depth",
        ),
        ({"positions": {"yaw": (0.0, 0.0, 0.0)}}, "`positions` names `yaw`"),
        ({"positions": {"depth": (0.0, 0.0)}}, "`positions` of `depth` must be three finite numbers"),
        ({"positions": {"depth": (0.0, 0.0, NAN)}}, "`positions` of `depth` must be three finite numbers"),
    ],
)
def test_another_log_raises_what_is_wrong_with_it_and_where(changes, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        log(**changes)


def test_a_part_of_a_log_has_the_samples_between_two_times_and_these():
    whole = log(inputs={"fins": np.arange(10.0).reshape(5, 2)}, actual={"fins": np.ones((5, 2))}, step=0.1)
    part = whole.between(1.0, 3.0)
    assert part.time.tolist() == [1.0, 2.0, 3.0] and part.columns["yaw"].tolist() == [1.0, 2.0, 3.0]
    assert part.inputs["fins"].tolist() == [[2.0, 3.0], [4.0, 5.0], [6.0, 7.0]] and part.step == 0.1
    assert (len(part), part.duration, part.interval) == (3, 2.0, 1.0)
    assert part.actual["fins"].shape == (3, 2)


def test_an_actuator_started_where_it_was_or_else_where_it_was_first_told():
    found = log(inputs={"a": T + 2, "b": T + 3}, actual={"a": T + 7})
    assert (found.first("a"), found.first("b"), found.first("c")) == (7.0, 3.0, None)


def test_a_log_in_words_names_what_was_measured_and_what_drove_it():
    assert repr(log()) == "<Log of 5 samples over 4 s: depth, yaw, driven by rudder>"
    assert repr(log(inputs={})) == "<Log of 5 samples over 4 s: depth, yaw>"


def top() -> tuple[co.System, co.State]:
    system = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ (p.inertia * xi), parameters={"inertia": [1.0, 2.0, 3.0]})
    return system, system.state(xi=[0.1, 0.2, 0.3])


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"level": 0.0}, "`level` must be a number between 0 and 1, but is 0"),
        ({"level": 1.0}, "`level` must be a number between 0 and 1, but is 1"),
        ({"level": True}, "`level` must be a number"),
        ({"segment": 0.0}, "`segment` must be positive, but is 0"),
        ({"segment": INF}, "`segment` must be positive"),
        ({"between": "cubic"}, '`between` must be "held" or "linear", but is \'cubic\''),
        ({"dt": "a"}, "`dt` must be a positive number"),
        ({"noise": [1.0]}, "`noise` must be name → value"),
        ({"measured": [1.0]}, "`measured` must be name → value"),
        ({"log": T}, "`log` must be a Log"),
    ],
)
def test_another_argument_raises_what_it_must_be(changes, sentence):
    system, start = top()
    with pytest.raises(ArgumentError, match=sentence):
        identify(system, **{"log": log(), "start": start, "parameters": ["inertia"]} | changes)


def test_what_holds_a_system_is_no_system():
    system, start = top()
    with pytest.raises(
        ArgumentError, match=r"`system` must be a co\.System, but is SimpleNamespace: give its `system`"
    ):
        identify(SimpleNamespace(system=system), log(), start=start, parameters=["inertia"])  # pyright: ignore


@pytest.mark.parametrize("value", [True, np.True_, "1", None, [1.0]])
def test_numbers_are_numbers_and_no_truth_values(value):
    system, start = top()
    with pytest.raises(ArgumentError, match="Argument `level` must be a number between 0 and 1, but is"):
        identify(system, log(), start=start, parameters=["inertia"], level=value)


def test_an_angle_that_is_off_by_more_than_a_radian_is_missed_however_noisy_it_is():
    noisy = np.random.default_rng(5).normal(scale=0.6, size=200)
    turning = Log(0.1 * np.arange(200), {"yaw": noisy}, units={"yaw": "rad"})
    assert missed(turning, ("yaw",), np.array([0.9]), np.array([True])) == []
    (sentence,) = missed(turning, ("yaw",), np.array([1.2]), np.array([True]))
    assert "misses yaw (68.8°)" in sentence
    assert missed(turning, ("yaw",), np.array([1.2]), np.array([False])) == [], "a deviation that was given"


def test_a_segment_begins_by_whole_steps_before_its_samples_where_the_log_goes_on():
    """The first one begins at its first sample; a reach of 0.25 s is three steps of 0.1 s."""
    time = 0.1 * np.arange(60)
    cut = samples(Log(time, {"yaw": time}), np.array([False]), 0.1, 2.0, between="held", reach=0.25)
    first = time[cut.rows[:, 0]]
    np.testing.assert_allclose(cut.starts, first - [0.0, *[0.3] * (len(first) - 1)], atol=1e-12)
    np.testing.assert_allclose(cut.steps_away[:, 0], [0, *[3] * (len(first) - 1)], atol=1e-9)
    assert len(first) == 3 and cut.early.sum(axis=1).tolist() == [3, 0, 0] and not cut.after_gap.any()


def test_missing_rows_are_counted_with_the_longest_time_that_they_take():
    time = np.delete(0.1 * np.arange(100), [20, 50, 51, 52])
    holed = Log(time, {"yaw": np.sin(time)})
    cut = samples(holed, np.array([False]), 0.1, 5.0, between="held")
    (sentence,) = gaps(holed, cut)
    assert sentence.startswith("4 rows are missing, up to 0.3 s at a time")


def test_short_segments_ask_for_seconds_only_where_samples_are_farther_apart_than_these():
    thin = np.concatenate([0.1 * np.arange(50), 5.0 + 0.35 * np.arange(10), 8.5 + 0.1 * np.arange(50)])
    for time, asks in ((thin, False), (60.0 * np.arange(100), True)):
        with pytest.raises(ArgumentError, match="hold fewer than four samples") as error:
            samples(Log(time, {"yaw": time}), np.array([False]), 0.1, 1.0, between="held")
        assert ("are times in seconds?" in str(error.value)) is asks


def test_steps_over_a_gap_are_those_of_the_grid_and_no_more_than_a_thousand():
    flat = Log(np.arange(4.0), {"u": np.ones(4)}, inputs={"command": np.ones(4)})
    cut: Any = SimpleNamespace(
        h=0.1, starts=np.array([0.0, 10.0, 210.0]), steps_away=np.full((3, 1), 10), after_gap=np.arange(3) > 0
    )
    begins, lengths, means, places = steps_between(flat, cut, "held")
    assert places.tolist() == [0, 10 + 90, 10 + 90 + 10 + 1000]
    np.testing.assert_allclose(lengths, [0.1] * 110 + [0.199] * 1000)
    np.testing.assert_allclose(begins, np.cumsum([0.0, *lengths[:-1]]))
    np.testing.assert_allclose(means, 1.0)


@pytest.mark.parametrize(("beyond", "told"), [(1, False), (2, True)])
@pytest.mark.parametrize("angle", [3.2, -3.2])
def test_a_pitch_beyond_half_a_turn_in_more_than_a_hundredth_of_samples_is_in_degrees(beyond, told, angle):
    pitch = np.concatenate([np.full(100 - beyond, 0.5), np.full(beyond, angle), [np.nan]])
    said = implausible(np.arange(101.0), {"pitch": pitch}, {"pitch": "1"})
    assert any("goes beyond 3.14 rad" in one for one in said) == told
    assert not any("goes beyond" in one for one in implausible(np.arange(101.0), {"u": pitch}, {"u": "m/s"}))


@pytest.mark.parametrize(("depth", "told"), [(-3.0, False), (-3.1, True)])
def test_a_depth_of_more_than_3_m_above_the_surface_is_a_height(depth, told):
    said = implausible(np.arange(3.0), {"depth": np.array([depth, depth, 50.0])}, {"depth": "m"})
    assert any("above the surface" in one for one in said) == told


@pytest.mark.parametrize("unit", ["m", "W"])
def test_a_value_is_wild_by_its_neighbours_and_where_the_unit_is_known_beyond_its_floor(unit):
    """The quantity is 1e-3 sin(t/3): a value of 0.5 is 500 times as far, and half a metre is not ten."""
    time = np.arange(60.0)
    values = 1e-3 * np.sin(time / 3)
    values[40] = 0.5
    found = wild(time, {"x": values}, {"x": unit})
    assert [list(one.rows) for one in found] == ([[40]] if unit == "W" else [])
    values[40] = 20.0
    (one,) = wild(time, {"x": values}, {"x": unit})
    assert list(one.rows) == [40] and "in row 41, at 40 s" in one.sentence
