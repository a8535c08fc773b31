"""Thruster vehicles keep a station in a current, and fly by depth, heading and speed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rovs import TAM, rov

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.controllers import Cruise, Hover, Manoeuvre
from coadjoint_vehicles.controllers.thrusting import accelerations
from coadjoint_vehicles.parts import Damping, Thrusters
from coadjoint_vehicles.trim.under_way import Level
from coadjoint_vehicles.water import UniformWater

CURRENT = (0.2, -0.1, 0.0)
STATION = {"north": 2.0, "east": -1.0, "depth": 3.0, "heading": np.radians(178.0)}


def fly(vehicle, controller, duration, inputs, current=CURRENT):
    craft = Craft(vehicle, controller=controller, water=UniformWater(current))
    run = co.simulate(craft.system, craft.start(speed=0.0), dt=0.05, duration=duration, inputs=inputs)
    assert run.plan.backend == "native"
    return run


@pytest.mark.long
def test_a_station_is_kept_in_a_current_level_and_on_its_heading():
    run = fly(rov(), Hover(), 100.0, STATION)
    made = run.dataset
    np.testing.assert_allclose(made.q.values[-1], [2.0, -1.0, 3.0], atol=0.01)
    np.testing.assert_allclose(made.euler_angles.values[-1], [np.radians(178.0), 0, 0], atol=1e-3)
    assert np.abs(made.euler_angles.values[:, 1:]).max() < np.radians(3.0)
    assert np.linalg.norm(made.qdot.values[-1]) < 1e-3
    assert np.abs(made.q.values - [2.0, -1.0, 3.0])[int(60 / 0.05) :].max() < 0.05


@pytest.mark.long
def test_net_weight_that_is_fed_forward_is_no_error_of_depth_at_first():
    """The vehicle is 2.4 N light: without integral it floats above its set point by (W − B)/(M₃₃ k_p)."""
    vehicle, stay = rov(), {"north": 0.0, "east": 0.0, "depth": 0.0, "heading": 0.0}
    gains: dict[str, Any] = {"position_gains": (1.0, 0.0, 1.8), "attitude_gains": (2.0, 0.0, 3.0)}
    depths = []
    for weigh in (0.0, 1.0):
        run = fly(vehicle, Hover(weigh=weigh, **gains), 60.0, stay, current=(0, 0, 0))
        depths.append(float(run.dataset.q.values[-1, 2]))
    net = vehicle.mass * vehicle.gravity - vehicle.buoyancy
    assert depths[0] == pytest.approx(float(net / Level(vehicle).mass[2, 2]), rel=1e-3)
    assert abs(depths[1]) < 1e-4


@pytest.mark.long
def test_steps_of_depth_heading_and_speed_settle_with_little_overshoot():
    inputs = {
        "depth": co.Held([0.0, 10.0], [0.0, 5.0]),
        "heading": co.Held([0.0, 40.0], [0.0, 2.0]),
        "speed": co.Held([0.0, 70.0], [0.4, 0.6]),
    }
    made = fly(rov(), Manoeuvre(), 100.0, inputs).dataset
    depth, heading = made.q.values[:, 2], made.euler_angles.values[:, 0]
    speed = np.einsum("kji,kj->ki", made.R.values, made.qdot.values - CURRENT)[:, 0]
    assert depth[-1] == pytest.approx(5.0, abs=0.02) and depth.max() < 5.3
    assert heading[-1] == pytest.approx(2.0, abs=0.01) and heading.max() < 2.1
    assert speed[-1] == pytest.approx(0.6, abs=5e-3)
    assert np.abs(made.euler_angles.values[:, 1:]).max() < np.radians(8.0)
    assert np.abs(made.internal_thrusters.values).max() <= 1.0


def rounded(z, limit=50.0):
    """A BlueROV2 whose directions are rounded to a part z along the vertical."""
    S, ahead, beside = 0.5**0.5, (0.14, 0.14, -0.15, -0.15, 0, 0), (0.092, -0.092, 0.092, -0.092, 0.109, -0.109)
    ways = np.array([(-S, S, z), (-S, -S, z), (S, S, z), (S, -S, z), (0, 0, 1), (0, 0, 1)])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    places = np.transpose([ahead, beside, (0, 0, 0, 0, -0.077, -0.077)])
    part = Thrusters("thrusters", {"linear": 1.0}, positions=places, directions=ways, limit=limit, unit="N", lag=0.1)
    drag = Damping("damping", quadratic=(33.7, 54.2, 73.2, 4, 4, 4))
    body = {"mass": 10.0, "inertia": (0.1, 0.18, 0.27), "added_mass": (5, 7, 14, 0.1, 0.1, 0.1)}
    return Vehicle(name="rov", **body, center_of_buoyancy=(0, 0, -0.05), parts=(part, drag))


@pytest.mark.long
@pytest.mark.parametrize("z", [0.0, 1e-12, 4.1e-8, 1e-6, 1e-3, 1e-2])
def test_a_mission_ends_at_its_depth_and_heading_however_directions_are_rounded(z):
    craft = Craft(rounded(z), controller=Manoeuvre())
    inputs = {"depth": co.Held([0.0, 5.0], [2.0, 5.0]), "heading": co.Held([0.0, 5.0], [0.0, np.pi / 2]), "speed": 0.3}
    run = co.simulate(craft.system, craft.start(position=(0, 0, 2.0)), dt=0.05, duration=60, inputs=inputs)
    assert run.final.q[2] == pytest.approx(5.0, abs=0.005)
    assert np.degrees(run.dataset.euler_angles.values[-1, 0]) == pytest.approx(90.0, abs=0.05)
    assert [w for w in run.warnings if "limits" in w] == []


def test_next_to_no_authority_is_a_doubt_that_names_the_axis_and_none_at_all_is_a_message(caplog):
    controller = Manoeuvre()
    assert "authority in pitch" in " ".join(controller.doubts(rounded(1e-6)))
    with caplog.at_level("INFO", logger="coadjoint"):
        assert controller.doubts(rounded(0.0)) == []
    assert "do not control pitch" in caplog.text


@pytest.mark.long
def test_a_run_whose_thrusters_are_at_their_limits_warns_with_the_share_of_time_and_what_is_lost():
    from coadjoint_vehicles.missions.summary import mission_summary

    craft = Craft(
        rounded(0.0, limit=2.0), controller=Hover(position_gains=(2.0, 0.1, 2.0)), water=UniformWater((-0.9, 0, 0))
    )
    inputs = {"north": 0.0, "east": 0.0, "depth": 2.0, "heading": 0.0}
    run = co.simulate(craft.system, craft.start(position=(0, 0, 2.0), speed=0.9), dt=0.05, duration=20, inputs=inputs)
    found: Any = mission_summary(run.dataset)
    assert found["saturated"]["thrusters"] > 0.5 and found["lost"]["surge"]["mean"] > 1.0
    assert any(f"{found['saturated']['thrusters']:.0%} of the time" in w and "N of surge" in w for w in run.warnings)


def test_thrusters_at_their_limits_give_the_torque_for_the_acceleration_that_they_reach():
    """Of a centre of mass 20 mm below O: m z_g a tips the vehicle where a is not reached."""
    M = np.diag([18.0, 19.0, 27.0, 0.5, 0.5, 0.5])
    M[0, 4] = M[4, 0] = 12.0 * 0.02
    M[1, 3] = M[3, 1] = -12.0 * 0.02
    part: Any = rov().part("thrusters")
    allocator = Manoeuvre(mass=M).allocator(part)
    wrench = M @ [20.0, 0, 0.1, 0, 0, 0.2]
    thrusts = evaluate(allocator.thrusts, wrench)
    X, Y, Z, K, pitch, N = part.nominal_matrix @ thrusts
    assert 50.0 < X < 0.5 * wrench[0] and abs(Y) < 1e-2
    assert pitch == pytest.approx(M[4, 0] / M[0, 0] * X, rel=1e-3) and pitch < 0.5 * wrench[4]
    np.testing.assert_allclose([Z, K, N], [2.7, 0.0, 0.1], atol=0.02)
    assert np.abs(evaluate(allocator.lost, wrench, thrusts)[3:]).max() < 0.02
    within = 0.05 * wrench
    np.testing.assert_allclose(part.nominal_matrix @ evaluate(allocator.thrusts, within), within, atol=1e-9)


@pytest.mark.long
def test_a_speed_out_of_reach_leaves_a_vehicle_with_a_low_centre_of_mass_level_and_at_its_depth():
    vehicle = rov(center_of_mass=(0, 0, 0.02), center_of_buoyancy=(0, 0, -0.02))
    made = fly(vehicle, Manoeuvre(surge_limit=20.0), 40.0, {"depth": 0.0, "heading": 0.0, "speed": 3.0}, (0, 0, 0))
    assert np.abs(made.dataset.q.values[:, 2]).max() < 0.3
    assert np.abs(made.dataset.euler_angles.values[:, 1]).max() < np.radians(10.0)
    assert made.dataset.nu.values[-1, 0] > 0.8


@pytest.mark.long
def test_a_thruster_vehicle_would_be_turned_across_the_flow_by_the_munk_moment_that_is_fed_forward():
    inputs = {"depth": co.Held([0.0, 5.0], [0.0, 5.0]), "heading": 0.0, "speed": 0.5}
    pitch = []
    for known in (1.0, 0.0):
        controller = Manoeuvre().fitted(rov())
        blind = Craft(rov(), controller=controller)
        mass = controller.mass.copy()
        mass[[0, 1, 2], [0, 1, 2]] = known * mass[[0, 1, 2], [0, 1, 2]] + (1 - known) * mass[0, 0]
        system = blind.system.replace(controller={"mass": mass})
        made = co.simulate(system, blind.start(speed=0.5), dt=0.05, duration=20.0, inputs=inputs).dataset
        pitch.append(np.abs(made.euler_angles.values[:, 1]).max())
    assert pitch[0] < np.radians(8.0) and pitch[1] > 3 * pitch[0]


def test_the_largest_accelerations_are_those_at_which_a_thruster_is_at_its_limit():
    vehicle = rov()
    part = vehicle.part("thrusters")
    assert isinstance(part, Thrusters)
    most, M = accelerations(part, Level(vehicle).mass), Level(vehicle).mass
    # Four thrusters at 45°, two of them astern: the astern limit of 32 N comes first.
    assert most[0] * M[0, 0] == pytest.approx(4 * 0.707 * 32.0, rel=1e-9)
    assert most[2] * M[2, 2] == pytest.approx(4 * 32.0, rel=1e-9)


def test_a_part_that_does_not_fit_is_named_once():
    with pytest.raises(ArgumentError, match=r"but found thrusters\.$"):
        Cruise(speed=0.3).fitted(rov())


def test_a_vehicle_without_thrusters_has_no_hover():
    with pytest.raises(ArgumentError, match="needs one part of the kind `thrusters`"):
        Hover().fitted(rov(parts=()))


@pytest.mark.parametrize(
    ("controller", "thrusters", "lacking"), [(Manoeuvre(), slice(4), "heave"), (Hover(), slice(4, 8), "surge, sway")]
)
def test_thrusters_that_cannot_push_as_a_controller_needs_are_told(controller, thrusters, lacking):
    vehicle = rov()
    part = vehicle.part("thrusters")
    fewer = replace(part, allocation=part.allocation[:, thrusters], effectiveness=1.0)
    with pytest.raises(ArgumentError, match=f"give nothing in {lacking}"):
        controller.fitted(rov(parts=tuple(fewer if one is part else one for one in vehicle.parts)))


def test_thrusters_that_push_one_way_are_told_so_by_controllers_and_imports():
    from coadjoint_vehicles.importing.flying import doubts, fitting

    part: Any = rov().part("thrusters")
    downwards = TAM.copy()
    downwards[2] = np.abs(TAM[2])
    one_way = rov(parts=(replace(part, allocation=downwards, effectiveness=1.0, limit=(0.0, 1.0)),))
    said = "push only one way in heave and push only together with other axes in yaw"
    with pytest.raises(ArgumentError, match=f"those of `ROV` {said}"):
        Manoeuvre().fitted(one_way)
    assert fitting(one_way) == [] and doubts(one_way) == [f"No controller fits: its thrusters {said}."]
    assert fitting(rov(parts=(part,), center_of_mass=(0.1, 0, 0.02))) == ["manoeuvre", "hover", "pose"]


@pytest.mark.parametrize("thruster", [0, 4])
def test_seven_thrusters_and_one_that_pushes_one_way_still_push_along_every_axis(thruster):
    part = rov().part("thrusters")
    low = -np.ones(8)
    low[thruster] = 0.0
    found = accelerations(replace(part, limit=[low, np.ones(8)]), Level(rov()).mass)
    both = accelerations(part, Level(rov()).mass)
    assert np.all(found[both > 0] > 0) and np.all(found <= both + 1e-9)


def test_a_vehicle_that_neither_thrusters_nor_weight_keep_level_is_a_doubt():
    flat = rounded(0.0)
    assert not any("turn over" in said for said in Manoeuvre().doubts(flat))
    upside = replace(flat, center_of_buoyancy=np.array([0.0, 0.0, 0.02]))
    assert any("do not control pitch, and no righting moment" in said for said in Manoeuvre().doubts(upside))


def test_a_dead_band_that_takes_much_of_the_thrust_is_a_doubt():
    part = replace(rov().part("thrusters"), dead_band=0.5)
    (said,) = Manoeuvre().doubts(rov(parts=(part,)))
    assert "takes every thrust below 5 N" in said and "of at most 40 N" in said
    assert Manoeuvre().doubts(rov()) == []
