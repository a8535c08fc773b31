"""The linear-quadratic regulator as a terminal cost and set: Riccati's equation in closed form and by iteration."""

from __future__ import annotations

import copy
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Input, Problem, squares

H = 0.1
MASS = co.System(co.Translation(1), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.push))
WEIGHTS = 1.0, 0.5, 0.3


def away(motion):
    return jnp.concatenate(
        [w * part for w, part in zip(WEIGHTS, (motion.g, motion.xi, motion.inputs.push), strict=True)]
    )


def pushed(steps=5, **more):
    inputs = {"push": Input((1,), *more.pop("bounds", ()))}
    return Problem(
        MASS, more.pop("start", MASS.state(g=[0.0])), dt=H, steps=steps, inputs=inputs, cost=squares(away), **more
    )


def riccati(inertia=1.0, weights=WEIGHTS):
    """K and V of x → (x + hv/J + h²u/2J, v + hu) by iteration, with the trapezoidal rule of the squares of weights."""
    M = np.array([[1.0, H / inertia, H * H / (2 * inertia)], [0.0, 1.0, H]])
    Q, R = 2 * np.diag([weights[0] ** 2, (weights[1] / inertia) ** 2]), 2 * weights[2] ** 2
    each = H / 2 * M.T @ Q @ M
    each[:2, :2] += H / 2 * Q
    each[2, 2] += H * R
    V = np.zeros((2, 2))
    for _ in range(2000):
        both = each + M.T @ V @ M
        K = both[2:, :2] / both[2, 2]
        V = both[:2, :2] - both[:2, 2:] @ K
    return K, V, M


def test_with_its_cost_at_the_end_five_steps_are_the_regulator_of_an_endless_horizon():
    K, V, M = riccati()
    problem = pushed()
    regulator = problem.regulator()
    assert regulator.gain == pytest.approx(K, rel=1e-8) and regulator.cost == pytest.approx(V, rel=1e-8)
    assert np.max(np.abs(regulator.poles)) < 1 and regulator.level == np.inf
    controller, x = replace(problem, duration=None, terminal=regulator).controller(), np.array([1.0, -0.4])
    for k in range(8):
        state = MASS.state(g=x[:1], mu=x[1:]).replace(t=H * k)
        command = controller(state).command["push"]
        assert command == pytest.approx(-K @ x, rel=1e-8, abs=1e-8)
        assert regulator(state)["push"] == pytest.approx(-K @ x, rel=1e-8)
        assert regulator.value(state) == pytest.approx(0.5 * x @ V @ x, rel=1e-8)
        x = M @ np.concatenate([x, command])
    kept = {"system", "like", "back", "rest", "there"}
    assert {*vars(copy.copy(regulator.directions))} == kept < {*vars(regulator.directions)}, "compiled tables stay here"


@pytest.mark.long
def test_the_optimum_of_a_short_problem_has_the_cost_of_the_endless_one():
    _, V, _ = riccati()
    problem, start = pushed(), MASS.state(g=[1.0], xi=[-0.4])
    optimum = replace(problem, duration=None, start=start, terminal=problem.regulator()).solve()
    assert optimum.cost == pytest.approx(0.5 * np.array([1.0, -0.4]) @ V @ [1.0, -0.4], rel=1e-8)


def test_in_the_terminal_set_the_regulator_keeps_the_bounds_and_a_plan_ends_there():
    problem = pushed(10, bounds=(-1.0, 2.0), start=MASS.state(g=[0.5]), accuracy=False)
    regulator = problem.regulator(at=MASS.state(g=[0.0])).inside()
    K, V, _ = riccati()
    edge = np.linalg.solve(V, K[0]) * np.sqrt(2 * regulator.level / (K[0] @ np.linalg.solve(V, K[0])))
    assert 0.5 * edge @ V @ edge == pytest.approx(regulator.level) and K[0] @ edge == pytest.approx(1.0, rel=1e-6)
    tight = replace(regulator, within=0.01)
    planned = replace(problem, duration=None, terminal=tight)
    optimum, answer = planned.solve(), planned.controller(iterations=20)(planned.start)
    assert regulator.value(optimum.run.final) == pytest.approx(0.01, rel=1e-6)
    assert answer.status == "solved" and answer.plan["push"] == pytest.approx(optimum.inputs["push"], abs=1e-6)
    assert regulator(MASS.state(g=[5.0]))["push"] == -1.0


BODY = co.System(
    co.SO3(), lambda xi, p: 0.5 * xi @ (p.J * xi), parameters={"J": np.array([1.0, 2.0, 3.0])},
    forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
)  # fmt: skip
GOAL = co.attitude.zyx(1.0, 0.3, -0.2)


def turned(**more):
    def away(motion, p):
        turn = co.SO3().log(jnp.asarray(GOAL).T @ motion.g)
        return jnp.concatenate([3 * turn, motion.xi, 0.3 * motion.inputs.torque])

    inputs = {"torque": Input((3,), -2, 2)}
    return Problem(BODY, BODY.state(g=GOAL), dt=H, steps=10, inputs=inputs, cost=squares(away), **more)


def test_about_any_attitude_the_gains_are_those_of_three_plane_turns():
    regulator, each = turned().regulator(), [riccati(J, (3.0, 1.0, 0.3)) for J in (1.0, 2.0, 3.0)]
    for axis, (K, V, _) in enumerate(each):
        own = [axis, axis + 3]
        expected = np.zeros(6)
        expected[own] = K[0]
        assert regulator.gain[axis] == pytest.approx(expected, rel=1e-8, abs=1e-8)
        assert regulator.cost[np.ix_(own, own)] == pytest.approx(V, rel=1e-8)


@pytest.mark.long
def test_near_the_goal_the_cost_of_the_controlled_motion_is_that_of_the_regulator():
    problem = turned()
    regulator = problem.regulator()
    start = BODY.state(g=GOAL @ co.attitude.zyx(0.02, -0.01, 0.015), xi=[0.01, -0.02, 0.01])
    controller = replace(problem, duration=None, terminal=regulator).controller(fallback=regulator)
    stepper, spent = co.Stepper(BODY, start, dt=H, inputs={"torque": np.zeros(3)}), 0.0

    def rate(state, u):
        turn = np.asarray(co.SO3().log(GOAL.T @ np.asarray(state.g)))
        return 9 * turn @ turn + np.sum((state.mu / [1.0, 2.0, 3.0]) ** 2) + 0.09 * u @ u

    for _ in range(150):
        before = stepper.state
        u = controller(before).command["torque"]
        stepper.step({"torque": u})
        spent += H / 2 * (rate(before, u) + rate(stepper.state, u))
    assert spent == pytest.approx(regulator.value(start), rel=2e-3)
