"""Control laws by themselves: geometric attitude control on a rigid body, line of sight on a point in a current."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint_vehicles.controllers import attitude, line_of_sight

GAINS = (1.0, 1.4)
INERTIA = np.array([0.4, 1.1, 1.3])


def rotation(axis, angle):
    hat = np.cross(np.eye(3), np.asarray(axis) / np.linalg.norm(axis))
    return np.eye(3) + np.sin(angle) * hat + (1 - np.cos(angle)) * hat @ hat


def slewing(wanted, period):
    """A rigid body in space with the torque Jα + ω × Jω, sampled."""

    def rule(motion, h, p):
        R = attitude.attitude_of(motion.a.down, motion.a.north)

        def update(last):
            J, omega = p.inertia, motion.xi
            alpha = attitude.angular_acceleration(p.gains, R, p.wanted, omega)
            return {"torque": J * alpha + jnp.cross(omega, J * omega)}

        return {"controller": co.mechanics.sampled(motion, h, motion.internal.controller, update, period=period)}

    return co.System(
        co.SO3(),
        lambda xi, a, p: 0.5 * xi @ (p.inertia * xi),
        advected={"down": co.Defining(), "north": co.Defining()},
        parameters=co.Parameters(inertia=INERTIA, gains=GAINS, wanted=wanted),
        forces={"wheels": lambda motion, p: co.Force(torque=motion.internal.controller.value.torque)},
        internal=rule,
    )


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("axis", "degrees"), [((1, 0, 0), 179.0), ((0, 1, 0), 90.0), ((0, 0, 1), 179.0), ((1, -2, 0.5), 179.0)]
)
def test_a_slew_from_nearly_half_a_turn_converges_on_the_group_while_its_lyapunov_function_falls(axis, degrees):
    wanted = co.attitude.zyx(0.3, -np.pi / 2, 0.2)
    body = slewing(wanted, period=0.01)
    start = body.state(
        g=wanted @ rotation(axis, np.radians(degrees)),
        xi=[0.2, -0.1, 0.15],
        a0={"down": [0, 0, 1], "north": [1, 0, 0]},
        internal={"controller": co.mechanics.sampling({"torque": np.zeros(3)})},
    )
    run = co.simulate(body, start, dt=0.01, duration=30.0, monitors=False)
    R, omega = run.dataset.R.values, run.dataset.xi.values
    distance = np.array([float(evaluate(attitude.attitude_distance, g, wanted)) for g in R[::10]])
    lyapunov = 0.5 * np.sum(omega[::10] ** 2, axis=1) + GAINS[0] * distance
    assert distance[-1] < 1e-12 and np.abs(omega[-1]).max() < 1e-6
    # Where the body is at rest V̇ = 0, and what is held over a step of 0.01 s shows.
    assert np.all(np.diff(lyapunov) < 1e-3 * lyapunov[:-1] + 1e-15)
    assert lyapunov[0] > 1.0 or degrees < 100
    np.testing.assert_allclose(np.einsum("kji,kjl->kil", R, R), np.broadcast_to(np.eye(3), R.shape), atol=1e-13)


def test_the_error_of_an_attitude_is_the_slope_of_its_distance():
    """dΨ(R exp(s ω̂))/ds = e_R·ω, for random R, R_d; and e_R of a small turn is its vector."""
    random = np.random.default_rng(7)
    for _ in range(5):
        R, wanted, omega = rotation(random.normal(size=3), 2.0), rotation(random.normal(size=3), 1.0), [0.3, -0.5, 0.2]
        ahead, behind = (R @ rotation(omega, s * np.linalg.norm(omega)) for s in (1e-5, -1e-5))
        slope = (
            evaluate(attitude.attitude_distance, ahead, wanted) - evaluate(attitude.attitude_distance, behind, wanted)
        ) / 2e-5
        assert evaluate(attitude.attitude_error, R, wanted) @ omega == pytest.approx(float(slope), abs=1e-9)
    small = np.array([1e-6, -2e-6, 3e-6])
    np.testing.assert_allclose(
        evaluate(attitude.attitude_error, rotation(small, np.linalg.norm(small)), np.eye(3)), small, rtol=1e-9
    )


def test_the_attitude_of_directions_and_the_level_attitude_are_those_of_euler_angles():
    R = co.attitude.zyx(2.0, -0.4, 0.3)
    np.testing.assert_allclose(evaluate(attitude.attitude_of, R.T @ [0, 0, 1.0], R.T @ [1.0, 0, 0]), R, atol=1e-15)
    np.testing.assert_allclose(evaluate(attitude.level, np.float64(2.0)), co.attitude.zyx(2.0, 0.0, 0.0), atol=1e-15)


def follow(gain, current, *, look_ahead=10.0, period=0.2, duration=400.0):
    """A point that goes at 1.5 m/s through the water on the course that it is told, beside a leg to the north-east."""
    start, end = np.zeros(3), np.array([1000.0, 1000.0, 0.0])

    def move(position, integral):
        here = line_of_sight.leg(position, start, end)
        angle, integral = line_of_sight.line_of_sight(here.beside, integral, look_ahead, gain, period)
        course = here.course + angle
        velocity = 1.5 * jnp.stack([jnp.cos(course), jnp.sin(course), jnp.zeros(())]) + current
        return position + period * velocity, integral, here.beside

    step = tabulate(move, np.array([0.0, 20.0, 0.0]), np.float64(0))
    position, integral, beside = np.array([0.0, 20.0, 0.0]), np.float64(0), []
    for _ in range(int(duration / period)):
        position, integral, off = step(position, integral)
        beside.append(float(off))
    return np.array(beside), integral


ACROSS = 0.5 * np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)


def test_line_of_sight_without_integral_stays_off_the_path_by_the_drift_angle_in_a_current():
    """0 = 1.5 sin χ + 0.5: y = Δ tan(asin(1/3)); in still water y goes to 0."""
    still, _ = follow(0.0, np.zeros(3))
    assert abs(still[-1]) < 1e-12
    drifting, _ = follow(0.0, ACROSS)
    assert drifting[-1] == pytest.approx(10.0 * np.tan(np.arcsin(0.5 / 1.5)), rel=1e-9)


def test_the_integral_holds_the_path_in_a_current_and_is_the_aim_that_this_takes():
    beside, integral = follow(0.3, ACROSS)
    assert abs(beside[-1]) < 1e-6
    assert 0.3 * integral == pytest.approx(10.0 * np.tan(np.arcsin(0.5 / 1.5)), rel=1e-6)
    assert beside.min() > -2.0  # It overshoots little: far from the path the integral hardly grows.


def test_a_leg_has_the_distances_of_its_geometry():
    start, end = np.array([1.0, 2.0, 3.0]), np.array([4.0, 6.0, 8.0])
    here = evaluate(line_of_sight.leg, np.array([2.0, 1.0, 4.0]), start, end)
    way, off = end - start, np.array([1.0, -1.0, 1.0])
    assert here.length == pytest.approx(5.0) and here.course == pytest.approx(np.arctan2(4, 3))
    assert here.climb == pytest.approx(-np.pi / 4)
    assert here.along == pytest.approx(off[:2] @ way[:2] / 5) and here.beside == pytest.approx((3 * -1 - 4 * 1) / 5)
    across = np.cross(np.array([4.0, -3.0, 0]) / 5, way / np.linalg.norm(way))  # Down, in the leg's vertical plane.
    assert here.beneath == pytest.approx(float(off @ across) * np.sign(across[2]))
    assert evaluate(line_of_sight.arrived, np.array([4.5, 6.0, 0.0]), here, end, 1.0)
    assert not evaluate(line_of_sight.arrived, np.array([2.0, 1.0, 4.0]), here, end, 1.0)
