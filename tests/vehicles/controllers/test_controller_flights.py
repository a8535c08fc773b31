"""Attitudes that have no Euler angles, and paths of way points in a current."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rovs import rov

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint_vehicles import Craft
from coadjoint_vehicles.controllers import Attitude, Cruise, LineOfSight, Manoeuvre, Pose
from coadjoint_vehicles.water import UniformWater
from remus import remus

DT = 0.05


def turned(R, wanted):
    """The angle between attitudes (n, 3, 3) and another, degrees."""
    return np.degrees(np.arccos(np.clip((np.einsum("nij,ij->n", R, wanted) - 1) / 2, -1, 1)))


@pytest.mark.long
def test_thrusters_hold_a_vehicle_upside_down_and_nose_down_and_turn_it_back_from_179_degrees():
    wanted = [np.eye(3), co.attitude.zyx(0, 0, np.radians(179)), co.attitude.zyx(0, -np.pi / 2, 0), np.eye(3)]
    times = [0.0, 10.0, 40.0, 70.0]
    craft = Craft(rov(), controller=Pose(weigh=1.0), water=UniformWater((0.1, 0.05, 0.0)))
    inputs: dict[str, Any] = {"north": 0.0, "east": 0.0, "depth": 5.0, "attitude": co.Held(times, wanted)}
    run = co.simulate(craft.system, craft.start(position=(0, 0, 5)), dt=DT, duration=100.0, inputs=inputs)
    assert run.plan.backend == "native"
    R = run.dataset.R.values
    for begin, goal in zip(times[1:], wanted[1:], strict=True):
        k = int(begin / DT)
        assert turned(R[k - 1 : k], goal)[0] > 89 and turned(R[k + 570 : k + 599], goal).max() < 1.0
    np.testing.assert_allclose(np.einsum("kji,kjl->kil", R, R), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
    assert np.linalg.norm(run.dataset.q.values - [0, 0, 5], axis=1).max() < 0.2


@pytest.mark.long
def test_fins_take_a_torpedo_into_a_vertical_dive_and_out_of_it_where_euler_angles_have_no_meaning():
    craft = Craft(remus(length=1.6), controller=Attitude(speed=1.5))
    times, wanted = [0.0, 20.0, 60.0], [np.eye(3), co.attitude.zyx(0, -np.pi / 2, 0), co.attitude.zyx(1.0, 0, 0)]
    inputs = {"attitude": co.Held(times, wanted), "speed": 1.5}
    start = craft.start(speed=1.5, actuators={"propeller": 15.0})
    run = co.simulate(craft.system, start, dt=DT, duration=120.0, inputs=inputs)
    assert run.plan.backend == "native"
    nose = run.dataset.R.values[:, :, 0]
    for moment, goal, error in ((19.0, wanted[0], 0.5), (59.0, wanted[1], 6.0), (119.0, wanted[2], 0.5)):
        assert np.degrees(np.arccos(min(nose[int(moment / DT)] @ goal[:, 0], 1.0))) < error
    assert run.dataset.q.values[int(60 / DT), 2] > 50.0
    assert max(abs(run.dataset[f"internal_{name}"].values).max() for name in ("rudder", "stern_planes")) <= np.radians(
        15
    )


SQUARE = [(0, 0, 0), (100, 0, 5), (100, 100, 10), (0, 100, 5)]


def follow(vehicle, speed, *, start=1.0, duration=300.0, **controller):
    craft = Craft(vehicle, controller=LineOfSight(way_points=SQUARE, **controller), water=UniformWater((0.0, 0.3, 0.0)))
    begin = craft.start(position=(0, 10, 0), speed=start)
    run = co.simulate(craft.system, begin, dt=DT, duration=duration, inputs={"speed": speed})
    assert run.plan.backend == "native"
    return run.dataset


@pytest.mark.long
def test_a_torpedo_comes_on_to_its_legs_in_a_cross_current_by_the_integral_and_not_without():
    """Without it the path is missed by Δ tan(asin(0.3/1.6)), the drift angle; depths are those of the way points."""
    held = follow(remus(length=1.6), 1.5)
    q, leg = held.q.values, held.internal_controller_value_memory_leg.values
    first, second = np.flatnonzero(leg == 0), np.flatnonzero(leg == 1)
    assert abs(q[first[-1], 1]) < 0.1 and abs(q[second[-1], 0] - 100.0) < 0.4 and leg[-1] == 2
    assert q[second[-1], 2] == pytest.approx(10.0, abs=0.1) and q[first[-1], 2] == pytest.approx(5.0, abs=0.1)
    missed = follow(remus(length=1.6), 1.5, gain=0.0, duration=60.0)
    through = missed.nu.values[-1] - missed.R.values[-1].T @ [0, 0.3, 0]
    drift = np.arcsin(0.3 / np.linalg.norm(through))
    assert missed.q.values[-1, 1] == pytest.approx(4 * 1.6 * np.tan(drift), rel=0.03)


@pytest.mark.long
def test_a_slope_is_followed_in_space_by_pitch():
    made = follow(remus(length=1.6), 1.5, helm=Cruise(vertical="pitch"), duration=60.0)
    q = made.q.values[-1]
    assert q[2] == pytest.approx(5.0 * q[0] / 100.0, abs=0.1) and abs(q[1]) < 0.1
    assert made.euler_angles.values[-1, 1] == pytest.approx(-np.arctan(0.05), abs=0.02)


@pytest.mark.long
def test_thrusters_follow_a_path_with_the_same_guidance():
    made = follow(rov(length=0.5), 0.6, start=0.0, look_ahead=6.0, acceptance=3.0)
    leg, q = made.internal_controller_value_memory_leg.values, made.q.values
    assert leg[-1] == 1 and abs(q[np.flatnonzero(leg == 0)[-1], 1]) < 0.2


@pytest.mark.parametrize(
    ("controller", "sentence"),
    [
        ({"way_points": [(0, 0, 0)]}, "must hold two points or more"),
        ({"way_points": [(0, 0, 0), (0, 0, 5)]}, "one place over ground"),
        ({"way_points": SQUARE, "look_ahead": -1.0}, "look_ahead"),
        ({"way_points": SQUARE, "gain": -0.2}, "gain"),
    ],
)
def test_paths_that_are_none_are_refused(controller, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        LineOfSight(**controller)


def test_the_gains_at_the_helm_are_proposed_for_the_period_of_the_path():
    helm: Any = LineOfSight(way_points=SQUARE, helm=Manoeuvre(), period=0.8, delay=0.4).fitted(rov(length=0.5)).helm
    alone, usual = (Manoeuvre(**more).fitted(rov(length=0.5)) for more in ({"period": 0.8, "delay": 0.4}, {}))
    np.testing.assert_array_equal(helm.attitude_gains, alone.attitude_gains)
    assert helm.attitude_gains[2] < usual.attitude_gains[2]


def test_a_helm_that_takes_no_heading_is_refused():
    with pytest.raises(ArgumentError, match="must take the set points `heading`"):
        Craft(remus(), controller=LineOfSight(way_points=SQUARE, helm=Attitude()))
