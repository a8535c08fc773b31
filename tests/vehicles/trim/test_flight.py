"""Steady flight of REMUS 100: trim, turning circles and modes, against closed forms and against simulations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint.stability import stability
from coadjoint.stability.figure import stability_figure
from coadjoint_vehicles.trim import SteadyFlight, trim
from coadjoint_vehicles.trim.flight import _of_buoyancy

REMUS = vehicles.load("remus_100")
FINS = ("stern_planes", "rudder")
BARE = replace(REMUS, parts=tuple(part for part in REMUS.parts if part.name not in FINS))
FLIGHT, BARE_FLIGHT = SteadyFlight(REMUS), SteadyFlight(BARE)


@pytest.fixture(scope="module")
def straight():
    return FLIGHT.at(1.5)


@pytest.mark.long
def test_straight_flight_has_the_revolutions_where_thrust_is_drag(straight):
    area, D, n = np.pi / 4 * 0.19**2, 0.14, float(straight.free["propeller"])
    slope = (0.1798 - 0.4566) / 0.6632
    thrust = 0.9 * 1026 * D**4 * (0.4566 * n**2 + slope * n * 0.944 * 1.5 / D)
    linear = REMUS.part("damping").linear.ravel()[0]
    assert thrust == pytest.approx(0.5 * 1026 * 0.42 * area * 1.5**2 + linear * np.exp(-3 * 1.5) * 1.5, rel=1e-10)
    found = trim(REMUS, straight)
    assert found.speed == pytest.approx(1.5, rel=1e-12)
    assert abs(found.climb) < 1e-12 and abs(found.pitch) < 1e-9 and np.isinf(found.radius) and not found.beyond
    torque = 0.1 * 1026 * D**5 * (0.07 * n**2 + (0.0312 - 0.07) / 0.6632 * n * 0.944 * 1.5 / D)
    assert np.sin(found.roll) == pytest.approx(torque / (REMUS.mass * 9.81 * 0.02), rel=1e-9)


@pytest.mark.long
def test_the_composed_remus_is_stable_by_its_large_fins_and_unstable_without_them(straight):
    assert stability(straight).verdict == "stable"
    bare = stability(BARE_FLIGHT.at(1.5))
    assert bare.verdict == "unstable"
    assert set(bare.modes[0].name.split("-")) == {"yaw", "sway"}
    # Munk's 2.1330 1/s, and a little less by the damping at speed.
    assert 2.10 < bare.growth_rate < 2.1330


@pytest.mark.long
def test_a_simulation_stays_on_the_steady_motion_that_was_found(straight):
    run = co.simulate(FLIGHT.craft.system, straight.state, dt=0.05, duration=20.0).dataset
    np.testing.assert_allclose(run.nu.values, straight.state.nu[None] * np.ones((len(run.time), 1)), atol=1e-9)


@pytest.mark.long
def test_without_fins_a_simulation_leaves_at_the_rate_of_the_spectrum():
    motion = BARE_FLIGHT.at(1.5)
    mode = stability(motion).modes[0]
    z = 1e-8 * np.real(mode.velocities) / np.max(np.abs(mode.velocities))
    start = motion.state.replace(xi=motion.state.xi + z[:3], nu=motion.state.nu + z[3:])
    run = co.simulate(BARE_FLIGHT.craft.system, start, dt=0.005, duration=4.0).dataset
    yaw = np.abs(run.xi.values[:, 2])
    assert np.log(yaw[700] / yaw[300]) / 2.0 == pytest.approx(mode.rate, rel=2e-3)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("climb", [0.0, -20.0])
def test_a_turning_circle_or_helix_is_the_one_that_a_simulation_goes_round(climb):
    flight = SteadyFlight(REMUS, hold={"rudder": np.radians(10)}, turning=True, climb=np.radians(climb))
    motion = flight.at(1.5)
    found = trim(REMUS, motion)
    assert found.speed == pytest.approx(1.5, rel=1e-10) and found.turn_rate > 0
    assert found.climb == pytest.approx(np.radians(climb), abs=1e-9)
    assert stability(motion).verdict == "stable"
    np.testing.assert_allclose(motion.state.g.T @ [0, 0, 1], motion.state.a[:3], atol=1e-12)
    period = 2 * np.pi / found.turn_rate
    run = co.simulate(flight.craft.system, motion.state, dt=period / 400, duration=period).dataset
    q = run.q.values
    sunk = -1.5 * np.sin(np.radians(climb)) * period
    np.testing.assert_allclose(q[-1], q[0] + [0, 0, sunk], atol=2e-3)
    across = np.max(np.linalg.norm((q - q[0])[:, :2], axis=1))
    assert across == pytest.approx(2 * found.radius, rel=1e-3)


@pytest.mark.long
def test_at_rest_velocities_decay_and_pitch_and_roll_swing_as_their_linear_equations_say():
    """(M_i s + D_i)(M_jj s² + D_j s + W z_g) = (m z_g)² s³ for surge with pitch and sway with roll; s = −D/M else."""
    motion = FLIGHT.at(0.0)
    found = sorted((mode.eigenvalue for mode in stability(motion).modes), key=lambda s: (s.real, s.imag))
    m, z, D = REMUS.mass, 0.02, REMUS.part("damping").linear.ravel()
    D = D if D.size == 6 else np.diag(D.reshape(6, 6))
    A, inertia = np.diag(REMUS.added_mass), np.diag(REMUS.inertia)
    M = np.concatenate([m + A[:3], inertia + A[3:] + m * z**2 * np.array([1, 1, 0])])
    expected = [-D[2] / M[2], -D[5] / M[5]]
    for i, j in ((0, 4), (1, 3)):
        left = np.polymul([M[i], D[i]], [M[j], D[j], m * 9.81 * z])
        expected += list(np.roots(np.polysub(left, [(m * z) ** 2, 0, 0, 0])))
    expected = sorted((s for s in map(complex, expected) if s.imag >= 0), key=lambda s: (s.real, s.imag))
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    surge = min(stability(motion).modes, key=lambda mode: abs(mode.eigenvalue))
    assert -surge.rate == pytest.approx(1 / 20.0, rel=1e-3)


@pytest.mark.long
def test_a_dive_on_a_slope_goes_down_it(straight):
    flight = SteadyFlight(REMUS, climb=np.radians(-20))
    found = trim(REMUS, flight.at(1.5))
    assert np.degrees(found.climb) == pytest.approx(-20, abs=1e-9) and found.pitch < 0
    assert found.pitch - found.attack == pytest.approx(found.climb, abs=1e-6)


@pytest.mark.parametrize("climb", [-0.3, 0.4, np.pi / 2, -np.pi / 2])
def test_the_conditions_of_a_slope_are_those_of_a_course_that_points_along_it(climb):
    flight = SteadyFlight(replace(REMUS, parts=()), climb=climb)
    along, across = (flight.craft.start(speed=1.5, euler_zyx=(0.7, pitch, 0.0)) for pitch in (climb, -climb))
    np.testing.assert_allclose(flight._conditions(along, 1.5), 0, atol=1e-12)
    assert np.max(np.abs(flight._conditions(across, 1.5))) > 0.1
    assert len(flight._names) == len(flight._conditions(along, 1.5))


def test_the_remedy_names_the_actuators_that_move_and_those_that_stay():
    kept = SteadyFlight(REMUS, free=("rudder",))._remedy
    assert kept.startswith("To hold it moved rudder, and not ") and "free one of these" in kept
    assert "stern_planes" in kept and "propeller" in kept
    assert "all that it has: give it more" in SteadyFlight(REMUS)._remedy


def test_a_vehicle_is_heavier_than_the_water_where_it_sinks():
    assert "is 11 N heavier than the water that it displaces (negatively buoyant)" in _of_buoyancy(11.0)
    assert "is 11 N lighter than the water that it displaces (positively buoyant)" in _of_buoyancy(-11.0)


def test_a_neutral_ellipsoid_of_parts_rises_nose_first():
    bare = replace(REMUS, parts=())
    found = trim(bare, SteadyFlight(bare, climb=np.pi / 2).at(0.7))
    assert found.speed == pytest.approx(0.7) and found.climb == pytest.approx(np.pi / 2, abs=1e-6)


@pytest.mark.long
def test_what_cannot_be_flown_is_told_in_a_sentence():
    with pytest.raises(ArgumentError, match="REMUS 100 has no actuator `flaps`"):
        SteadyFlight(REMUS, hold={"flaps": 0.1})
    with pytest.raises(ArgumentError, match="the speed is off by"):
        SteadyFlight(REMUS, hold={"propeller": 15.0}).at(1.5)
    with pytest.raises(ArgumentError, match="the velocity is off by"):
        SteadyFlight(replace(BARE, mass=REMUS.mass + 0.1)).at(0.0)
    with pytest.raises(ArgumentError, match="as many values as motions"):
        stability_figure([1.0], [])


@pytest.mark.long
def test_a_vehicle_with_thrusters_enough_flies_on_an_even_keel_and_its_thrusters_hold_it():
    rov = vehicles.load("rexrov")
    flight = SteadyFlight(rov)
    motion = flight.at(0.5)
    found = trim(rov, motion)
    assert abs(found.roll) < 1e-9 and abs(found.pitch) < 1e-9 and not found.beyond
    run = co.simulate(flight.craft.system, motion.state, dt=0.05, duration=2.0).dataset
    np.testing.assert_allclose(run.nu.values[-1], [0.5, 0, 0], atol=1e-7)


@pytest.mark.long
def test_a_glider_glides_where_its_pump_and_its_battery_make_it():
    glider = vehicles.load("slocum_graver")
    motion = SteadyFlight(glider, climb=np.radians(-30)).at(0.4)
    found = trim(glider, motion)
    assert np.degrees(found.climb) == pytest.approx(-30, abs=1e-8) and found.speed == pytest.approx(0.4)
    assert float(motion.free["pump"]) < 0 < float(motion.free["battery.position"]) and not found.beyond
    assert stability(motion).verdict == "stable"
