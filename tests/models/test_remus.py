"""REMUS 100: forces against closed forms, signs as documented, and a mission by the shipped controllers."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import coadjoint as co
from coadjoint.kernels.evaluate import evaluate
from coadjoint.models.underwater import REMUS_100, hydrodynamics, remus_100, remus_start
from coadjoint.models.underwater.autopilot import attitude_angles
from coadjoint.models.underwater.pilots.pid import pid

OPEN = remus_100(automatic=False)
P: Any = OPEN.parameters
DT = 0.05


def cruise(revolutions: float, duration: float, **initial: Any):
    """Under way from 1.5 m/s without the propeller's torque, which would heel the vehicle."""
    start = remus_start(OPEN, **{"speed": 1.5, "revolutions": revolutions, **initial})
    return co.simulate(OPEN.replace(torque_fraction=0.0), start, dt=DT, duration=duration, save_every=10)


@pytest.mark.parametrize("n", [8.0, 15.0, 1525 / 60])
def test_the_terminal_speed_is_where_thrust_equals_drag(n):
    area, D = np.pi / 4 * 0.19**2, 0.14
    slope = (0.1798 - 0.4566) / 0.6632

    def balance(u):
        thrust = 0.9 * 1026 * D**4 * (0.4566 * n**2 + slope * n * 0.944 * u / D)
        return thrust - 0.5 * 1026 * 0.42 * area * u**2 - REMUS_100["damping"][0] * np.exp(-3 * u) * u

    speed = float(brentq(balance, 0.01, 10))  # pyright: ignore[reportArgumentType]
    run = cruise(n, duration=400.0)
    np.testing.assert_allclose(run.final.nu, [speed, 0, 0], atol=1e-8)
    if n > 20:
        assert speed == pytest.approx(2.5, rel=0.05)  # The vehicle's top speed, 2.5 m/s at 1525 rpm.


def test_the_bollard_thrust_is_that_of_the_propeller_at_rest_ahead_and_astern():
    for n in (20.0, -20.0):
        found = evaluate(lambda v, n=n: hydrodynamics.propeller(v, n, P), np.zeros(3))
        assert found.force[0] == pytest.approx(0.9 * 1026 * 0.14**4 * 0.4566 * n * abs(n), rel=1e-14)
        assert found.torque[0] == pytest.approx(0.1 * 1026 * 0.14**5 * 0.07 * n * abs(n), rel=1e-14)


def test_positive_stern_planes_pitch_the_nose_down_and_positive_rudder_turns_it_to_starboard():
    for sign in (1.0, -1.0):
        diving = cruise(15.0, duration=3.0, stern_planes=sign * 0.05).dataset
        assert sign * diving.euler_angles[-1, 1] < -0.02 and sign * diving.q[-1, 2] > 0.01
        turning = cruise(15.0, duration=3.0, rudder=sign * 0.05).dataset
        assert sign * turning.euler_angles[-1, 0] > 0.02 and abs(turning.q[-1, 2]) < 0.05 * abs(turning.q[-1, 1])


def test_roll_at_rest_has_the_period_of_its_righting_moment():
    """W z_g φ = −M₄₄ φ̈ with M₄₄ less (m z_g)²/M₂₂, because the origin sways as the vehicle rolls."""
    vehicle = OPEN.replace(damping=np.zeros(6), crossflow_drag=0.0, fin_area=0.0)
    m, z = REMUS_100["mass"], 0.02
    inertia = 0.1120 + m * z**2 + 0.0336 - (m * z) ** 2 / (m + 29.4376)
    rate = np.sqrt(m * 9.81 * z / inertia)
    run = co.simulate(
        vehicle, remus_start(vehicle, euler_zyx=(0, 0, 1e-4)), dt=2 * np.pi / rate / 400, steps=4000, save_every=400
    )
    np.testing.assert_allclose(run.dataset.euler_angles[:, 2], 1e-4, rtol=2e-4)


def test_slow_surge_decays_with_its_time_constant():
    vehicle = OPEN.replace(axial_drag=0.0, fading=np.zeros(6), center_of_mass=np.zeros(3))
    run = co.simulate(vehicle, remus_start(vehicle, speed=0.1), dt=DT, duration=40.0)
    np.testing.assert_allclose(run.dataset.qdot[:, 0], 0.1 * np.exp(-(run.dataset.time + DT / 2) / 20.0), rtol=1e-5)


def test_crossflow_drag_of_pure_sway_and_of_pure_turning_is_the_integral_over_the_hull():
    C, d, L = 1.1, 0.19, 1.6
    zero = np.zeros(3)
    sway = evaluate(hydrodynamics.crossflow_drag, np.array([0, -0.3, 0.4]), zero, 1026.0, C, d, L)
    np.testing.assert_allclose(sway.force, 0.5 * 1026 * C * d * L * 0.5 * np.array([0, 0.3, -0.4]), rtol=1e-14)
    np.testing.assert_allclose(sway.torque, 0, atol=1e-12)
    turning = evaluate(hydrodynamics.crossflow_drag, zero, np.array([0, 0.6, 0.8]), 1026.0, C, d, L)
    np.testing.assert_allclose(turning.torque, -1026 * C * d * L**4 / 64 * np.array([0, 0.6, 0.8]), rtol=1e-14)


