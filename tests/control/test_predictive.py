"""Model predictive control: the optimum when iterated, bounds that hold, the set pose reached, and what failures do."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
import paper_vehicle
from coadjoint.control import Bounds, End, Input, Problem, quadratic
from coadjoint.control.linearised import expanded
from coadjoint.control.transcribe import transcribe

BODY = co.System(
    co.SO3(),
    lambda xi, p: 0.5 * xi @ p.J @ xi,
    parameters={"J": np.diag([1.0, 2.0, 3.0])},
    forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
)
GOAL = co.attitude.zyx(1.0, 0.3, -0.2)


def away(motion, p):
    """Squares of the distance from the goal, which have curvature on matrices, and of ω and the torque."""
    between = motion.g - jnp.asarray(GOAL)
    torque = motion.inputs.torque
    return 10 * jnp.sum(between**2) + motion.xi @ motion.xi + 0.1 * torque @ torque


def turning(**more):
    given = {"inputs": {"torque": Input((3,), -2.0, 2.0)}, "cost": away, "final_cost": away, "steps": 15}
    return Problem(BODY, BODY.state(), dt=0.1, **(given | more))


def flown(controller, stepper, periods):
    """Answers and states of a loop."""
    answers, states = [], [stepper.state]
    for _ in range(periods):
        answers.append(controller(stepper.state))
        for row in range(controller.steps):
            stepper.step({name: value[row] for name, value in answers[-1].inputs.items()})
        states.append(stepper.state)
    return answers, states


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rate", [np.inf, 15.0])
def test_iterated_at_one_state_it_comes_to_the_optimum_of_another_solver(rate):
    problem = turning(inputs={"torque": Input((3,), -2.0, 2.0, rate=rate, previous=0.0)})
    optimum, controller = problem.solve(), problem.controller()
    answers = [controller(problem.start) for _ in range(25)]
    found = answers[-1].plan["torque"]
    assert found == pytest.approx(optimum.inputs["torque"], abs=1e-6)
    assert np.max(np.abs(optimum.inputs["torque"])) > 2 - 1e-6  # a bound is met
    assert all(answer.status == "solved" for answer in answers)


@pytest.mark.long
def test_its_optimum_ends_where_the_end_is_given_and_keeps_the_path():
    end, path = End(g=GOAL, xi=np.zeros(3)), {"slow": Bounds(lambda motion, p: motion.xi, -1.1, 1.1)}
    problem = turning(end=end, path=path, final_cost=None, steps=25)
    optimum, controller = problem.solve(), problem.controller(iterations=25)
    answer = controller(problem.start)
    assert answer.status == "solved"
    assert answer.plan["torque"] == pytest.approx(optimum.inputs["torque"], abs=1e-6)


@pytest.mark.long
def test_a_cost_of_products_of_states_and_inputs_leads_to_the_same_optimum():
    def power(motion, p):
        return away(motion, p) + 0.02 * (motion.xi @ motion.inputs.torque) ** 2

    problem = turning(cost=power)
    optimum, controller = problem.solve(), problem.controller(iterations=40)
    assert controller(problem.start).plan["torque"] == pytest.approx(optimum.inputs["torque"], abs=1e-6)


@pytest.mark.long
def test_in_the_nominal_case_the_loop_follows_the_optimum_of_the_whole_time():
    """With a horizon of all the time that is left the first periods of the loop are those of the optimum."""
    problem = turning(steps=40)
    optimum, controller = problem.solve(), problem.controller()
    stepper = co.Stepper(BODY, problem.start, dt=0.1, inputs={"torque": np.zeros(3)})
    for _ in range(15):
        controller(stepper.state)
    answers, states = flown(controller, stepper, 60)
    loop = np.array([answer.command["torque"] for answer in answers])
    assert loop[:15] == pytest.approx(optimum.inputs["torque"][:15], abs=2e-3)
    assert np.asarray(states[-1].g) == pytest.approx(GOAL, abs=1e-3)
    assert np.max(np.abs(loop)) <= 2.0


@pytest.mark.long
def test_rates_hold_from_period_to_period():
    problem = turning(inputs={"torque": Input((3,), -2.0, 2.0, rate=3.0)})
    stepper = co.Stepper(BODY, problem.start, dt=0.1, inputs={"torque": np.zeros(3)})
    answers, _ = flown(problem.controller(period=0.2), stepper, 15)
    rows = np.concatenate([answer.inputs["torque"] for answer in answers])
    change = np.abs(np.diff(rows, axis=0))
    assert np.max(change) <= 0.3 + 1e-6 and np.max(change) > 0.29


@pytest.mark.cases(1)
@pytest.mark.parametrize("delay", [0.1, 0.2])
def test_what_acts_in_the_delay_is_what_was_said_before_and_the_plan_begins_after_it(delay):
    problem = turning()
    controller, late = problem.controller(period=0.2, delay=delay), round(delay / 0.1)
    stepper = co.Stepper(BODY, problem.start, dt=0.1, inputs={"torque": np.zeros(3)})
    answers, states = flown(controller, stepper, 30)
    assert np.all(answers[0].inputs["torque"][:late] == 0.0)
    for before, after in pairwise(answers):
        assert np.array_equal(after.inputs["torque"][:late], before.plan["torque"][2 - late : 2])
    assert np.asarray(states[-1].g) == pytest.approx(GOAL, abs=1e-3)


def test_without_a_solution_the_last_plan_acts_and_then_the_fallback():
    """The path asks for |ω| < 0.5: a state that turns faster has no way to it in a step of bounded torque."""
    problem = turning(path={"slow": Bounds(lambda motion, p: motion.xi, -0.5, 0.5)}, steps=4)
    controller = problem.controller(fallback=lambda state: {"torque": [9.0, 0.0, 0.0]})
    solved = controller(problem.start)
    assert solved.status == "solved" and not solved.sentence
    answers = [controller(BODY.state(xi=[3.0, 0.0, 0.0]).replace(t=0.1 * k)) for k in range(1, 6)]
    assert [answer.status for answer in answers] == ["planned"] * 3 + ["fallback"] * 2
    for k, answer in enumerate(answers[:3]):
        assert np.array_equal(answer.command["torque"], solved.plan["torque"][k + 1])
        assert "No new plan" in answer.sentence
    assert np.array_equal(answers[-1].command["torque"], [2.0, 0.0, 0.0])  # within the bounds
    card = str(controller)
    assert "1 solved, 3 planned, 2 fallback" in card and "last failure" in card
    assert controller(problem.start).status == "solved"


def test_without_a_fallback_the_guesses_of_the_inputs_act():
    slow = {"slow": Bounds(lambda motion, p: motion.xi, -0.5, 0.5)}
    controller = turning(path=slow, inputs={"torque": Input((3,), -2, 2, guess=0.25)}).controller()
    answer = controller(BODY.state(xi=[3.0, 0.0, 0.0]))
    assert answer.status == "guess" and np.all(answer.command["torque"] == 0.25)
    assert controller(BODY.state(xi=[3.0, 0.0, 0.0]).replace(t=0.1)).status == "guess"


def test_prepared_before_the_state_or_with_it_the_answer_is_the_same():
    problem, answers = turning(), []
    for ahead in (False, True):
        controller = problem.controller()
        controller(problem.start)
        if ahead:
            assert controller.prepare() > 0.0
        answers.append(controller(BODY.state(xi=[0.1, 0.0, 0.2]).replace(t=0.1)))
    assert np.array_equal(answers[0].plan["torque"], answers[1].plan["torque"])
    assert answers[1].preparation_seconds < answers[0].preparation_seconds


@pytest.mark.long
def test_with_advected_directions_the_plan_stays_on_the_group_and_comes_to_the_optimum():
    vehicle = paper_vehicle.system(forces=lambda motion, p: co.Force(torque=motion.inputs.torque))

    def errors(motion, p):
        return jnp.concatenate([4 * jnp.ravel(motion.g - jnp.eye(3)), motion.xi, motion.inputs.torque])

    start = vehicle.state(g=co.attitude.zyx(0.2, 0.5, -0.4), q=[0, 0, 0], a0=[0, 0, 1])
    problem = Problem(
        vehicle, start, dt=0.2, steps=10, inputs={"torque": Input((3,), -4, 4)}, cost=co.control.squares(errors)
    )
    controller = problem.controller(iterations=25)
    answer = controller(start)
    assert answer.plan["torque"] == pytest.approx(problem.solve().inputs["torque"], abs=1e-6)
    R = answer.nodes[:, [controller.names.index(f"g[{i}, {j}]") for i in range(3) for j in range(3)]].reshape(-1, 3, 3)
    a = answer.nodes[:, [controller.names.index(f"a[{i}]") for i in range(3)]]
    assert R.transpose(0, 2, 1) @ R == pytest.approx(np.broadcast_to(np.eye(3), R.shape), abs=1e-12)
    assert a == pytest.approx(R[:, 2], abs=1e-12)  # Rᵀ a0


@pytest.mark.long
def test_the_papers_vehicle_comes_to_a_pose_within_its_thrust():
    def cost(motion, p):
        between, here = motion.g - jnp.asarray(turn), motion.q - jnp.array([2.0, 0.0, 0.0])
        force = motion.inputs.force
        return (
            50 * jnp.sum(between**2) + 10 * here @ here + motion.xi @ motion.xi + 5 * motion.nu @ motion.nu
            + 1e-3 * force @ force + 1e-3 * motion.inputs.torque @ motion.inputs.torque
        )  # fmt: skip

    vehicle = paper_vehicle.system(
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque, force=motion.inputs.force)
    )
    turn = co.attitude.zyx(np.pi / 2, 0, 0)
    inputs = {"torque": Input((3,), -5, 5), "force": Input((3,), -60, 60)}
    start = vehicle.state(q=[0, 0, 0], a0=[0, 0, 1])
    problem = Problem(vehicle, start, dt=0.2, steps=25, inputs=inputs, cost=cost, final_cost=cost)
    controller = problem.controller()
    stepper = co.Stepper(vehicle, start, dt=0.2, inputs={"torque": np.zeros(3), "force": np.zeros(3)})
    answers, states = flown(controller, stepper, 75)
    forces = np.array([answer.command["force"] for answer in answers])
    assert np.max(np.abs(forces)) <= 60.0 and np.max(np.abs(forces)) > 59.9
    assert {answer.status for answer in answers} == {"solved"}
    assert states[-1].q == pytest.approx([2, 0, 0], abs=2e-2)
    assert np.asarray(states[-1].g) == pytest.approx(turn, abs=2e-2)


def squared(motion, p):
    torque = motion.inputs.torque
    return jnp.concatenate(
        [jnp.sqrt(10.0) * jnp.ravel(motion.g - jnp.asarray(GOAL)), motion.xi, jnp.sqrt(0.1) * torque]
    )


@pytest.mark.long
def test_squares_are_the_cost_that_they_add_up_to_and_lead_to_its_optimum():
    sums = co.control.squares(squared)
    optimum = turning().solve()
    again, controller = (
        turning(cost=sums, final_cost=sums),
        turning(cost=sums, final_cost=sums).controller(iterations=25),
    )
    assert again.solve().cost == pytest.approx(optimum.cost, rel=1e-9)
    assert controller(BODY.state()).plan["torque"] == pytest.approx(optimum.inputs["torque"], abs=1e-6)


def test_squares_of_a_product_have_the_curvature_of_gauss_and_newton():
    """e = x y has |e|² with a Hessian that is indefinite at x = 1, y = 2 and 2 ∇e ∇eᵀ that is not."""
    pair = co.System(
        co.Translation(2), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.push)
    )
    cost = co.control.squares(lambda motion: jnp.stack([motion.g[0] * motion.g[1], 0.1 * motion.inputs.push[0]]))
    start = pair.state(g=[1.0, 2.0])
    problem = Problem(pair, start, dt=0.1, steps=3, inputs={"push": Input((2,), -1, 1)}, cost=cost)
    _, gradient, hessian = expanded(transcribe(problem), "cost")([1.0, 2.0, 0.0, 0.0], [0.5, 0.0], [], 0.1)
    J = np.zeros((2, 6))
    J[0, :2], J[1, 4] = [2.0, 1.0], 0.1
    assert hessian.full() == pytest.approx(2 * J.T @ J, abs=1e-14)
    assert gradient.full().ravel() == pytest.approx(2 * J.T @ [2.0, 0.05], abs=1e-14)


def test_a_changed_parameter_is_that_of_another_model():
    other = Problem(
        BODY.replace(J=np.diag([1.5, 2.0, 2.5])), BODY.state(), dt=0.1, steps=15, cost=away, final_cost=away,
        inputs={"torque": Input((3,), -2.0, 2.0)},
    ).controller(iterations=3)  # fmt: skip
    controller = turning().controller(iterations=3, changing=("J",))
    state = BODY.state(xi=[0.3, -0.2, 0.1])
    first = controller(state)
    controller.change(J=np.diag([1.5, 2.0, 2.5]))
    controller.reset()
    changed = controller(state)
    assert changed.plan["torque"] == pytest.approx(other(state).plan["torque"], abs=1e-8)
    assert np.max(np.abs(changed.plan["torque"] - first.plan["torque"])) > 0.1
    with pytest.raises(co.errors.ArgumentError, match="no parameter `mass`: it knows J"):
        controller.change(mass=2.0)
    with pytest.raises(co.errors.ArgumentError, match="name it in `changing`"):
        turning().controller().change(J=np.eye(3))


@pytest.mark.long
def test_velocities_of_a_heavier_body_have_the_momenta_of_the_model():
    heavy = BODY.replace(J=np.diag([2.0, 4.0, 6.0]))
    run = co.simulate(heavy, heavy.state(xi=[0.3, -0.2, 0.1]), dt=0.1, steps=1, inputs={"torque": lambda m: 0 * m.xi})
    controller = turning().controller()
    asked = controller(run.final, velocities=True).plan["torque"]
    controller.reset()
    given = BODY.state(g=run.final.g, xi=run.final.xi).replace(t=run.final.t)
    assert asked == pytest.approx(controller(given).plan["torque"], abs=1e-9)


CARRIED = co.System(co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Defining())
NO_COST = {"cost": None, "final_cost": None}
WRONG = {
    "a period of no whole steps": ({}, {"period": 0.15}, "`period` must be a whole number of steps of 0.1 s"),
    "a period of nothing": ({}, {"period": 0.0}, "at least one"),
    "a period that is a text": ({}, {"period": "0.1 s"}, "`period` must be a whole number"),
    "a period beyond the horizon": ({}, {"period": 3.0}, "longer than the horizon of 1.5 s"),
    "a horizon below a step": ({}, {"horizon": 0.05}, "`horizon` must be a whole number of steps"),
    "a delay of no whole steps": ({}, {"delay": 0.01}, "`delay` must be a whole number of steps"),
    "a delay beyond the period": ({}, {"delay": 0.2}, "not be longer than the period"),
    "no iteration": ({}, {"iterations": 0}, "`iterations`"),
    "a fallback that is a dictionary": ({}, {"fallback": {"torque": 0.0}}, "`fallback` must be a function"),
    "a change of no parameter": ({}, {"changing": ("mass",)}, "no parameter `mass`"),
    "a change that is a number": ({}, {"changing": 1}, "must be names of parameters"),
    "no cost": (NO_COST, {}, "give the problem a `cost`"),
    "parameters to choose": (
        {"parameters": {"J": (np.eye(3), 2 * np.eye(3))}}, {}, "leave out `parameters`",
    ),
    "an end of the inputs": ({"end": lambda motion, p: motion.inputs.torque}, {}, "of the state alone"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_controller_is_told_in_one_sentence(name):
    of_problem, of_controller, told = WRONG[name]
    with pytest.raises(co.errors.ArgumentError, match=told) as error:
        turning(**of_problem).controller(**of_controller)
    assert "\n" not in str(error.value)


STATES = {
    "no state": (np.zeros(3), "must be a co.State of the problem's system, but is array"),
    "a state of another system": (CARRIED.state(q=[0, 0, 0]), "another group or other spaces"),
    "many members": (BODY.state(xi=co.each(np.zeros((2, 3)))), "of one member"),
    "no number": (BODY.state().replace(mu=np.full(3, np.nan), from_velocities=False), "finite numbers"),
}


@pytest.mark.parametrize("name", STATES)
def test_what_is_no_state_is_told_in_one_sentence(name):
    state, told = STATES[name]
    with pytest.raises(co.errors.ArgumentError, match=told):
        turning().controller()(state)


def test_a_fallback_of_other_inputs_is_told():
    slow = {"slow": Bounds(lambda motion, p: motion.xi, -0.5, 0.5)}
    controller = turning(path=slow).controller(fallback=lambda state: {"force": 0.0})
    with pytest.raises(co.errors.ArgumentError, match="`fallback` must return a dictionary of `torque`"):
        controller(BODY.state(xi=[3.0, 0.0, 0.0]))


def test_a_program_that_the_quick_mode_does_not_solve_is_solved_by_the_other(monkeypatch):
    answer = turning().controller()(BODY.state())
    monkeypatch.setitem(quadratic.MODES, "near", quadratic.MODES["near"] | {"iter_max": 1})
    controller = turning().controller()
    again = controller(BODY.state())
    assert again.status == "solved" and controller._solve._far is not None
    assert again.plan["torque"] == pytest.approx(answer.plan["torque"], abs=1e-6)


def test_inputs_have_their_limits_states_none_and_slack_is_not_negative():
    M, end = np.ones((2, 3), bool), np.ones((1, 4), bool)
    layout = quadratic.StageLayout(
        2, 2, 1, {"M": M, "H": M[[0, 0, 1]], "C": M[:1], "last_H": end.T @ end, "last_C": end}
    )
    limits: Any = SimpleNamespace(u_limits=(np.full((2, 1), -3.0), np.full((2, 1), 4.0)))
    found, inf = layout._bounds(limits), np.inf
    random, first = np.random.default_rng(3), np.array([0.7, -0.4])
    shapes = ((2, 3, 3), (2, 3), (2, 2, 3), (2, 2), (2, 1, 3), (4, 4), (4,), (1, 4))
    H, g, M, c, C, last_H, last_g, last_C = (random.normal(size=shape) for shape in shapes)
    sides, ends = (np.full((2, 1), -5.0), np.full((2, 1), 6.0)), (np.full(1, -7.0), np.full(1, 8.0))
    stages = quadratic.Stages(H, g, M, c, C, sides, limits.u_limits, last_H, last_g, last_C, ends)
    numbers = layout.numbers(stages, first)
    np.testing.assert_allclose(numbers["g"], [*g[0, 2:] + H[0, 2:, :2] @ first, *g[1], *last_g])
    own, following = M[0, :, :2] @ first, C[0, :, :2] @ first
    for name, side, end in (("lba", -5, -7), ("uba", 6, 8)):
        expected = [*-(c[0] + own), *(side - following), *-c[1], side, end]
        np.testing.assert_allclose(numbers[name], expected, rtol=1e-13)
    assert layout.ends == 2
    np.testing.assert_array_equal(found["lbx"], [-3, -inf, -inf, -3, -inf, -inf, 0, 0])
    np.testing.assert_array_equal(found["ubx"], [4, inf, inf, 4, inf, inf, inf, inf])


def test_a_program_about_the_same_plan_is_the_same_again():
    """The last node's cost has curvature where that of the others has none, which must not add up from call to call."""
    problem = turning(cost=lambda motion, p: motion.inputs.torque @ motion.inputs.torque, final_cost=away)
    controller = problem.controller()
    controller(problem.start)
    again = controller(problem.start)
    plan, expanding = controller._plan, controller._expanding
    first, second = (
        [part.copy() for part in expanding(*plan[:3], controller._p, np.zeros(3), plan.left).stages[:4]] for _ in "12"
    )
    assert again.status == "solved" and all(map(np.array_equal, first, second))
    last_H = [expanding(*plan[:3], controller._p, np.zeros(3), plan.left).stages.last_H.copy() for _ in "12"]
    assert np.array_equal(*last_H)
