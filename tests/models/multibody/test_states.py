"""States by coordinates and speeds of joints, and coordinates as data."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups import attitude
from coadjoint.models.multibody import Body, Joint, Mechanism, mechanism
from coadjoint.models.multibody.placing import Placing
from mechanisms import ARM, MOMENTS, four_bar, gears, pendulum


def placing(made: Mechanism, coordinates=None, speeds=None, rates=None) -> Placing:
    return Placing(made, coordinates or {}, speeds or {}, {}, rates or {}, {})


def test_a_wheel_is_placed_by_the_one_that_it_meshes_with():
    R, _, xi, _ = placing(gears(20, 30), {"one": 1.0}, {"two": 2.0}).found()
    assert np.arctan2(R[:, 1, 0], R[:, 0, 0]) == pytest.approx([1, -2 / 3], abs=1e-14)
    assert xi[:, 2] == pytest.approx([-3, 2], abs=1e-14)


def test_a_speed_alone_leaves_the_coordinate_free_and_a_coordinate_alone_the_speed():
    found = placing(gears(20, 30), {"one": 1.0}, {"two": 2.0})
    assert found.coordinates_and_speeds == {"one": ((1.0,), (0.0,))}
    assert not found.speeds_are_held
    assert placing(gears(20, 30), {"one": 1.0}).speeds_are_held
    assert placing(gears(20, 30), {"one": 1.0}, {"one": 1.0}).speeds_are_held
    assert not placing(pendulum(), {"hinge": 1.0}, rates={"rod": (0, 3, 0)}).speeds_are_held


def test_a_body_before_a_joint_is_placed_from_the_one_behind_it():
    """By a screw off the origin, then forth again: places, and rates of the fields of velocities."""
    axis, pose = {"axis": (0.2, -0.5, 0.8), "at": (0.3, 0.1, -0.2)}, (attitude.zyx(0.5, -0.3, 0.9), (0.4, -0.7, 0.2))
    first, second = (Body(mass=1.0, inertia=np.eye(3), center=c) for c in ((0.1, 0, 0), (0, -0.2, 0.3)))
    bodies, joints = {"a": first, "b": second}, {"screw": Joint("screw", "a", "b", pitch=0.7, **axis)}
    made = SimpleNamespace(
        bodies=bodies, joints=joints, reference=lambda one: (np.eye(3), np.array(bodies[one].center))
    )
    given = {"screw": 0.6}, {"screw": -1.3}
    back = Placing(made, *given, {"b": pose}, {}, {})
    R, x = back.places["a"]
    forth = Placing(made, *given, {"a": (R, x - R @ first.center)}, {}, {})
    for one in (back, forth):
        np.testing.assert_allclose(one.places["b"][0], pose[0], atol=1e-14)
        np.testing.assert_allclose(one.places["b"][1], pose[1] + pose[0] @ second.center, atol=1e-14)
    (omega, v), (spin, rate) = back.twists["a"], forth.twists["b"]
    np.testing.assert_allclose(spin, -omega, atol=1e-14)  # seen from one body and from the other
    np.testing.assert_allclose(rate, -v - np.cross(omega, forth.places["b"][1] - x), atol=1e-14)


@pytest.mark.parametrize("speeds", [{}, {"A": 2.0}, {"C": 2.0}], ids=["still", "of the same", "of another"])
def test_coordinates_are_held_first_and_speeds_of_other_joints_at_the_place_found(monkeypatch, speeds):
    """Projected with the coordinate of A held; and from there with its speed, unless both say the same joint."""
    held: list[Any] = []

    def projected(them, g, q, xi, qdot):
        held.append(({key: type(one).__name__ for key, one in them.items()}, (g, q, xi, qdot)))
        return tuple(f"{name} found" for name in ("g", "q", "xi", "qdot"))

    values = [{key: np.array([x]) for key, x in given.items()} for given in ({"A": 0.4}, speeds)]
    both = {"A": ((0.4,), (float(speeds.get("A", 0.0)),))}
    placed = SimpleNamespace(
        coordinates=values[0], speeds=values[1], coordinates_and_speeds=both, needs_projection=True,
        speeds_are_held="C" not in speeds, found=lambda: ("g", "q", "xi", "qdot"),
    )  # fmt: skip
    monkeypatch.setattr(mechanism, "Placing", lambda made, *given: placed)
    told: list[Any] = []
    bond = SimpleNamespace(warn_of_turns=lambda *given: told.append(given), gap=len, rows=len, right=len)
    monkeypatch.setattr(mechanism, "HeldCoordinates", lambda bond, both: bond)
    monkeypatch.setattr(mechanism, "HeldSpeeds", lambda bond, speed: bond)
    parameters = SimpleNamespace(A="its numbers")
    one: Any = SimpleNamespace(
        bonds={"A": bond, "C": bond}, system=SimpleNamespace(parameters=parameters), _projected=projected
    )
    found = Mechanism._placed(one, [])
    assert found[0] == "g found" and told == [(values[0]["A"], "its numbers")]
    first = {"A": "Holonomic"}, ("g", "q", "xi", "qdot")
    then = {"C": "Nonholonomic"}, ("g found", "q found", "xi", "qdot")
    assert held == [first, then] if "C" in speeds else held == [first]
    placed.needs_projection = False
    assert Mechanism._placed(one, []) == ("g", "q", "xi", "qdot")


def test_a_state_that_is_not_there_names_what_was_given_and_the_freedoms(monkeypatch):
    place = SimpleNamespace(g="g", q="q", xi="xi", qdot="qdot")
    asked: list[Any] = []

    def project(state):
        raise co.errors.ArgumentError("No state on the constraints was found.")

    near = SimpleNamespace(project=lambda state: place, constraints=())
    one: Any = SimpleNamespace(
        system=near, _state=lambda *given: given, freedoms=lambda state: 1,
        _system=lambda held: asked.append(list(held)) or SimpleNamespace(project=project),
    )  # fmt: skip
    assert Mechanism._projected(one, {}, 1, 2, 3, 4) == ("g", "q", "xi", "qdot") and asked == []
    place_of, speed_of = co.Holonomic(len), co.Nonholonomic(len)
    with pytest.raises(co.errors.ArgumentError, match="No state on the constraints"):
        Mechanism._projected(one, {"A": place_of}, 1, 2, 3, 4)
    assert asked == [["A__held"]]
    for held, what in ((place_of, "coordinates"), (speed_of, "speeds")):
        with pytest.raises(
            co.errors.ArgumentError, match=f"No state has the {what} given for `A`.*`B`.* 1 freedom near"
        ):
            Mechanism._projected(one, {"A": place_of if what == "coordinates" else speed_of, "B": held}, 1, 2, 3, 4)
    made: Any = SimpleNamespace(bodies=["a", "b"], system=near)
    assert Mechanism.freedoms(made, cast(Any, None)) == 12
    near.constraints = ("hinge",)
    monkeypatch.setattr(mechanism, "count", lambda system: 5)
    for independent, free in ((None, 7), ((0, 1, 3), 9)):
        monkeypatch.setattr(mechanism, "checked_start", lambda system, state, found=independent: found)
        assert Mechanism.freedoms(made, cast(Any, None)) == free


@pytest.mark.long
def test_speeds_of_other_joints_and_rates_of_bodies_stay_with_given_coordinates():
    linkage, swing = four_bar(), pendulum()
    turned = linkage.joint_data(linkage.state(coordinates={"A": 0.4}, speeds={"C": 2.0}))
    assert (float(turned.A), float(turned.C_speed)) == pytest.approx((0.4, 2), abs=1e-12)
    velocity = 3 * ARM * np.array([-np.cos(1), 0, np.sin(1)])
    state = swing.state(coordinates={"hinge": 1.0}, rates={"rod": (0, 3, 0)}, velocities={"rod": velocity})
    assert swing.joint_data(state).hinge_speed == pytest.approx(3, abs=1e-12)


class Members(NamedTuple):
    """What joint data reads of an ensemble."""

    records: co.mechanics.State
    system: co.System


def test_joint_data_of_members_and_of_one_state_are_theirs():
    """ω = J⁻¹μ by the inertia of each member."""
    swing = pendulum()
    start = swing.state(coordinates={"hinge": co.each([0.3, 0.6])}, speeds={"hinge": co.each([2.0, 3.0])})
    assert swing.joint_data(start).hinge_speed.values == pytest.approx([2, 3], abs=1e-14)
    alone = swing.joint_data(jax.tree.map(lambda leaf: leaf[0], start))
    assert alone.hinge.shape == () and alone.hinge == pytest.approx(0.3, abs=1e-14)
    heavy = swing.system.replace(inertia=co.each(np.array([[k * np.diag(MOMENTS)] for k in (1, 4)])))
    turned = swing.joint_data(Members(jax.tree.map(lambda leaf: np.stack([leaf, leaf], axis=1), start), heavy))
    assert dict(turned.hinge.sizes) == {"member": 2, "time": 2}
    assert turned.hinge.values[:, 0] == pytest.approx([0.3, 0.6], abs=1e-14)
    assert turned.hinge_speed.values[:, 0] == pytest.approx([2, 3 / 4], abs=1e-14)
    with pytest.raises(co.errors.ArgumentError, match="must be a run of this mechanism"):
        gears(1, 2).joint_data(start)


def test_data_sets_and_traced_speeds_raise():
    swing = pendulum()
    with pytest.raises(co.errors.ArgumentError, match="`run` must be a run or a state of this mechanism"):
        swing.joint_data(swing.joint_data(swing.state()))
    with pytest.raises(co.errors.ArgumentError, match=r"System\.project"):
        jax.grad(lambda speed: swing.state(speeds={"hinge": speed}).xi[0, 1])(1.0)