def test_a_fin_lifts_by_its_slope_stalls_and_is_a_plate_across_the_flow():
    def at(angle):
        return evaluate(hydrodynamics.lift_and_drag, np.cos(angle), np.sin(angle), 3.12, np.radians(20))

    lift, drag = at(1e-3)
    assert lift == pytest.approx(3.12e-3, rel=2e-3) and drag == pytest.approx(0.0, abs=1e-5)
    assert at(np.radians(16))[0] > at(np.radians(30))[0]
    np.testing.assert_allclose(at(np.pi / 2), [0, 2], atol=1e-9)
    np.testing.assert_allclose(at(-0.2), np.array(at(0.2)) * [-1, 1], rtol=1e-12)


def test_damping_hull_and_fins_only_ever_take_energy():
    random = np.random.default_rng(5)
    forces = dict(OPEN.forces or ())
    v, omega, angles = random.normal(size=(200, 3)) * 2, random.normal(size=(200, 3)), random.uniform(-0.3, 0.3, 200)

    def powers(p, v, omega, angle):
        internal = co.Parameters(stern_planes=angle, rudder=-angle)
        motion = co.Motion(omega, v, v, co.Parameters(current=np.zeros(3)), 0.0, None, internal)
        found = [forces[name](motion, p) for name in ("damping", "hull", "stern_planes", "rudder")]
        return jnp.stack([force.force @ v + force.torque @ omega for force in found])

    assert np.all(evaluate(jax.vmap(powers, in_axes=(None, 0, 0, 0)), P, v, omega, angles) < 0)


def test_fins_keep_the_course_that_the_munk_moment_would_turn_away():
    """Nothing is deleted from the equations: without fins a torpedo is unstable, with them it is not."""
    drift = []
    for area in (0.0, float(P.fin_area)):
        vehicle = OPEN.replace(fin_area=area, torque_fraction=0.0)
        start = remus_start(vehicle, speed=1.5, revolutions=15.0)
        start = start.replace(nu=start.nu + np.array([0, 1e-4, 0]))
        run = co.simulate(vehicle, start, dt=DT, duration=10.0)
        drift.append(abs(float(run.dataset.nu[-1, 1])))
    assert drift[0] > 1e-3 and drift[1] < 3e-5


def test_a_vehicle_in_a_current_sees_still_water():
    current = np.array([0.4, -0.3, 0.1])
    initial = {"rudder": 0.1, "stern_planes": 0.02}
    still, carried = (cruise(15.0, duration=30.0, current=c, **initial).dataset for c in (np.zeros(3), current))
    np.testing.assert_allclose(carried.q, still.q + np.outer(still.time, current), atol=1e-10)
    np.testing.assert_allclose(carried.R, still.R, atol=1e-11)


def test_angles_are_those_of_the_attitude():
    angles = np.array([2.0, -0.4, 0.3])
    R = co.attitude.zyx(*angles)
    roll, pitch, heading = evaluate(attitude_angles, R.T @ [0.0, 0, 1], R.T @ [1.0, 0, 0])
    np.testing.assert_allclose([heading, pitch, roll], angles, rtol=1e-14)


def test_the_integral_of_a_saturated_controller_does_not_wind_up():
    u, I = evaluate(lambda e: pid((2.0, 1.0, 0.0), e, 0.0, jnp.asarray(0.5), 0.1, 1.0), np.float64(3.0))
    assert (u, I) == (1.0, 0.5)
    u, I = evaluate(lambda e: pid((2.0, 1.0, 0.0), e, 0.0, jnp.asarray(0.5), 0.1, 1.0), np.float64(-0.1))
    np.testing.assert_allclose([u, I], [0.29, 0.49], rtol=1e-12)


TIMES = [0.0, 60.0, 120.0]
MISSION = {
    "depth": co.Held(TIMES, [10.0, 10.0, 1.0]),
    "heading": co.Held(TIMES, np.radians([0.0, 90.0, 90.0])),
    "speed": co.Held(TIMES, [1.5, 1.5, 1.5]),
}


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_a_mission_dives_turns_and_surfaces_within_the_limits_of_its_actuators(delay):
    vehicle = remus_100().replace(delay=delay)
    start = remus_start(vehicle, speed=1.5, revolutions=15.0, current=(0.1, 0.2, 0.0))
    run = co.simulate(vehicle, start, dt=DT, duration=200.0, inputs=MISSION)
    made = run.dataset
    depth, heading = made.q[:, 2].values, np.degrees(made.euler_angles[:, 0].values)
    speed = made.nu[:, 0].values - made.a_current[:, 0].values
    for time, wanted, course in ((59.0, 10.0, 0.0), (119.0, 10.0, 90.0), (199.0, 1.0, 90.0)):
        k = int(time / DT)
        assert depth[k] == pytest.approx(wanted, abs=0.25)
        assert heading[k] == pytest.approx(course, abs=1.0)
        assert speed[k] == pytest.approx(1.5, abs=0.01)
    assert max(abs(made.internal_stern_planes).max(), abs(made.internal_rudder).max()) <= np.radians(15)
    assert float(abs(made.euler_angles[:, 1]).max()) < np.radians(40)
    assert run.summary()["energy_budget_error_max"] < 1e-5
    for name in ("damping", "hull", "stern_planes", "rudder"):
        assert made[f"work_{name}"].values[-1] < 0 < made.work_propeller.values[-1]
