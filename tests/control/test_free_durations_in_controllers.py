"""Controllers that choose the duration of their plans: the quickest motion in closed loop, against its closed form."""

from __future__ import annotations

import math
import pickle

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Bounds, End, Input, Penalty, Problem
from coadjoint.errors import ArgumentError


def kinetic(xi):
    return 0.5 * xi @ xi


def pushing(motion):
    return co.Force(torque=motion.inputs.push)


def second(motion):
    return 1.0 + 0.0 * motion.t


MASS = co.System(co.Translation(1), kinetic, forces=pushing)


def quickest(**more):
    """A unit mass over a metre from rest to rest, |u| ≤ 1 N: T = 2 s, with one switch after 1 s."""
    given = {
        "dt": 0.2, "steps": 10, "inputs": {"push": Input((1,), -1, 1)}, "cost": second,
        "end": End(g=[1.0], xi=[0.0]), "free_duration": (0.21, 5.0),
    }  # fmt: skip
    return Problem(MASS, MASS.state(g=[0.0]), **(given | more))


def state(t, x, v):
    return MASS.state(g=[x], xi=[v]).replace(t=t)


def test_the_quickest_motion_arrives_in_closed_loop_at_its_time():
    controller, x, v = quickest(dt=0.5, steps=4, free_duration=(0.51, 5.0)).controller(), 0.0, 0.0
    for k in range(4):
        answer = controller(state(0.5 * k, x, v))
        assert answer.status == "solved" and answer.times[1] - answer.times[0] == pytest.approx(0.5, abs=1e-12)
        assert 0.5 * k + answer.duration == pytest.approx(2.0, abs=2e-2)
        assert answer.times[-1] - answer.times[0] == pytest.approx(answer.duration)
        u = float(answer.command["push"][0])
        assert u == pytest.approx(1.0 if k < 2 else -1.0, abs=0.06 if k == 3 else 1e-3)
        x, v = x + 0.5 * v + 0.125 * u, v + 0.5 * u
    assert (x, v) == (pytest.approx(1.0, abs=2e-3), pytest.approx(0.0, abs=2e-2))
    assert "over 0.51 to 5 s" in str(controller) and "4 solved" in str(controller)


@pytest.mark.long
def test_after_a_push_the_time_left_is_that_of_the_new_state():
    """From x at velocity v: T = 2 √(1 − x + v²/2) − v."""
    controller = quickest(steps=20).controller()
    x, v = 0.0, 0.0
    for k in range(6):
        answer = controller(state(0.2 * k, x, v))
        u = float(answer.command["push"][0])
        x, v = x + 0.2 * v + 0.02 * u - (0.1 if k == 2 else 0.0), v + 0.2 * u
        after = 2 * math.sqrt(1 - x + v * v / 2) - v
        found = controller(state(0.2 * (k + 1), x, v), previous={"push": answer.command["push"]}).duration
        assert found == pytest.approx(max(after, 0.21), abs=8e-3)


@pytest.mark.long
def test_a_plane_turn_in_closed_loop_takes_the_time_of_its_closed_form():
    """2 √(Jθ) for J = 2 kg m², θ = 1.5 rad and |u| ≤ 1 N m, on SO(2), with a lighter model parameter set later."""
    wheel = co.System(
        co.SO2(), lambda xi, p: 0.5 * p.J * xi @ xi, parameters={"J": 1.0},
        forces=lambda motion, p: co.Force(torque=motion.inputs.push),
    )  # fmt: skip
    end = End(g=np.array([[math.cos(1.5), -math.sin(1.5)], [math.sin(1.5), math.cos(1.5)]]), xi=[0.0])
    problem = Problem(
        wheel, wheel.state(), dt=0.1, steps=30, inputs={"push": Input((1,), -1, 1)},
        cost=lambda motion, p: 1.0 + 0 * motion.t, end=end, free_duration=(0.15, 9.0),
    )  # fmt: skip
    controller, T = problem.controller(changing=("J",)), 2 * math.sqrt(2 * 1.5)
    controller.change(J=2.0)
    heavy = wheel.replace(J=2.0)
    stepper = co.Stepper(heavy, heavy.state(), dt=0.1, inputs={"push": np.zeros(1)})
    answer = controller(stepper.state)
    assert answer.duration == pytest.approx(T, abs=5e-3)
    while answer.duration > 0.151:
        stepper.step(answer.command)
        answer = controller(stepper.state)
        assert float(stepper.state.t) < T
    assert float(stepper.state.t) > T - 0.15
    off = end.g.T @ np.asarray(stepper.state.g)
    assert abs(off[1, 0]) < 0.02


