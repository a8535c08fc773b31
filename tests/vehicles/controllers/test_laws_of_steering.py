"""One period of controllers that fly in long tests alone, against their formulas in NumPy."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from coadjoint_vehicles.controllers import (
    Attitude,
    Cruise,
    Hover,
    LineOfSight,
    Manoeuvre,
    Pose,
    attitude,
    cruise,
    design,
    hover,
    line_of_sight,
    proposed,
)
from coadjoint_vehicles.controllers.trial import TRIAL, Trial
from coadjoint_vehicles.model.controller import Controller

TURN = Rotation.from_euler("ZYX", [0.6, -0.3, 0.2])
R = TURN.as_matrix()


@pytest.fixture(autouse=True)
def eager(monkeypatch):
    """Formulas in float64 without traces."""
    for module in (attitude, hover, line_of_sight, cruise):
        monkeypatch.setattr(module, "jnp", np)


def felt(**more: Any) -> Any:
    return SimpleNamespace(down=R[2], north=R[0], **more)


# attitude

MODEL = SimpleNamespace(
    rolls=1.0, flow=np.arange(15.0).reshape(3, 5) / 10, weight=np.array([[0.1, 0, 0.2], [0, 0.3, 0], [0.4, 0, 0]]),
    inverse=np.array([[2.0, 0.1, 0.0], [0.0, 3.0, 0.2], [0.3, 0.0, 4.0]]), ahead=np.array([0.01, 0.02, 0.03]),
)  # fmt: skip


def steered(monkeypatch, *, error, rolls=1.0, ahead_speed=1.2, limit=100.0, following=(0.1, 0.2, -0.1)):
    """The commands and the memory of `Attitude` where it is off by a rotation vector."""
    goal = (TURN * Rotation.from_rotvec(error).inv()).as_matrix()
    monkeypatch.setattr(attitude, "pull", lambda feedback, memory, own: (5.0, memory + 1.0))
    monkeypatch.setattr(attitude, "commands_of", lambda allocation, fins, vehicle: (allocation, fins, vehicle))
    feedback = felt(
        velocity=np.array([ahead_speed, 0.3, -0.2]), omega=np.array([0.01, 0.05, -0.03]),
        inputs=SimpleNamespace(attitude=goal),
    )  # fmt: skip
    own = SimpleNamespace(
        model=SimpleNamespace(**{**vars(MODEL), "rolls": rolls}), speed=1.5, period=0.2, fin_limit=limit,
        attitude_gains=np.array([2.0, 0.5, 1.5]),
    )  # fmt: skip
    memory = SimpleNamespace(attitude=np.array(following), speed=3.0)
    (allocation, fins, vehicle), kept = Attitude.steer(
        cast(Any, SimpleNamespace(allocation="shares")), feedback, cast(Any, memory), cast(Any, own), cast(Any, "boat")
    )
    assert (allocation, vehicle, kept["speed"]) == ("shares", "boat", 4.0)
    return feedback, goal, memory, fins, kept["attitude"]


def wanted_fins(feedback, e, memory):
    """δ = (U/u)² G⁺ (α − (u/U) A (v, w, ω) − b), and the integral."""
    integral = memory.attitude + 0.2 * e
    alpha = -2.0 * e - 0.5 * integral - 1.5 * feedback.omega
    u = feedback.velocity[0] / 1.5
    flow = MODEL.flow @ np.array([*feedback.velocity[1:], *feedback.omega])
    return MODEL.inverse @ (alpha - u * flow - MODEL.weight @ feedback.down) / max(u, 0.5) ** 2, integral


@pytest.mark.parametrize("speed", [1.2, 0.3])
def test_fins_turn_towards_an_attitude_against_flow_and_weight(speed, monkeypatch):
    axis = np.array([0.2, -0.1, 0.3])
    feedback, goal, memory, fins, kept = steered(monkeypatch, error=axis, ahead_speed=speed)
    E = goal.T @ R
    e = 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
    assert np.linalg.norm(e) == pytest.approx(np.sin(np.linalg.norm(axis)))
    expected, integral = wanted_fins(feedback, e, memory)
    np.testing.assert_allclose(fins, expected + 5.0 * MODEL.ahead, rtol=1e-12)
    np.testing.assert_allclose(kept, integral, rtol=1e-12)


def test_where_roll_has_no_fins_the_nose_alone_is_turned(monkeypatch):
    feedback, goal, memory, fins, kept = steered(monkeypatch, error=np.array([0.5, 0.2, -0.3]), rolls=0.0)
    nose = R.T @ goal[:, 0]
    e = np.cross(nose, [1.0, 0.0, 0.0])
    expected, integral = wanted_fins(feedback, e, memory)
    np.testing.assert_allclose(fins, expected + 5.0 * MODEL.ahead, rtol=1e-12)
    np.testing.assert_allclose(kept, integral, rtol=1e-12)
    np.testing.assert_allclose(attitude.pointing_error(R, goal), e, atol=1e-15)


def test_fins_at_their_limit_are_scaled_alike_and_the_integral_stops(monkeypatch):
    _, _, memory, free, _ = steered(monkeypatch, error=np.array([0.2, 0.1, 0.1]))
    largest = np.max(np.abs(free - 5.0 * MODEL.ahead))
    *_, fins, kept = steered(monkeypatch, error=np.array([0.2, 0.1, 0.1]), limit=0.5 * largest)
    np.testing.assert_allclose(fins - 5.0 * MODEL.ahead, 0.5 * (free - 5.0 * MODEL.ahead), rtol=1e-12)
    np.testing.assert_array_equal(kept, memory.attitude)
    for angle, grows in ((0.52, True), (0.53, False)):  # |e| = sin of the angle, ½ at 30°
        *_, kept = steered(monkeypatch, error=np.array([0.0, angle, 0.0]), limit=1e3)
        assert np.array_equal(kept, memory.attitude) != grows
    begun = Attitude().memory()
    assert list(begun) == ["attitude", "speed"] and begun["speed"] == 0.0 and not begun["attitude"].any()
    assert begun["attitude"].shape == (3,)


def test_the_model_of_a_vehicle_is_among_the_parameters_of_its_controller():
    model = design.TurningModel(*range(len(design.TurningModel._fields)))
    assert Attitude(model=model).parameters()["model"] == model._asdict() and "model" not in Attitude().parameters()


# hover


@pytest.mark.parametrize("off", [(0.3, -0.4, 0.5), (3.0, -4.0, 5.0)])
def test_a_place_is_kept_by_a_bounded_pull_along_axes_of_space(off):
    off, reach = np.array(off), 2.0
    feedback = felt(
        position=np.array([1.0, 2.0, 3.0]), ground_velocity=np.array([0.1, 0.2, -0.3]),
        inputs=SimpleNamespace(north=1.0 + off[0], east=2.0 + off[1], depth=3.0 + off[2]),
    )  # fmt: skip
    own = SimpleNamespace(reach=reach, period=0.25, position_gains=np.array([0.6, 0.1, 0.9]))
    memory = SimpleNamespace(position=np.array([0.5, 0.4, -0.3]), attitude="turned")
    asked: list[Any] = []

    def commands(*given):
        asked.extend(given)
        return "commands", "lost"

    law = SimpleNamespace(
        wanted=lambda given: "goal", turn_to=lambda *given: (given, "integral"), commands=commands
    )  # fmt: skip
    found, kept = Hover.steer(cast(Any, law), feedback, cast(Any, memory), cast(Any, own), cast(Any, "boat"))
    distance = np.linalg.norm(off)
    integral = memory.position + 0.25 * off if distance < reach else memory.position
    aim = 0.6 * off * min(1.0, reach / distance) + 0.1 * integral
    np.testing.assert_allclose(asked[0], R.T @ aim - 0.9 * feedback.ground_velocity, rtol=1e-9)
    assert asked[1][0] == "goal" and asked[1][1:] == (feedback, "turned", own) and asked[2:] == [feedback, own, "boat"]
    np.testing.assert_allclose(kept.pop("position"), integral, rtol=1e-12)
    assert (found, kept) == ("commands", {"lost": "lost", "attitude": "integral"})


def test_a_heading_is_turned_to_level_and_a_pose_to_its_attitude(monkeypatch):
    given = SimpleNamespace(inputs=SimpleNamespace(attitude=R, heading=0.7), heading=0.5)
    assert Pose().wanted(cast(Any, given)) is R
    level = Hover().wanted(cast(Any, given))
    np.testing.assert_allclose(level, Rotation.from_euler("z", 0.7).as_matrix(), atol=1e-15)


def test_whether_a_controller_keeps_level():
    level = LineOfSight(way_points=[[0, 0, 1], [1, 0, 1]], helm=Cruise())
    upright = [one.keeps_level for one in (Cruise(), Hover(), Manoeuvre(), level)]
    assert upright == [True] * 4 and not Pose().keeps_level and not Attitude().keeps_level
    assert not LineOfSight(way_points=[[0, 0, 1], [1, 0, 1]]).keeps_level
    assert cast(Any, Controller.keeps_level).fget(None) is False


# line of sight

WAYS = np.array([[0.0, 0.0, 5.0], [30.0, 40.0, 5.0], [30.0, 90.0, 15.0]])


def guided(monkeypatch, position, leg=0.0, acceptance=4.0, names=("heading", "depth")):
    monkeypatch.setattr(line_of_sight, "Held", lambda times, values: lambda t: values[int(t)])
    asked: list[Any] = []

    def steer(*given):
        asked.extend(given)
        return "commands", "remembered"

    given = {"speed": 1.5}
    feedback = SimpleNamespace(
        position=np.array(position), inputs=SimpleNamespace(asdict=lambda: given), _replace=lambda inputs: inputs
    )
    memory = SimpleNamespace(leg=leg, beside=20.0, beneath=-10.0, helm="helm memory")
    own = SimpleNamespace(
        way_points=WAYS, acceptance=acceptance, look_ahead=10.0, gain=0.2, period=0.5, helm="helm own"
    )
    law = SimpleNamespace(helm=SimpleNamespace(steer=steer), way_points=WAYS, _wanted=lambda: names)
    commands, kept = LineOfSight.steer(
        cast(Any, law), cast(Any, feedback), cast(Any, memory), cast(Any, own), cast(Any, "b")
    )
    assert (commands, kept["helm"]) == ("commands", "remembered") and asked[1:] == ["helm memory", "helm own", "b"]
    set_points = asked[0].asdict()
    assert set_points["speed"] == 1.5
    assert kept["wanted"] == {name: set_points[name] for name in names}
    return set_points, kept


def angle(across, integral):
    """−atan((y + σI)/Δ) and I ← I + T Δ y/(Δ² + (y + σI)²)."""
    after = integral + 0.5 * 10.0 * across / (100.0 + (across + 0.2 * integral) ** 2)
    return -np.arctan((across + 0.2 * after) / 10.0), after


def test_on_the_first_leg_the_course_leads_back_to_it(monkeypatch):
    along, across = np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])
    set_points, kept = guided(monkeypatch, WAYS[0] + 20.0 * along + 3.0 * across + [0, 0, 2.0])
    turned, beside = angle(3.0, 20.0)
    sunk, beneath = angle(2.0, -10.0)
    assert set_points["heading"] == pytest.approx(np.arctan2(0.8, 0.6) + turned)
    assert set_points["depth"] == 5.0 and set_points["pitch"] == pytest.approx(-sunk)
    assert kept["leg"] == 0.0 and kept["beside"] == pytest.approx(beside) and kept["beneath"] == pytest.approx(beneath)


def test_within_the_circle_of_acceptance_the_next_leg_begins_with_its_integrals_at_zero(monkeypatch):
    set_points, kept = guided(monkeypatch, [30.0, 36.5, 5.0], names=("heading", "pitch"))
    climb = -np.arctan2(10.0, 50.0)
    turned, beside = angle(0.0, 0.0)
    sunk, beneath = angle(np.sin(climb) * -3.5, 0.0)
    assert kept["leg"] == 1.0 and set_points["depth"] == 15.0 and kept["beside"] == pytest.approx(beside, abs=1e-12)
    assert set_points["heading"] == pytest.approx(np.pi / 2 + turned) and set_points["pitch"] == pytest.approx(
        climb - sunk
    )
    assert kept["beneath"] == pytest.approx(beneath)
    assert guided(monkeypatch, [30.0, 36.5, 5.0], acceptance=3.4)[1]["leg"] == 0.0
    for leg in (0.0, 1.0):  # abreast of the end, and no leg is behind the last
        assert guided(monkeypatch, [200.0, 300.0, 5.0], leg=leg)[1]["leg"] == 1.0


# cruise, design, trials, proposals


def test_a_pitch_that_is_asked_for_is_bounded_and_leaves_the_integral_of_depth():
    for asked, given in ((0.9, 0.4), (-0.9, -0.4), (0.1, 0.1)):
        feedback, own = SimpleNamespace(inputs=SimpleNamespace(pitch=asked)), SimpleNamespace(pitch_limit=0.4)
        law = SimpleNamespace(vertical="pitch")
        assert Cruise._climb(
            cast(Any, law), cast(Any, feedback), cast(Any, SimpleNamespace(depth=7.0)), cast(Any, own)
        ) == (given, 7.0)


def test_without_a_gain_half_a_turn_asks_for_nothing_and_without_screws_speed_has_no_gains():
    assert design.reach(cast(Any, None), cast(Any, None), "heading", np.zeros(3), 0.2) == np.pi
    motion = SimpleNamespace(mass=np.eye(6))
    assert design.surging(cast(Any, motion), cast(Any, SimpleNamespace(matrix=np.zeros((2, 4)))), 0.1).tolist() == [
        0,
        0,
        0,
    ]


def test_a_trial_tells_its_manoeuvre_and_the_shares_of_its_fins():
    shares = np.arange(8.0).reshape(2, 4)
    made = SimpleNamespace(
        allocation=SimpleNamespace(matrix=shares, names=("a", "b")), length=2, manoeuvre="turning circle"
    )
    told = json.loads(Trial.attributes(cast(Any, made))[TRIAL])
    assert told == {"manoeuvre": "turning circle", "fins": ["a", "b"], "shares": [2.0, 6.0], "length": 2.0}
    made.length = None
    assert json.loads(Trial.attributes(cast(Any, made))[TRIAL])["length"] is None


def test_three_thrusters_or_more_manoeuvre_and_fewer_cruise(monkeypatch):
    class Thrusters:
        name = "jets"

        def __init__(self, count):
            self.count = count

    for name in ("Manoeuvre", "Cruise"):
        kind = type(
            name, (), {"__init__": lambda self, **given: self.__dict__.update(given), "fitted": lambda self, v: self}
        )
        monkeypatch.setattr(proposed, name, kind)
    monkeypatch.setattr(proposed, "Thrusters", Thrusters)
    found = [proposed.proposed_controller(cast(Any, SimpleNamespace(parts=[Thrusters(n)])), 2.0) for n in (2, 3)]
    assert vars(found[0]) == {"speed": 2.0} and vars(found[1]) == {"thrusters": "jets"}
    own = SimpleNamespace(controller="own", parts=[])
    assert proposed.own_controller(cast(Any, own)) == "own"
    own.controller = None
    assert vars(cast(Any, proposed.own_controller(cast(Any, own)))) == {"speed": 1.5}
