"""REMUS 100: terminal speeds, signs, stability by its fins, and a mission by its cruise controller."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import coadjoint as co
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint_vehicles.remus import remus_100, remus_start

OPEN = remus_100(automatic=False)
P: Any = OPEN.parameters
DT = 0.05


def cruise(revolutions: float, duration: float, vehicle: co.System = OPEN, **initial: Any):
    """Under way from 1.5 m/s without the propeller's torque, which would heel the vehicle."""
    vehicle = vehicle.replace(propeller={"torque_fraction": 0.0})
    start = remus_start(vehicle, **{"speed": 1.5, "revolutions": revolutions, **initial})
    return co.simulate(vehicle, start, dt=DT, duration=duration, save_every=10)


def without_fins(**changes: Any) -> co.System:
    return OPEN.replace(stern_planes={"area": 0.0}, rudder={"area": 0.0}, **changes)


def test_fins_of_a_start_pitch_the_nose_down_and_turn_it_to_starboard_and_the_propeller_pushes_ahead():
    still = remus_start(OPEN, speed=1.5)
    assert np.array_equal(still.g, np.eye(3)) and not np.any(still.q) and np.array_equal(still.nu, [1.5, 0, 0])
    internal = {"stern_planes": 0.05, "rudder": 0.1, "propeller": 20.0}
    state = remus_start(OPEN, speed=1.5, stern_planes=0.05, rudder=0.1, revolutions=20.0)
    assert {name: float(np.ravel(getattr(state.internal, name))[0]) for name in internal} == internal

    def push(s):
        return OPEN.body_force(OPEN.motion(s.xi, s.n, s.nu, s.a, s.t, s.inputs, s.internal))

    pushes = tabulate(push, still)
    torque, force = (one - other for one, other in zip(pushes(state), pushes(still), strict=True))
    assert torque[1] < -0.1 and torque[2] > 0.1 and force[0] > 3.0
    assert torque[2] == pytest.approx(-2 * torque[1], rel=0.01), "rudder and stern planes are alike"


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("n", [8.0, 15.0, 1525 / 60])
def test_the_terminal_speed_is_where_thrust_equals_drag(n):
    area, D = np.pi / 4 * 0.19**2, 0.14
    slope = (0.1798 - 0.4566) / 0.6632

    def balance(u):
        thrust = 0.9 * 1026 * D**4 * (0.4566 * n**2 + slope * n * 0.944 * u / D)
        return thrust - 0.5 * 1026 * 0.42 * area * u**2 - P.damping.linear[0] * np.exp(-3 * u) * u

    speed = float(brentq(balance, 0.01, 10))  # pyright: ignore[reportArgumentType]
    run = cruise(n, duration=400.0)
    np.testing.assert_allclose(run.final.nu, [speed, 0, 0], atol=1e-8)
    if n > 20:
        assert speed == pytest.approx(2.5, rel=0.05)  # The vehicle's top speed, 2.5 m/s at 1525 rpm.


@pytest.mark.long
def test_the_bollard_thrust_is_that_of_the_propeller_at_rest_ahead_and_astern():
    """The work of the first short step from rest is ½(F h)²/M of the thrust F = (1 − t) ρ D⁴ K_T0 n|n|."""
    mass = P.mass + P.added_mass[0, 0]
    for n in (20.0, -20.0):
        thrust = 0.9 * 1026 * 0.14**4 * 0.4566 * n * abs(n)
        vehicle = OPEN.replace(propeller={"torque_fraction": 0.0}, center_of_mass=np.zeros(3))
        h = 1e-6
        run = co.simulate(vehicle, remus_start(vehicle, revolutions=n), dt=h, steps=1)
        assert run.final.pi[0] == pytest.approx(thrust * h, rel=1e-6)
        assert run.final.nu[0] * mass == pytest.approx(thrust * h, rel=1e-5)


@pytest.mark.long
def test_positive_stern_planes_pitch_the_nose_down_and_positive_rudder_turns_it_to_starboard():
    for sign in (1.0, -1.0):
        diving = cruise(15.0, duration=3.0, stern_planes=sign * 0.05).dataset
        assert sign * diving.euler_angles[-1, 1] < -0.02 and sign * diving.q[-1, 2] > 0.01
        turning = cruise(15.0, duration=3.0, rudder=sign * 0.05).dataset
        assert sign * turning.euler_angles[-1, 0] > 0.02 and abs(turning.q[-1, 2]) < 0.05 * abs(turning.q[-1, 1])