@pytest.mark.long
def test_a_plan_counts_from_the_command_in_force_and_follows_a_new_goal():
    problem = quickest(inputs={"push": Input((1,), -1, 1, rate=2.0)}, steps=6)
    controller = problem.controller()
    answer = controller(state(0.0, 0.0, 0.0), previous={"push": [-0.5]})
    assert answer.command["push"][0] == pytest.approx(-0.1, abs=1e-6)
    controller.aim(End(g=[-1.0], xi=[0.0]))
    again = controller(state(0.0, 0.0, 0.0), previous={"push": [-0.5]})
    assert again.command["push"][0] == pytest.approx(-0.9, abs=1e-6) and again.duration < answer.duration
    same = pickle.loads(pickle.dumps(controller))
    assert same._end.g == [-1.0] and same._plan.h == controller._plan.h


@pytest.mark.long
def test_a_soft_end_out_of_reach_has_a_plan():
    """In 2.5 s the unit mass comes from −9 to −6 at most."""
    end = End(g=[1.0], xi=[0.0], soft=Penalty(linear=100.0))
    answer = quickest(free_duration=(0.21, 2.5), steps=5, end=end).controller()(state(0.2, -9.0, 0.0))
    assert answer.status == "solved" and answer.command["push"] == pytest.approx(1.0, abs=1e-5)
    assert answer.violated["end g"] + answer.violated["end xi"] > 8.0


@pytest.mark.long
def test_a_failed_plan_goes_on_with_the_last_one_until_it_ends():
    controller = quickest(free_duration=(0.21, 2.5), steps=5).controller(fallback=lambda state: {"push": [0.5]})
    first = controller(state(0.0, 0.0, 0.0))
    lost = controller(state(0.2, -9.0, 0.0))
    assert (lost.status, lost.command) == ("planned", {"push": pytest.approx(first.plan["push"][1])})
    assert "no optimum from this state; a soft `end`" in lost.sentence
    controller.reset()
    assert controller(state(0.0, -9.0, 0.0)).status == "fallback"


@pytest.mark.long
def test_soft_paths_and_linear_inputs_of_uneven_steps_cost_their_lengths():
    """|v| ≤ ½ costs 20 times its excess a second: the peak is cut, and times of the plan weigh the violations."""
    slow = Bounds(lambda motion: motion.xi, -0.5, 0.5, soft=Penalty(linear=20.0))
    inputs = {"push": Input((1,), -1, 1, course="linear", rate=20.0)}
    problem = quickest(
        path={"slow": slow}, inputs=inputs, method=co.Trapezoidal(), free_duration=(0.5, 9.0), accuracy=False
    )
    answer = problem.controller()(state(0.0, 0.0, 0.0))
    assert answer.status == "solved" and answer.plan["push"].shape == (11, 1)
    assert np.max(answer.violated["slow"]) < 1e-4
    assert answer.duration == pytest.approx(1.0 / 0.5 + 0.5, abs=0.15)  # v = ½, with ramps of half a second


def test_a_fixed_horizon_has_times_too():
    effort = {"cost": lambda motion: jnp.sum(motion.inputs.push**2), "free_duration": None}
    answer = quickest(**effort).controller(shortest=0.4, delay=0.2)(state(1.0, 0.0, 0.0))
    assert answer.times == pytest.approx(1.2 + 0.2 * np.arange(11)) and answer.duration == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("problem", "given", "told"),
    [
        ({"free_duration": (0.1, 5.0)}, {}, "must exceed its period of 0.2 s"),
        ({}, {"period": 0.4}, "must exceed its period of 0.4 s"),
        ({}, {"iterations": 2}, "leave out `iterations` and `shortest`"),
        ({}, {"shortest": 0.4}, "leave out `iterations` and `shortest`"),
    ],
)
def test_what_a_free_duration_has_not_raises(problem, given, told):
    with pytest.raises(ArgumentError, match=told):
        quickest(**problem).controller(**given)


@pytest.mark.parametrize("soft", [Penalty(linear=100.0), None])
def test_a_short_motion_that_misses_its_end_gives_way_to_one_that_reaches_it(soft):
    """From x = 0.6515 m at 1.53 m/s, with |u| ≤ 2 N: back after an overshoot, T = v/a + 2 √(v²/2a² − d/a)."""
    problem = quickest(
        dt=0.1, steps=20, inputs={"push": Input((1,), -2, 2)}, end=End(g=[1.0], xi=[0.0], soft=soft),
        free_duration=(0.11, 5.0), accuracy=False,
    )  # fmt: skip
    T = 1.53 / 2 + 2 * math.sqrt(1.53**2 / 8 - 0.3485 / 2)
    answer = problem.controller()(state(0.0, 0.6515, 1.53))
    assert answer.status == "solved" and answer.duration == pytest.approx(T, abs=4e-3)
    if soft is not None:
        assert problem.solve(start=state(0.0, 0.6515, 1.53)).duration == pytest.approx(T, abs=4e-3)
