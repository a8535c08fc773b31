"""The command in force: rates and costs of the first change, in problems and controllers."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import End, Input, Problem

MASS = co.System(co.Translation(1), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.push))


def away(motion):
    return (motion.g[0] - 5.0) ** 2 + 0.01 * motion.inputs.push @ motion.inputs.push


def pushed(cost=away, steps=8, **of_input):
    inputs = {"push": Input((1,), -4.0, 4.0, **of_input)}
    more = {"inputs": inputs, "cost": cost, "accuracy": False}
    return Problem(MASS, MASS.state(g=[0.0]), dt=0.1, steps=steps, **more)


def test_a_rate_bounds_the_first_command_of_a_controller():
    controller = pushed(rate=3.0).controller(iterations=2)
    start = MASS.state(g=[0.0])
    first = controller(start)
    assert first.plan["push"][:3, 0] == pytest.approx([0.3, 0.6, 0.9], abs=1e-5)  # from the guess, 0
    given = controller(start.replace(t=0.1), previous={"push": [2.0]})
    assert given.command["push"] == pytest.approx([2.3], abs=1e-5)
    controller.reset()
    assert controller(start, previous={"push": [-1.0]}).command["push"] == pytest.approx([-0.7], abs=1e-5)
    with pytest.raises(co.errors.ArgumentError, match="`previous` must be a dictionary of `push`"):
        controller(start, previous={"pull": 1.0})


def test_a_delayed_plan_begins_from_the_command_in_force():
    controller = pushed(rate=3.0, previous=1.0).controller(delay=0.1)
    answer = controller(MASS.state(g=[0.0]))
    assert answer.inputs["push"][0, 0] == 1.0 and answer.plan["push"][0, 0] == pytest.approx(1.3, abs=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("course", ["held", "linear"])
def test_the_first_command_of_an_optimum_is_bounded_from_the_one_in_force(course):
    problem = pushed(rate=3.0, previous=-1.0, course=course)
    first = 0.3 if course == "held" else 0.0
    assert problem.solve().inputs["push"][0, 0] == pytest.approx(first - 1.0, abs=1e-6)
    again = problem.solve(previous={"push": 2.0})
    assert again.inputs["push"][0, 0] == pytest.approx(first + 2.0, abs=1e-6)
    assert again.solution.problem.inputs["push"].previous == 2.0
    with pytest.raises(co.errors.ArgumentError, match="pull"):
        problem.solve(previous={"pull": 2.0})


@pytest.mark.long
def test_costs_of_changes_are_those_of_the_closed_form_and_of_the_controller():
    """Least Σ(½u² h + c(Δu)²/h) to the momentum 1 in 2 steps from u = 0: the stationary point of three numbers."""
    h, c = 0.1, 0.02
    problem = Problem(
        MASS, MASS.state(g=[0.0]), dt=h, steps=2, inputs={"push": Input((1,), change_cost=c, previous=0.0)},
        cost=lambda motion: 0.5 * motion.inputs.push @ motion.inputs.push, end=End(xi=[1.0]), accuracy=False,
    )  # fmt: skip
    H = h * np.eye(2) + 2 * c / h * np.array([[2.0, -1.0], [-1.0, 1.0]])
    kkt = np.block([[H, h * np.ones((2, 1))], [h * np.ones((1, 2)), np.zeros((1, 1))]])
    u = np.linalg.solve(kkt, [0.0, 0.0, 1.0])[:2]
    optimum, controller = problem.solve(), problem.controller(iterations=2)
    assert optimum.inputs["push"][:, 0] == pytest.approx(u, abs=1e-7)
    assert optimum.cost == pytest.approx(0.5 * u @ H @ u, rel=1e-7)
    assert controller(problem.start).plan["push"][:, 0] == pytest.approx(u, abs=1e-6)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"change_cost": -1.0}, "`change_cost` must be numbers from 0 on"),
        ({"change_cost": np.inf}, "`change_cost` must be finite"),
        ({"previous": np.inf}, "`previous` must be finite"),
        ({"previous": "zero"}, "`previous` must be numbers"),
        ({"previous": [1.0, 2.0, 3.0]}, r"must be a number or have the shape \(1,\)"),
    ],
)
def test_what_is_no_command_in_force_is_one_sentence(given, says):
    with pytest.raises(co.errors.ArgumentError, match=says):
        pushed(**given)
