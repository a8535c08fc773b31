"""Controllers whose inputs are linear over each step: from the command in force on, to the optimum of the problem."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Bounds, Input, Penalty, Problem

BODY = co.System(
    co.SO3(), lambda xi, p: 0.5 * xi @ (p.J * xi), parameters={"J": np.array([1.0, 2.0, 3.0])},
    forces=lambda motion, p: co.Force(torque=motion.inputs.torque + motion.inputs.more * jnp.array([1.0, 0.0, 0.0])),
)  # fmt: skip
GOAL = co.attitude.zyx(0.8, 0.2, -0.1)


def away(motion, p):
    torque, more = motion.inputs.torque, motion.inputs.more
    off = jnp.sum((motion.g - jnp.asarray(GOAL)) ** 2)
    return 10 * off + motion.xi @ motion.xi + 0.1 * torque @ torque + 0.2 * more**2


def turned(linear, **more):
    inputs = {
        "torque": Input((3,), -2, 2, course="linear", previous=[0.3, -0.2, 0.1], **linear),
        "more": Input((), -1, 1, rate=4.0, previous=0.2),
    }
    given = {"inputs": inputs, "cost": away, "final_cost": away, "method": co.Trapezoidal(), "accuracy": False}
    return Problem(BODY, BODY.state(), dt=0.1, steps=4, **(given | more))


CASES = {
    "a rate": ({"rate": 6.0}, {}),
    "a cost of changes": ({"change_cost": 0.05}, {}),
    "a product of state and input": (
        {}, {"cost": lambda motion, p: away(motion, p) + 0.3 * motion.xi @ motion.inputs.torque}
    ),
    "a path of inputs": (
        {"rate": 9.0}, {"path": {"weak": Bounds(lambda motion, p: jnp.sum(motion.inputs.torque), -1.5, 1.5)}}
    ),
    "a soft path": (
        {}, {"path": {"slow": Bounds(lambda motion, p: motion.xi, -0.2, 0.2, soft=Penalty(quadratic=50.0))}}
    ),
}  # fmt: skip


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", CASES)
def test_the_plan_is_the_optimum_of_the_problem(name):
    linear, more = CASES[name]
    problem = turned(linear, **more)
    optimum, answer = problem.solve(), problem.controller(iterations=15)(problem.start)
    assert answer.status == "solved"
    for one, values in optimum.inputs.items():
        assert answer.plan[one] == pytest.approx(values, abs=2e-6)
    assert answer.plan["torque"].shape == (5, 3) and answer.plan["torque"][0] == pytest.approx([0.3, -0.2, 0.1])
    assert answer.command["torque"] == pytest.approx(answer.plan["torque"][1])
    assert answer.command["more"] == pytest.approx(answer.plan["more"][0])


@pytest.mark.long
def test_a_plan_begins_where_the_last_command_ended_and_leads_to_the_goal():
    problem = turned({"rate": 10.0})
    controller, state, before = problem.controller(), problem.start, np.array([0.3, -0.2, 0.1])
    for k in range(40):
        answer = controller(state)
        assert answer.plan["torque"][0] == pytest.approx(before, abs=1e-12) and answer.status == "solved"
        ramp = co.Linear([0.1 * k, 0.1 * (k + 1)], np.stack([before, answer.command["torque"]]))
        assert np.max(np.abs(answer.command["torque"] - before)) <= 1.0 + 1e-6
        inputs = {"torque": ramp, "more": answer.command["more"]}
        run = co.simulate(BODY, state, dt=0.1, steps=1, method=co.Trapezoidal(), inputs=inputs, accuracy=False)
        assert answer.nodes[1] == pytest.approx(controller._measured(run.final, BODY.parameters, False), abs=1e-3)
        state, before = run.final, answer.command["torque"]
    assert np.max(np.abs(np.asarray(state.g) - GOAL)) < 2e-2


@pytest.mark.long
def test_the_resolution_of_a_plan_is_that_of_its_run():
    problem, nodes = turned({"rate": 10.0}, accuracy=True), 0.1 * np.arange(5)
    with pytest.warns(UserWarning, match=r"one step is off by 6%.* Take dt = 0.05 or less"):
        plan = problem.controller()(problem.start).plan
    inputs = {"torque": co.Linear(nodes, plan["torque"]), "more": co.Held(nodes[:4], plan["more"])}
    run = co.simulate(BODY, problem.start, dt=0.1, steps=4, method=co.Trapezoidal(), inputs=inputs)
    assert "one step is off by 7%" in str(run) and "dt = 0.05 would do" in str(run)


def test_a_command_in_force_that_is_given_begins_the_plan(tmp_path):
    problem = turned({})
    controller = problem.controller()
    with pytest.raises(co.errors.ArgumentError, match="linear inputs has no C library"):
        controller.export_c(tmp_path / "control")
    answer = controller(problem.start, previous={"torque": [1.0, 0.5, -1.0], "more": 0.9})
    assert answer.plan["torque"][0] == pytest.approx([1.0, 0.5, -1.0]) and answer.plan["more"][0] >= 0.5 - 1e-9
