"""The parts of the search for steady flight, of made-up vehicles: starts, steps, conditions, and limits."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.spaces.named import Named
from coadjoint_vehicles.trim import flight, reading
from coadjoint_vehicles.trim.flight import STEPS, SteadyFlight


@pytest.mark.parametrize(
    ("actual", "range_", "over"),
    [
        (0.3, (-0.2, 0.2), (0.3, 0.2)),
        (-0.5, (-0.2, 0.4), (-0.5, -0.2)),
        ([0.1, -0.9, 0.5], (-0.4, 0.4), (-0.9, -0.4)),
        (0.2, (-0.2, 0.2), None),
        (0.2 + 3e-10, (-0.2, 0.2), None),
        (0.2 + 5e-10, (-0.2, 0.2), (0.2 + 5e-10, 0.2)),
        (9.0, None, None),
    ],
)
def test_an_actuator_is_beyond_its_range_by_its_worst_component(actual, range_, over, monkeypatch):
    monkeypatch.setattr(reading, "travel", lambda part: range_)
    assert reading._over(cast(Any, SimpleNamespace(units=None)), np.asarray(actual)) == over
    if range_ is not None:
        moved = Named(position=np.asarray(actual), speed=np.float64(0.1))
        assert reading._over(cast(Any, SimpleNamespace(units={})), moved) == over


def test_a_held_actuator_is_a_part_of_its_way_there():
    assert flight._between(1.0, 5.0, 0.25) == 2.0
    np.testing.assert_allclose(flight._between(np.zeros(1), 2.0, 0.5), [1.0])
    both = flight._between(Named(position=1.0, speed=np.zeros(2)), {"position": 3.0, "speed": [2.0, 4.0]}, 0.5)
    assert both.position == 2.0 and both.speed.tolist() == [1.0, 2.0]
    with pytest.raises(ArgumentError, match=r"takes shape \(2,\), but got \(3,\)"):
        flight._between(np.zeros(2), np.ones(3), 0.5)


def flying(**changes: Any) -> Any:
    """A flight whose methods are those of the class, over fields that are given."""
    made = object.__new__(SteadyFlight)
    made.__dict__.update(
        {"climb": 0.3, "turning": False, "hold": {}, "free": (), "_searches": {}, "_last": "path"} | changes
    )
    return made


@pytest.mark.parametrize(
    ("hold", "turning", "climb", "way"),
    [
        ({}, False, 0.0, ("ahead", (1,))),
        ({}, True, 0.0, ("ahead", (1,))),
        ({"a": 1}, False, 0.0, ("ahead", (1,))),
        ({"a": 1}, True, 0.0, "turn"),
        ({"a": 1}, True, np.pi / 2, ("ahead", STEPS)),
    ],
)
def test_turns_are_looked_for_where_an_actuator_is_held_and_the_path_is_not_vertical(hold, turning, climb, way):
    made = flying(hold=hold, turning=turning, climb=climb)
    made._ahead, made._turn = lambda speed, steps: ("ahead", steps), lambda speed: "turn"
    assert made._found(1.5) == way
    made._guess = lambda speed, part: (speed, part)
    made._search = lambda kind, guess: SimpleNamespace(find=lambda start, speed: (kind, guess, start, speed))
    assert made._found(0.0) == ("rest", (0.0, 1.0), (0.0, 1.0), 0.0)


def test_a_straight_course_is_reached_in_the_first_number_of_steps_that_leads_there():
    made, tried = flying(), []

    def reached(kind, speed, n):
        tried.append((kind, n))
        if len(tried) < 3:
            raise ArgumentError("no")
        return kind, n

    made._reached = reached
    made.vehicle = SimpleNamespace(part=lambda name: SimpleNamespace(command=SimpleNamespace(shape=(6,))))
    made.free = ("thrusters",)
    assert made._ahead(1.0, (1, 4)) == ("path", 1) and tried == [("upright", 1), ("upright", 4), ("path", 1)]
    tried.clear()
    made.vehicle = SimpleNamespace(part=lambda name: SimpleNamespace(command=SimpleNamespace(shape=(5,))))
    with pytest.raises(ArgumentError):
        made._ahead(1.0, (1, 4))
    assert tried == [("path", 1), ("path", 4)]


def test_held_actuators_go_to_their_places_in_even_steps():
    made, found = flying(), []
    made._guess = lambda speed, part: f"guess {part:g}"
    made._awake = lambda guess, search, speed: f"awake {guess}"
    made._held = lambda state, part: f"{state} held {part:g}"
    search = SimpleNamespace(
        find=lambda start, speed: found.append((start, speed)) or SimpleNamespace(state=len(found))
    )
    made._search = lambda kind, guess: search
    assert made._reached("upright", 1.5, 3).state == 3 and made._last == "upright"
    assert found == [("awake guess 0.333333", 1.5), ("1 held 0.666667", 1.5), ("2 held 1", 1.5)]


def test_a_turn_within_limits_is_preferred_to_the_one_beyond_them(monkeypatch):
    made = flying(vehicle="boat")
    made._guess, made._search = lambda speed, part: "guess", lambda kind, guess: kind
    made._awake, made._is_within = lambda *given: given, lambda motion: motion.startswith("good")
    asked: list[Any] = []

    def turns(*given):
        asked.append(given)
        yield from others

    monkeypatch.setattr(flight, "turns", turns)
    made._ahead = lambda speed, steps: "good straight"
    others = ["never"]
    made._last = "upright"
    assert made._turn(1.0) == "good straight" and made._last == "upright" and asked == []
    made._ahead = lambda speed, steps: "far"
    others = ["far too", "good turn", "good later"]
    assert made._turn(1.0) == "good turn" and made._last == "path"
    assert asked == [(("guess", "path", 1.0), "path", 1.0, "boat")]
    others, made._last = ["far too"], "upright"
    assert made._turn(1.0) == "far" and made._last == "upright"

    def fails(speed, steps):
        raise ArgumentError("no straight course")

    made._ahead = fails
    assert made._turn(1.0) == "far too"
    others = []
    with pytest.raises(ArgumentError, match="no straight course"):
        made._turn(1.0)


@pytest.mark.parametrize(
    ("net", "told"),
    [(5.0, "5 N heavier than .* .negatively buoyant"), (-2.5, "2.5 N lighter .* .positively"), (1e-5, "none$")],
)
def test_a_flight_that_is_not_found_says_how_far_the_vehicle_is_from_neutral(net, told, monkeypatch):
    monkeypatch.setattr(flight, "loads", lambda vehicle: SimpleNamespace(net_weight=net))
    made = flying(vehicle=SimpleNamespace(buoyancy=100.0), craft=SimpleNamespace(start=lambda: None))

    def find(*given):
        raise ArgumentError("none")

    made._held, made._found = lambda state, part: state, find
    with pytest.raises(ArgumentError, match=told):
        made.at(1.5)


def test_a_motion_is_looked_for_near_another_unless_its_turn_is_beyond_limits():
    made = flying(craft=SimpleNamespace(start=lambda: None), hold={"rudder": 1.0}, turning=True)
    made._held, made._found = lambda state, part: state, lambda speed: "anew"
    made._searches = {"path": SimpleNamespace(find=lambda state, speed: (state, speed))}
    near = cast(Any, SimpleNamespace(state="near"))
    for within, speed, expected in ((True, 1.5, ("near", 1.5)), (False, 1.5, "anew"), (True, 0.0, "anew")):
        made._is_within = lambda motion, within=within: within
        assert made.at(speed, near=near) == expected
    made.turning = False
    made._is_within = lambda motion: False
    assert made.at(1.5, near=near) == ("near", 1.5)
    made._searches = {}
    assert made.at(1.5, near=near) == "anew" and made.at(1.5) == "anew"


@pytest.mark.parametrize(("held", "within"), [((), False), (("rudder",), True)])
def test_what_is_held_may_be_beyond_its_limits(held, within, monkeypatch):
    monkeypatch.setattr(flight, "trim", lambda vehicle, motion: SimpleNamespace(beyond=("rudder",)))
    assert flying(vehicle="boat", hold=dict.fromkeys(held, 1.0))._is_within("motion") == within


def test_idle_actuators_begin_where_they_have_an_effect(monkeypatch):
    class Thrusters:
        def allocate(self, wrench):
            return 10 * wrench

    parts = {"jets": Thrusters(), "fin": "bounded", "screw": "unbounded"}
    monkeypatch.setattr(flight, "Thrusters", Thrusters)
    monkeypatch.setattr(flight, "travel", lambda part: (-3.0, 2.0) if part == "bounded" else None)
    monkeypatch.setattr(flight, "evaluate", lambda function, *given: function(*given))
    slopes = SimpleNamespace(rate=np.arange(12.0))
    idle = ["jets", "fin", "screw", "mass.position"]
    search = SimpleNamespace(idle=lambda guess, speed: idle, reduced=SimpleNamespace(slopes=lambda guess: slopes))
    kept: dict[str, Any] = {}
    internal = SimpleNamespace(jets=0.0, fin=0.5, screw=0.25, replace=lambda **values: kept.update(values))
    guess = SimpleNamespace(internal=internal, replace=lambda internal: "moved")
    made = flying(vehicle=SimpleNamespace(part=parts.__getitem__))
    assert made._awake(guess, search, 1.0) == "moved"
    assert kept.pop("jets").tolist() == [-60, -70, -80, 0, -10, -20]
    assert kept == pytest.approx({"fin": 0.5 + flight.AWAKE * 1.5, "screw": 0.25 + flight.AWAKE * 0.75})
    idle.clear()
    assert made._awake(guess, search, 1.0) is guess


@pytest.mark.parametrize(
    ("turning", "climb", "expected"),
    [
        (True, 0.3, [(0.5**2 + 0.2**2 + 0.1**2 - 4.0) / 2.0, 0.5 * 0.1 + 0.2 * 0.3 - 0.1 * 0.9 + 2.0 * np.sin(0.3)]),
        (False, -np.pi / 2, [0.5 - 2.0 * 0.1, 0.2 - 2.0 * 0.3, -0.1 - 2.0 * 0.9]),
    ],
)
def test_a_flight_has_its_speed_and_sinks_as_its_path_does(turning, climb, expected, monkeypatch):
    monkeypatch.setattr(flight, "jnp", np)
    down = np.array([0.1, 0.3, 0.9])
    system = SimpleNamespace(group=None, advected=SimpleNamespace(view=lambda group, a: SimpleNamespace(down=down)))
    made = flying(turning=turning, climb=climb, craft=SimpleNamespace(system=system))
    state = SimpleNamespace(nu=np.array([0.5, 0.2, -0.1]), xi=np.array([7.0, 8.0, 9.0]), a=None)
    np.testing.assert_allclose(made._conditions(state, 2.0), expected, atol=1e-15)
    if turning:
        made.turning = False
        np.testing.assert_allclose(made._conditions(state, 2.0), [*expected, 7.0, 8.0, 9.0])
    np.testing.assert_allclose(flight._at_rest(cast(Any, state), None), [0.5, 0.2, -0.1, 7.0, 8.0, 9.0])


def test_held_values_are_those_of_the_command_at_rest():
    kept: dict[str, Any] = {}
    internal = SimpleNamespace(rudder=np.float64(0.5), replace=lambda **values: kept.update(values))
    part = SimpleNamespace(at_rest=lambda value: 2.0 * value)
    made = flying(
        hold={"rudder": 1.5}, vehicle=SimpleNamespace(part=lambda name: part),
        craft=SimpleNamespace(start=lambda: SimpleNamespace(internal=internal)),
    )  # fmt: skip
    state = SimpleNamespace(internal=internal, replace=lambda internal: "held")
    assert made._held(state, 0.5) == "held" and kept == {"rudder": 1.75}
    made.hold = {}
    assert made._held(state, 0.5) is state
