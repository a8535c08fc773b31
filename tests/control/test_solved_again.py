"""A problem that is built once and solved for other starts, goals and parameters."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Bounds, End, Input, Measured, Problem, built, geodesics, optimum, stage, transcribe
from coadjoint.control import given as given_numbers
from coadjoint.control.geodesics import Geodesics
from coadjoint.control.objective import MappedFunction
from coadjoint.errors import LagrangianError
from coadjoint.kernels.trace import evaluate
from coadjoint.mechanics import start as start_of_runs

BODY = co.System(
    co.SO3(), lambda xi, p: 0.5 * xi @ (p.J * xi), parameters={"J": np.array([1.0, 2.0, 3.0]), "price": 1.0},
    forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
)  # fmt: skip


def effort(motion, p):
    return 0.5 * p.price * motion.inputs.torque @ motion.inputs.torque


def turn(yaw, pitch=0.2):
    return End(g=co.attitude.zyx(yaw, pitch, 0.0), xi=np.zeros(3))


def problem(**more):
    given = {"inputs": {"torque": Input((3,), -9, 9)}, "cost": effort, "end": turn(1.0), "changing": ("J", "price")}
    return Problem(BODY, BODY.state(), dt=0.25, steps=8, **(given | more))


CARRIED = co.System(
    co.SO3(), lambda xi, n, nu, a: 0.5 * xi @ xi + 0.5 * nu @ nu - a[2], additional=co.Defining(),
    advected=co.Defining(),
    forces=lambda motion: co.Force(torque=motion.inputs.torque, force=motion.inputs.force),
)  # fmt: skip


HALF = co.attitude.zyx(0.5, 0, 0)


def carried(end, **start):
    start = CARRIED.state(**{"q": [0, 0, 0], "a0": [0, 0, 1]} | start)
    inputs = {"torque": Input((3,)), "force": Input((3,))}
    return Problem(
        CARRIED, start, dt=0.2, steps=6, inputs=inputs, end=end,
        cost=lambda motion: motion.inputs.torque @ motion.inputs.torque + motion.inputs.force @ motion.inputs.force,
    )  # fmt: skip


def same(found, expected):
    assert found.cost == pytest.approx(expected.cost, rel=1e-9)
    for name, values in expected.inputs.items():
        assert found.inputs[name] == pytest.approx(values, abs=1e-7)
    assert found.difference < 1e-8 and found.violation < 1e-8


@pytest.fixture(scope="module")
def once():
    return problem()


TURNED_BACK = 17.909511939
"""The cost of the turn back, by a problem of its own: see the long test."""


@pytest.fixture
def no_tracing(monkeypatch):
    """Raises where a problem would be traced or built again."""

    def refuse(*arguments, **named):
        raise AssertionError("traced again")

    def after():
        for module, name in (
            (built, "transcribe"),
            (built, "solver_of"),
            (evaluate, "program_of"),
            (transcribe, "traced"),
        ):
            monkeypatch.setattr(module, name, refuse)

    return after


def test_for_another_start_goal_and_parameter_nothing_is_traced_or_built_again(no_tracing):
    once, start, goal = problem(), BODY.state(g=co.attitude.zyx(0.1, 0.2, 0.3), xi=[0.2, -0.1, 0.3]), turn(-0.7, 0.4)
    changed = {"J": np.array([1.5, 2.0, 2.5]), "price": 3.0}
    first = once.solve()
    once.solve(start=start, goal=goal, parameters=changed)
    no_tracing()
    again = once.solve(start=start, goal=goal, parameters=changed)
    assert once.solve(goal=turn(1.0)).cost == pytest.approx(first.cost, rel=1e-12) and again.build_seconds == 0.0
    assert again.cost == pytest.approx(TURNED_BACK, rel=1e-6)
    assert once.solve_each(goals=[goal], starts=[start], parameters=[changed], threads=1)[0].cost == again.cost
    own = again.solution.problem
    assert own.start is start and own.end is goal and float(own.system.parameters.price) == 3.0


def test_a_problem_inverts_its_momenta_and_evaluates_its_goal_once(monkeypatch):
    """For all of its functions of a node together."""
    counts = {"at_node": 0, "end_values": 0}
    for module, name in ((stage, "at_node"), (given_numbers, "end_values")):
        real = getattr(module, name)

        def counted(*arguments, real=real, name=name):
            counts[name] += 1
            return real(*arguments)

        monkeypatch.setattr(module, name, counted)
    bounded = problem(final_cost=effort, path={"slow": Bounds(lambda motion, p: motion.xi, -5, 5)})
    monkeypatch.setattr(start_of_runs, "_state_of", lambda *_: pytest.fail("a goal is no start"))
    built.BuiltProgram(bounded)
    assert counts == {"at_node": 1, "end_values": 1}


def test_velocities_are_not_inverted_where_no_function_reads_them_nor_a_run_made_until_it_is_read(monkeypatch):
    monkeypatch.setattr(stage, "at_node", lambda *_: pytest.fail("no function reads velocities"))
    monkeypatch.setattr(optimum, "simulate", lambda *_, **__: pytest.fail("nothing asks for the run"))
    found = problem(end=End(g=co.attitude.zyx(1.0, 0.2, 0.0))).solve()
    assert found.violation < 1e-8 and found.inputs["torque"].shape == (8, 3)
    with pytest.raises(pytest.fail.Exception, match="asks for the run"):
        print(found)


@pytest.mark.parametrize("group", [co.SO3(), co.SE2(), co.DirectProduct(co.Translation(1), co.SO3())])
def test_guesses_go_along_a_geodesic_also_where_the_exponential_has_no_scalar_expressions(group, monkeypatch):
    xi, s = np.full(group.dim, -0.5), np.array([0.0, 0.4, 1.0])
    a = evaluate.evaluate(group.exp, np.full(group.dim, 0.3))
    expected = evaluate.evaluate(lambda a: [group.matrix(group.compose(a, group.exp(k * xi))) for k in s], a)
    by_expressions, plain = Geodesics(group, 3), Geodesics(group, 3)
    ways = [by_expressions.along(a, xi, s)]

    def none(_):
        raise LagrangianError("no scalar expressions")

    monkeypatch.setattr(geodesics, "_along", none)
    for way in (*ways, plain.along(a, xi, s)):
        for k in range(3):
            one = jax.tree.map(lambda leaf, k=k: leaf[k], way)
            np.testing.assert_allclose(evaluate.evaluate(group.matrix, one), expected[k], atol=1e-14)
    np.testing.assert_allclose(by_expressions.turn(a, one), xi, atol=1e-12)


def test_a_program_differentiates_by_the_numbers_alone_that_its_functions_read():
    at_goal = transcribe.transcribe(problem(changing=()))
    assert at_goal.graph.names() == [
        "t",
        *(f"g[{i}, {j}]" for i in range(3) for j in range(3)),
        "mu[0]",
        "mu[1]",
        "mu[2]",
    ]
    read = [MappedFunction(getattr(at_goal.functions, name), 8, 0.25).read for name in ("equations", "cost")]
    assert read == [["x", "u", "z"], ["u"]]
    assert MappedFunction(transcribe.transcribe(problem()).functions.cost, 8, None).read == ["u", "p"]


@pytest.mark.long
def test_solved_again_the_optimum_is_that_of_a_new_problem():
    start, goal = BODY.state(g=co.attitude.zyx(0.1, 0.2, 0.3), xi=[0.2, -0.1, 0.3]), turn(-0.7, 0.4)
    heavy = BODY.replace(J=np.array([1.5, 2.0, 2.5]), price=3.0)
    again = problem().solve(start=start, goal=goal, parameters={"J": heavy.parameters.J, "price": 3.0})
    own = heavy.state(g=start.g, xi=start.xi)
    same(again, Problem(
        heavy, own, dt=0.25, steps=8, inputs={"torque": Input((3,), -9, 9)}, cost=effort, end=goal,
    ).solve())  # fmt: skip
    assert again.sensitivity("price").cost["price"] == pytest.approx(again.cost / 3.0, rel=1e-6)
    assert copy.deepcopy(again).cost == again.cost


@pytest.mark.long
@pytest.mark.parametrize(
    ("end", "goal"),
    [
        (End(g=np.eye(3), q=[1.0, 0, 0], qdot=[0, 0, 0]), End(g=HALF, q=[0, 1.0, 1], qdot=[0, 0.1, 0])),
        (End(mu=[0, 0, 0.5], pi=[0, 0.0, 0]), End(mu=[0.1, 0, 0], pi=[0.0, 0.2, 0])),
    ],
)  # fmt: skip
def test_every_kind_of_goal_may_change(end, goal):
    start = {"q": [0.5, 0, 0], "mu": [0.1, 0, 0.2], "pi": [0, 0.1, 0]}
    same(carried(end).solve(goal=goal, start=CARRIED.state(a0=[0, 0, 1], **start)), carried(goal, **start).solve())


@pytest.mark.long
def test_a_guess_may_be_an_earlier_optimum_and_then_takes_fewer_iterations():
    once = problem()
    near, far = once.solve(), once.solve(goal=turn(1.01), guess="simulate")
    warm = once.solve(goal=turn(1.01), guess=near)
    assert warm.cost == pytest.approx(far.cost, rel=1e-9) and warm.iterations <= far.iterations
    with pytest.raises(co.errors.ArgumentError, match="the optimum of another problem"):
        once.solve(guess=replace(once, duration=None, steps=2, end=None).solve())


@pytest.mark.long
@pytest.mark.parametrize("guess", ["simulate", "interpolate"])
def test_guesses_of_another_start_begin_there(guess):
    once = problem()
    start = BODY.state(xi=[0.5, 0.2, 0.1])
    case = once._built.case(start, None, None, None, guess)
    parts = case.transcription.split(case.guess)
    fresh = replace(once, duration=None, start=start)
    own = fresh._built.case(None, None, None, None, guess)
    assert parts.x == pytest.approx(own.transcription.split(own.guess).x, abs=1e-9)


@pytest.mark.long
def test_a_free_start_and_a_chosen_parameter_move_with_the_given_start():
    seen = {"rate": Measured(lambda motion, p: motion.xi, np.tile([0.3, 0.1, 0.2], (9, 1)), 0.1)}
    more = {"end": None, "free_start": {"g": 0.1, "xi": math.inf}, "measured": seen}
    start = BODY.state(g=co.attitude.zyx(0.4, 0, 0), xi=[0.2, 0, 0])
    same(problem(**more).solve(start=start), replace(problem(**more), duration=None, start=start).solve())
    once = Problem(
        BODY, BODY.state(xi=[0.3, 0.2, 0.1]), dt=0.25, steps=8, inputs={"torque": Input((3,), -9, 9)}, cost=effort,
        parameters={"J": (0.5, 4.0)}, end=End(xi=[0.1, 0.1, 0.1]),
    )  # fmt: skip
    again = once.solve(start=start)
    fresh = replace(once, duration=None, start=start).solve()
    assert again.cost == pytest.approx(fresh.cost, rel=1e-7, abs=1e-9)


@pytest.mark.long
def test_many_problems_in_one_call_have_the_optima_of_each_whatever_the_threads(once):
    starts = [BODY.state(xi=[rate, 0.0, 0.1]) for rate in (0.0, 0.2, 0.4)]
    goals = [turn(0.3), End(g=co.attitude.zyx(1.0, 0, 0), xi=[50.0, 0, 0]), turn(0.5)]
    by_one, by_two = (once.solve_each(starts, goals, threads=n) for n in (1, 2))
    assert isinstance(by_one[1], co.errors.OptimumError) and isinstance(by_two[1], co.errors.OptimumError)
    for k in (0, 2):
        assert by_one[k].cost == by_two[k].cost
        assert by_two[k].cost == pytest.approx(once.solve(start=starts[k], goal=goals[k]).cost, rel=1e-12)


@pytest.mark.long
def test_a_controller_aims_at_another_goal():
    def cost(motion, p):
        return 0.05 * motion.inputs.torque @ motion.inputs.torque

    once = problem(cost=cost)
    controller, other = (once.controller(iterations=10) for _ in "12")
    controller.aim(turn(0.3))
    plan = controller(BODY.state()).plan["torque"]
    assert plan == pytest.approx(once.solve(goal=turn(0.3)).inputs["torque"], abs=1e-6)
    assert np.max(np.abs(plan - other(BODY.state()).plan["torque"])) > 0.1


WRONG = {
    "a goal with other names": ({"goal": End(g=np.eye(3))}, r"what the problem's `end` gives: .*End\(g=…, xi=…\)"),
    "a goal that is a matrix": ({"goal": np.eye(3)}, "must give what"),
    "a goal outside the group": ({"goal": End(g=2 * np.eye(3), xi=np.zeros(3))}, "must lie in SO"),
    "a goal of another shape": ({"goal": End(g=np.eye(2), xi=np.zeros(3))}, "must be an element of"),
    "a velocity of another shape": ({"goal": End(g=np.eye(3), xi=[1.0])}, "`xi`"),
    "a velocity that is not a number": ({"goal": End(g=np.eye(3), xi=[np.nan, 0, 0])}, "finite"),
    "a place that is not a number": ({"goal": End(g=np.full((3, 3), np.nan), xi=np.zeros(3))}, "finite"),
    "a parameter that does not exist": ({"parameters": {"prise": 1.0}}, "no parameter `prise`: did you mean `price`"),
    "parameters that are a list": ({"parameters": [1.0]}, "a dictionary of name"),
    "a parameter of another shape": ({"parameters": {"J": np.ones(2)}}, "shape"),
    "a start that is an array": ({"start": np.zeros(3)}, "`start` must be a co.State"),
    "a start of another system": ({"start": CARRIED.state(q=[0, 0, 0], a0=[0, 0, 1])}, "another group or other spaces"),
    "a start of many members": ({"start": BODY.state(xi=co.each(np.ones((2, 3))))}, "`solve_each`"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_solved_again_is_one_sentence(once, name):
    given, says = WRONG[name]
    with pytest.raises(co.errors.ArgumentError, match=says) as error:
        once.solve(**given)
    assert "\n" not in str(error.value)


def test_lists_of_several_lengths_and_none_raise(once):
    for given in ({"starts": [BODY.state()], "goals": [turn(1.0), turn(2.0)]}, {}, {"starts": BODY.state()}):
        with pytest.raises(co.errors.ArgumentError, match=r"`starts`|starts, goals"):
            once.solve_each(**given)
    with pytest.raises(co.errors.ArgumentError, match="`threads`"):
        once.solve_each([BODY.state()], threads=0)
    with pytest.raises(co.errors.ArgumentError, match="functions read parameters"):
        replace(once, duration=None, end=lambda motion, p: motion.xi - jnp.ones(3)).solve(goal=turn(1.0))
    with pytest.raises(co.errors.ArgumentError, match="leave it out of `changing`"):
        problem(parameters={"J": (0.1, 9.0)})