@pytest.mark.long
def test_roll_at_rest_has_the_period_of_its_righting_moment():
    """W z_g φ = −M₄₄ φ̈ with M₄₄ less (m z_g)²/M₂₂, because the origin sways as the vehicle rolls."""
    vehicle = without_fins(damping={"linear": np.zeros(6)}, hull={"crossflow_drag": 0.0})
    m, z = float(P.mass), 0.02
    inertia = 0.1120 + m * z**2 + 0.0336 - (m * z) ** 2 / (m + 29.4376)
    rate = np.sqrt(m * 9.81 * z / inertia)
    run = co.simulate(
        vehicle, remus_start(vehicle, euler_zyx=(0, 0, 1e-4)), dt=2 * np.pi / rate / 400, steps=4000, save_every=400
    )
    np.testing.assert_allclose(run.dataset.euler_angles[:, 2], 1e-4, rtol=2e-4)


@pytest.mark.long
def test_slow_surge_decays_with_its_time_constant():
    vehicle = OPEN.replace(hull={"axial_drag": 0.0}, damping={"fading": np.zeros(6)}, center_of_mass=np.zeros(3))
    run = co.simulate(vehicle, remus_start(vehicle, speed=0.1), dt=DT, duration=40.0)
    np.testing.assert_allclose(run.dataset.qdot[:, 0], 0.1 * np.exp(-run.dataset.time / 20.0), rtol=1e-5)


@pytest.mark.long
def test_fins_keep_the_course_that_the_munk_moment_would_turn_away():
    """Nothing is deleted from the equations: without fins a torpedo is unstable, with them it is not."""
    drift = []
    for vehicle in (without_fins(), OPEN):
        vehicle = vehicle.replace(propeller={"torque_fraction": 0.0})
        start = remus_start(vehicle, speed=1.5, revolutions=15.0)
        start = start.replace(nu=start.nu + np.array([0, 1e-4, 0]))
        run = co.simulate(vehicle, start, dt=DT, duration=10.0)
        drift.append(abs(float(run.dataset.nu[-1, 1])))
    assert drift[0] > 1e-3 and drift[1] < 3e-5


TIMES = [0.0, 60.0, 120.0]
MISSION = {
    "depth": co.Held(TIMES, [10.0, 10.0, 1.0]),
    "heading": co.Held(TIMES, np.radians([0.0, 90.0, 90.0])),
    "speed": co.Held(TIMES, [1.5, 1.5, 1.5]),
}


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_a_mission_dives_turns_and_surfaces_within_the_limits_of_its_actuators(delay):
    current = np.array([0.1, 0.2, 0.0])
    vehicle = remus_100(current=current).replace(controller={"delay": delay})
    run = co.simulate(vehicle, remus_start(vehicle, speed=1.5, revolutions=15.0), dt=DT, duration=200.0, inputs=MISSION)
    assert run.plan.backend == "native"
    made = run.dataset
    depth, heading = made.q[:, 2].values, np.degrees(made.euler_angles[:, 0].values)
    speed = np.linalg.norm(made.qdot.values - current, axis=1)
    for time, wanted, course in ((59.0, 10.0, 0.0), (119.0, 10.0, 90.0), (199.0, 1.0, 90.0)):
        k = int(time / DT)
        assert depth[k] == pytest.approx(wanted, abs=0.1)
        assert heading[k] == pytest.approx(course, abs=0.05)
        assert speed[k] == pytest.approx(1.5, abs=0.003)
    assert max(abs(made.internal_stern_planes).max(), abs(made.internal_rudder).max()) <= np.radians(15) * (1 + 1e-15)
    assert float(abs(made.euler_angles[:, 1]).max()) < np.radians(40)
    assert run.summary()["energy_budget_error_max"] < 1e-5
    for name in ("damping", "hull", "stern_planes", "rudder"):
        assert made[f"work_{name}"].values[-1] < 0 < made.work_propeller.values[-1]
