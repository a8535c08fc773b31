"""Set points, way points, ends and faults of missions: units, axes, one value a time, and what does not go together."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest
import xarray as xr

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.sections import read
from coadjoint_vehicles.missions import faults, mission_section
from coadjoint_vehicles.parts.part import Command

UNITS = {"depth": "m", "heading": "rad", "speed": "m/s", "rudder": "rad", "thrusters": "N", "attitude": "1"}
RUDDER = SimpleNamespace(name="rudder", kind="fin", command=Command("rad"))
MOTORS = SimpleNamespace(name="motors", kind="thrusters", command=Command("N", (3,)))
LEAD = SimpleNamespace(name="lead", kind="payload", command=Command("1"))


def mission(frame: str = "NED/FRD", **given: Any) -> mission_section.MissionSection:
    return read(mission_section.MissionSection, "mission", given, axes=frame)


def inputs(**given: Any) -> dict[str, Any]:
    return mission(**given).inputs(UNITS, Path)


def refused(sentence: str, call: Any, *given: Any, **more: Any) -> None:
    with pytest.raises(ArgumentError, match=sentence):
        call(*given, **more)


# Set points.


def test_set_points_are_numbers_that_stay_or_values_by_time_in_si_units():
    found = inputs(depth_ft=10, heading_deg=[0, 90], time_min=[0, 1], speed=1.5)
    assert found["depth"] == pytest.approx(3.048) and found["speed"] == 1.5
    heading = found["heading"]
    assert isinstance(heading, co.Held) and np.asarray(heading.times).tolist() == [0.0, 60.0]
    assert np.asarray(heading.values) == pytest.approx([0.0, np.pi / 2])
    linear = inputs(depth=[1, 2], time=[0, 1], between="linear")["depth"]
    assert isinstance(linear, co.Linear)
    assert inputs(thrusters=[1, 2, 3])["thrusters"].tolist() == [1.0, 2.0, 3.0]


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"between": "cubic"}, 'between must be "held" or "linear"'),
        ({"depth": [1, 2]}, "depth has 2 values, so that it needs `time_s`"),
        ({"depth": [1, 2], "time": [0, 1, 2]}, "or a value for each of 3 times, but has 2"),
        ({"depth": "deep"}, "depth must hold finite numbers"),
        ({"depth": [2.0, float("nan")]}, "depth must hold finite numbers"),
        ({"depth": True}, "depth must hold numbers"),
        ({"depth": [1, float("nan")], "time": [0, 1]}, "depth must hold numbers"),
        ({"heading": 7000.0}, "heading` must be of at most 1000 turns"),
        ({"dept": 1.0}, "has no set point `dept`: did you mean `depth`"),
        ({"depth": 1.0, "depth_ft": 3.0}, "gives `depth` twice: once as `depth_ft`"),
        ({"depth_s": 1.0}, "`depth` measures m, but `depth_s` is in s"),
        ({"axes": "ENU/FLU"}, "has no key `axes`"),
    ],
)
def test_another_set_point_is_refused(given, sentence):
    refused(sentence, inputs, **given)


def test_a_mission_in_east_north_up_is_turned_at_its_border():
    turned = mission("ENU/FLU", yaw_deg=[0, 90], pitch=0.25, way_points=[[1, 2, 3]], depth=4.0)
    found = {name: point.values.tolist() for name, point in turned.set_points.items()}
    assert found == {"heading": pytest.approx([np.pi / 2, 0.0]), "pitch": -0.25, "depth": 4.0}
    assert turned.points.tolist() == [[2, 1, -3]] and mission(way_points=[[1, 2, 3]]).points.tolist() == [[1, 2, 3]]
    refused("heading belongs to NED/FRD", lambda: mission("ENU/FLU", heading=0.0).set_points)


# Way points.


def test_way_points_are_three_numbers_each():
    assert mission().points.shape == (0, 3)
    assert mission(way_points=[[1, 2, 3]]).points.tolist() == [[1, 2, 3]]
    for axes, names in (("NED/FRD", "north, east, depth"), ("ENU/FLU", "east, north, up")):
        for wrong in ([1, 2, 3], [[1, 2]]):
            given = mission(axes, way_points=wrong)
            refused(rf"way_points_m must hold \[{names}\] of each point", lambda given=given: given.points)


def test_a_controller_follows_way_points_from_where_the_vehicle_starts():
    helm = SimpleNamespace(period=0.1, delay=0.0)
    assert mission().following(helm, np.zeros(3)) is helm
    for key in ("acceptance", "look_ahead"):
        refused(f"{key} belongs to `way_points_m`", mission, **{key: 1.0})
    refused("need a controller at the helm", mission(way_points=[[1, 2, 3]]).following, None, np.zeros(3))


def test_the_last_way_point_is_reached_within_its_acceptance_or_beside_it():
    controller = SimpleNamespace(way_points=[[0, 30, 0], [10, 0, 0], [20, 0, 0]], acceptance=2.0)
    gap = mission_section.arrival(controller)

    def at(leg: int, x: float, y: float) -> float:
        memory = SimpleNamespace(leg=leg)
        value = SimpleNamespace(memory=memory)
        internal = SimpleNamespace(controller=SimpleNamespace(value=value))
        return evaluate(lambda q: gap(SimpleNamespace(q=q, internal=internal)), np.array([x, y, 0.0]))

    assert at(0, 19.0, 0.0) == 3.0 and at(1, 19.0, 0.0) == pytest.approx(-1.0)
    assert at(1, 15.0, 0.0) == pytest.approx(3.0) and at(1, 21.0, 50.0) == pytest.approx(-1.0)


# Ends.


@pytest.mark.parametrize(
    ("given", "depth", "sentence"),
    [
        ({"ends": "surface"}, -0.5, 'ends at the "surface", but .initial. is 0.5 m above it'),
        ({"ends": "bottom", "bottom": 10.0, "clearance": 2.0}, 8.0, 'at a depth of 8 m, but .initial. is at 8 m'),
        ({"ends": ["surface", "bottom"], "bottom": [10.0]}, 5.0, "bottom must be a number, but is"),
        ({"bottom": 10.0}, 5.0, 'bottom belongs to ends = "bottom"'),
        ({"ends": "surface", "clearance": 1.0}, 5.0, 'clearance belongs to ends = "bottom"'),
        ({"ends": "surface", "members": 2}, 5.0, "would end each of the members at its own time"),
    ],
)  # fmt: skip
def test_a_mission_that_begins_beyond_its_end_is_refused(given, depth, sentence):
    members, start = given.get("members", 1), np.array([0.0, 0.0, depth])
    section = {key: value for key, value in given.items() if key != "members"}
    refused(sentence, lambda: mission(**section).require_start_before_end(start, members))


def test_a_mission_may_begin_at_the_surface_and_just_above_the_bottom():
    mission(ends="surface").require_start_before_end(np.zeros(3), 1)
    bottom = mission(ends="bottom", bottom=10.0, clearance=2.0)
    bottom.require_start_before_end(np.array([0.0, 0.0, 7.99]), 1)
    points = mission(ends="last way point", way_points=[[1, 2, 3]])
    points.require_start_before_end(np.array([0.0, 0.0, -1.0]), 1)
    mission().require_start_before_end(np.zeros((2, 3)), 2)


def test_way_points_within_acceptance_of_the_start_are_refused_without_compiling(caplog):
    points, here = [[10.0, 0, 3], [10.0, 10, 3], [0.0, 10, 3]], np.array([0.0, 0.0, 3.0])
    with jax.log_compiles():
        mission_section.require_to_go(SimpleNamespace(way_points=points, acceptance=5.0), here)
        far = SimpleNamespace(way_points=points, acceptance=20.0)
        refused("within 20 m: give a smaller", lambda: mission_section.require_to_go(far, here))
    assert not [text for text in caplog.messages if text.startswith("Compiling")]


def test_the_end_that_was_reached_is_the_nearest():
    ends = mission(ends=["surface", "bottom"], bottom=10.0, clearance=2.0)
    assert [ends.reached([0, 0, depth]) for depth in (0.1, 7.9, 3.9, 4.1)] == ["surface", "bottom"] * 2
    points = mission(ends=["surface", "last way point"], way_points=[[1, 2, 3]])
    assert [points.reached([0, 0, depth]) for depth in (1e-4, 5.0)] == ["surface", "last way point"]


# Faults.


def vehicle() -> Any:
    parts = {part.name: part for part in (RUDDER, MOTORS, LEAD)}
    return SimpleNamespace(commanded=tuple(parts.values()), part=parts.__getitem__)


def fault(**given: Any) -> Any:
    return faults.read_fault("broken", given).fault(vehicle())


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
        ({"part": "ruder", "stuck": True, "time_s": 1}, "the vehicle has no actuator `ruder`: did you mean `rudder`"),
        ({"part": "rudder", "time_s": 1}, "needs one of `stuck`, `out` and `dropped`, but has none"),
        ({"part": "rudder", "stuck": True, "out": True, "time_s": 1}, "but has stuck, out"),
        ({"part": "rudder", "stuck": True}, "needs one of `time_s` and `depth_m`"),
        ({"part": "rudder", "stuck": True, "time_s": 1, "depth_m": 2}, "needs one of `time_s` and `depth_m`"),
        ({"part": "rudder", "stuck": True, "time_s": [1, 2]}, "time must be a number, but is"),
        ({"part": "rudder", "stuck": "there", "time_s": 1}, "stuck must be a number, or true"),
        ({"part": "rudder", "stuck": False, "time_s": 1}, "stuck must be a number, or true"),
        ({"part": "rudder", "stuck_m": 1, "time_s": 1}, "stuck_m is in m, but rudder stands in rad"),
        (
            {"part": "rudder", "dropped": True, "time_s": 1},
            "is of a payload, but rudder is of the kind fin",
        ),
        ({"part": "lead", "dropped": 1, "time_s": 1}, "dropped = true is of a payload"),
        ({"part": "motors", "out": 0, "time_s": 1}, "or the numbers of thrusters from 1 to 3, but is 0"),
        ({"part": "motors", "out": [1, 4], "time_s": 1}, "or the numbers of thrusters from 1 to 3, but is"),
        ({"part": "motors", "out": [1, True], "time_s": 1}, "or the numbers of thrusters from 1"),
        ({"part": "motors", "out": [1.0], "time_s": 1}, "or the numbers of thrusters from 1"),
        ({"prt": "rudder", "stuck": True, "time_s": 1}, "has no key `prt`"),
    ],
)
def test_another_fault_is_refused(given, sentence):
    refused(sentence, lambda: fault(**given))


def test_the_card_says_from_when_on_a_fault_was_there():
    table = {"part": "rudder", "stuck": True, "time_s": 1}
    broken, missing = (faults.read_fault(name, table) for name in ("broken", "missing"))
    there = [0.0, 0.0, 1.0, 1.0]
    run = xr.Dataset({"internal_faults_broken": ("time", there)}, {"time": [0.0, 0.5, 1.0, 1.5]})
    never, some = run * 0, xr.concat([run, run * 0, run], "member")
    said = "(stuck = True, time_s = 1)"
    assert broken.sentence(run) == "From t = 1 s on, fault `broken` of rudder: stuck = True, time_s = 1."
    assert broken.sentence(never) == f"The fault `broken` of rudder {said} did not come."
    assert broken.sentence(some) == f"The fault `broken` of rudder {said} came to 2 members."
    assert missing.sentence(run) is None
