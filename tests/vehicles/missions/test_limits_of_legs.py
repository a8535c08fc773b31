"""Set points, way points, ends and faults of missions: units, axes, one value a time, and what does not go together."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray as xr

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.vehicles.missions import faults, legs

UNITS = {"depth": "m", "heading": "rad", "speed": "m/s", "rudder": "rad", "thrusters": "N", "attitude": "1"}
RUDDER = SimpleNamespace(name="rudder", kind="fin", command=SimpleNamespace(unit="rad", start=0.0))
MOTORS = SimpleNamespace(name="motors", kind="thrusters", command=SimpleNamespace(unit="N", start=0.0))
LEAD = SimpleNamespace(name="lead", kind="payload", command=SimpleNamespace(unit="1", start=0.0))


def mission(frame: str = "NED/FRD", members: int = 1, **given: Any) -> Any:
    return cast(Any, SimpleNamespace(mission=given, axes=frame, run=SimpleNamespace(members=members), faults={}))


def refused(sentence: str, call: Any, *given: Any) -> None:
    with pytest.raises(ArgumentError, match=sentence):
        call(*given)


# Set points.


def test_set_points_are_numbers_that_stay_or_values_by_time_in_si_units():
    found = legs.inputs(mission(depth_ft=10, heading_deg=[0, 90], time_min=[0, 1], speed=1.5), UNITS)
    assert found["depth"] == pytest.approx(3.048) and found["speed"] == 1.5
    heading = found["heading"]
    assert isinstance(heading, co.Held) and np.asarray(heading.times).tolist() == [0.0, 60.0]
    assert np.asarray(heading.values) == pytest.approx([0.0, np.pi / 2])
    linear = legs.inputs(mission(depth=[1, 2], time=[0, 1], between="linear"), UNITS)["depth"]
    assert isinstance(linear, co.Linear)
    assert legs.inputs(mission(thrusters=[1, 2, 3]), UNITS)["thrusters"].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"between": "cubic"}, 'between must be "held" or "linear"'),
        ({"depth": [1, 2]}, "depth has 2 values, so that it needs `time_s`"),
        ({"depth": [1, 2], "time": [0, 1, 2]}, "or a value for each of 3 times, but has 2"),
        ({"depth": "deep"}, "depth must hold numbers"),
        ({"depth": True}, "depth must hold numbers"),
        ({"depth": [1, float("nan")], "time": [0, 1]}, "depth must hold numbers"),
        ({"heading": 7000.0}, "heading` must be of at most 1000 turns"),
        ({"dept": 1.0}, "has no set point `dept`: did you mean `depth`"),
        ({"depth": 1.0, "depth_ft": 3.0}, "gives `depth` twice: once as `depth_ft`"),
        ({"depth_s": 1.0}, "`depth` measures m, but `depth_s` is in s"),
        ({"axes": "ENU/FLU"}, "has no axes of its own"),
    ],
)
def test_another_set_point_is_refused(given, sentence):
    refused(sentence, legs.inputs, mission(**given), UNITS)


def test_a_mission_in_east_north_up_is_turned_at_its_border():
    found = legs._plain(mission("ENU/FLU", yaw_deg=[0, 90], pitch=0.25, way_points=[[1, 2, 3]], depth=4.0))
    assert found["heading"] == pytest.approx([np.pi / 2, 0.0]) and found["pitch"] == -0.25 and found["depth"] == 4.0
    assert found["way_points"] == [[2, 1, -3]] and "yaw" not in found
    assert legs._plain(mission(way_points=[[1, 2, 3]]))["way_points"] == [[1, 2, 3]]
    refused("heading belongs to NED/FRD", legs._plain, mission("ENU/FLU", heading=0.0))


# Way points.


def test_way_points_are_three_numbers_each():
    assert legs.way_points(mission()).shape == (0, 3)
    assert legs.way_points(mission(way_points=[[1, 2, 3]])).tolist() == [[1, 2, 3]]
    for axes, names in (("NED/FRD", "north, east, depth"), ("ENU/FLU", "east, north, up")):
        for wrong in ([1, 2, 3], [[1, 2]]):
            refused(
                rf"way_points_m must hold \[{names}\] of each point", legs.way_points, mission(axes, way_points=wrong)
            )


def test_a_controller_follows_way_points_from_where_the_vehicle_starts():
    helm = SimpleNamespace(period=0.1, delay=0.0)
    assert legs.following(mission(), helm, np.zeros(3)) is helm
    for key in ("acceptance", "look_ahead"):
        refused(f"{key} belongs to `way_points_m`", legs.following, mission(**{key: 1.0}), helm, np.zeros(3))
    refused("need a controller at the helm", legs.following, mission(way_points=[[1, 2, 3]]), None, np.zeros(3))


def test_the_last_way_point_is_reached_within_its_acceptance_or_beside_it():
    controller = SimpleNamespace(way_points=[[0, 0, 0], [10, 0, 0], [20, 0, 0]], acceptance=2.0)
    gap = legs.arrival(controller)

    def at(leg: int, x: float, y: float) -> float:
        memory = SimpleNamespace(leg=leg)
        value = SimpleNamespace(memory=memory)
        internal = SimpleNamespace(controller=SimpleNamespace(value=value))
        return float(gap(SimpleNamespace(q=np.array([x, y, 0.0]), internal=internal)))

    with co.float64():
        assert at(0, 19.0, 0.0) == 3.0 and at(1, 19.0, 0.0) == pytest.approx(-1.0)
        assert at(1, 15.0, 0.0) == pytest.approx(3.0) and at(1, 21.0, 50.0) == pytest.approx(-1.0)


# Ends.


@pytest.mark.parametrize(
    ("given", "depth", "sentence"),
    [
        ({"ends": "surface"}, -0.5, 'ends at the "surface", but .initial. is 0.5 m above it'),
        ({"ends": "bottom", "bottom": 10.0, "clearance": 2.0}, 8.0, 'at a depth of 8 m, but .initial. is at 8 m'),
        ({"ends": ["surface", "bottom"], "bottom": [10.0]}, 5.0, "bottom must be one number"),
        ({"bottom": 10.0}, 5.0, 'bottom belongs to ends = "bottom"'),
        ({"ends": "surface", "clearance": 1.0}, 5.0, 'clearance belongs to ends = "bottom"'),
        ({"ends": "surface", "members": 2}, 5.0, "would end each of the members at its own time"),
    ],
)  # fmt: skip
def test_a_mission_that_begins_beyond_its_end_is_refused(given, depth, sentence):
    refused(sentence, legs.require_room_to_end, mission(**given), np.array([0.0, 0.0, depth]))


def test_a_mission_may_begin_at_the_surface_and_just_above_the_bottom():
    legs.require_room_to_end(mission(ends="surface"), np.zeros(3))
    legs.require_room_to_end(mission(ends="bottom", bottom=10.0, clearance=2.0), np.array([0.0, 0.0, 7.99]))
    legs.require_room_to_end(mission(ends="last way point", members=1), np.array([0.0, 0.0, -1.0]))
    legs.require_room_to_end(mission(members=2), np.zeros((2, 3)))


def test_the_end_that_was_reached_is_the_nearest():
    ends = mission(ends=["surface", "bottom"], bottom=10.0, clearance=2.0)
    assert [legs.reached(ends, [0, 0, depth]) for depth in (0.1, 7.9, 3.9, 4.1)] == ["surface", "bottom"] * 2
    points = mission(ends=["surface", "last way point"])
    assert [legs.reached(points, [0, 0, depth]) for depth in (1e-4, 5.0)] == ["surface", "last way point"]


# Faults.


def vehicle() -> Any:
    parts = {part.name: part for part in (RUDDER, MOTORS, LEAD)}
    return SimpleNamespace(commanded=tuple(parts.values()), part=parts.__getitem__)


def fault(**given: Any) -> Any:
    return faults._fault("broken", given, vehicle())


def test_an_actuator_stands_somewhere_or_where_it_is_from_a_time_or_a_depth_on():
    found = fault(part="rudder", stuck_deg=10, time_min=2)
    assert (found.part, found.time, found.which) == ("rudder", 120.0, None) and found.value == pytest.approx(
        np.radians(10)
    )
    assert (
        fault(part="rudder", stuck=0.1, time_s=0).value == 0.1
        and fault(part="rudder", stuck=True, time_s=0).value is None
    )
    assert fault(part="motors", out=[1, 3], time_s=1).which == (0, 2) and fault(
        part="motors", out=2, time_s=1
    ).which == (1,)
    assert (
        fault(part="motors", out=True, time_s=1).which is None
        and fault(part="lead", dropped=True, time_s=1).value == 1.0
    )
    deep = fault(part="rudder", stuck=True, depth_ft=10)
    gap = deep.when(SimpleNamespace(q=np.array([0.0, 0.0, 5.0])), None)
    assert gap == pytest.approx(5.0 - 3.048)


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"part": "ruder", "stuck": True, "time_s": 1}, "the vehicle has no actuator 'ruder': did you mean `rudder`"),
        ({"part": "rudder", "time_s": 1}, "needs one of `stuck`, `out` and `dropped`, but has none"),
        ({"part": "rudder", "stuck": True, "out": True, "time_s": 1}, "but has stuck, out"),
        ({"part": "rudder", "stuck": True}, "needs one of `time_s` and `depth_m`"),
        ({"part": "rudder", "stuck": True, "time_s": 1, "depth_m": 2}, "needs one of `time_s` and `depth_m`"),
        ({"part": "rudder", "stuck": True, "time_s": [1, 2]}, "time must be one number"),
        ({"part": "rudder", "stuck": "there", "time_s": 1}, "stuck must be a number, or true"),
        ({"part": "rudder", "stuck": False, "time_s": 1}, "stuck must be a number, or true"),
        ({"part": "rudder", "stuck_m": 1, "time_s": 1}, "stuck_m is in m, but rudder stands in rad"),
        (
            {"part": "rudder", "dropped": True, "time_s": 1},
            "is of a payload, but rudder is of the kind fin",
        ),
        ({"part": "lead", "dropped": 1, "time_s": 1}, "dropped = true is of a payload"),
        ({"part": "motors", "out": 0, "time_s": 1}, "or the numbers of thrusters from 1, but is 0"),
        ({"part": "motors", "out": [1, True], "time_s": 1}, "or the numbers of thrusters from 1"),
        ({"part": "motors", "out": [1.0], "time_s": 1}, "or the numbers of thrusters from 1"),
        ({"prt": "rudder", "stuck": True, "time_s": 1}, "has no key `prt`"),
    ],
)
def test_another_fault_is_refused(given, sentence):
    refused(sentence, lambda: fault(**given))


def test_the_card_says_from_when_on_a_fault_was_there():
    table = {"part": "rudder", "stuck": True, "time_s": 1}
    file = SimpleNamespace(faults={"broken": table, "missing": table}, sensors={})
    there = [0.0, 0.0, 1.0, 1.0]
    run = xr.Dataset({"internal_faults_broken": ("time", there)}, {"time": [0.0, 0.5, 1.0, 1.5]})
    never, some = run * 0, xr.concat([run, run * 0, run], "member")
    said = "(stuck = True, time_s = 1)"
    assert (
        faults.sentences(cast(Any, file), run)[0]
        == "From t = 1 s on, fault `broken` of rudder: stuck = True, time_s = 1."
    )
    assert faults.sentences(cast(Any, file), never)[0] == f"The fault `broken` of rudder {said} did not come."
    assert faults.sentences(cast(Any, file), some)[0] == f"The fault `broken` of rudder {said} came to 2 members."
