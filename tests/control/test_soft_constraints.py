"""Soft constraints: their penalties and violations in problems and in controllers."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Bounds, End, Input, Measured, Penalty, Phases, Problem

MASS = co.System(co.Translation(1), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.push))


def effort(motion):
    return 0.5 * motion.inputs.push @ motion.inputs.push


def pushed(steps=10, speed=0.0, limit=9.0, **more):
    start = MASS.state(g=[0.0], xi=[speed])
    inputs = {"push": Input((1,), -limit, limit)}
    return Problem(MASS, start, dt=1 / steps, steps=steps, inputs=inputs, **({"cost": effort} | more))


def slow(soft, most=0.5):
    return {"slow": Bounds(lambda motion: motion.xi, -most, most, soft=soft)}


def test_a_state_outside_its_soft_bounds_brakes_and_comes_back():
    """A state with hard bounds has no plan: 2.5 m/s cannot fall to 0.5 within a step."""
    final = {"final_cost": lambda motion: motion.g @ motion.g, "accuracy": False}
    problem = pushed(speed=2.5, limit=4.0, path=slow(Penalty(linear=100.0)), **final)
    controller, place, speed, left = problem.controller(), 0.0, 2.5, []
    speeds = []
    for k in range(10):
        answer = controller(MASS.state(g=[place], mu=[speed]).replace(t=0.1 * k))
        assert answer.status == "solved"
        left.append(answer.violated["slow"])
        push = float(answer.command["push"][0])
        place, speed = place + 0.1 * (speed + 0.05 * push), speed + 0.1 * push
        speeds.append(speed)
    assert speeds[:5] == pytest.approx([2.1, 1.7, 1.3, 0.9, 0.5], abs=1e-5) and max(np.abs(speeds[5:])) <= 0.5 + 1e-5
    assert left[0].shape == (11, 1) and left[0][1:5, 0] == pytest.approx([1.6, 1.2, 0.8, 0.4], abs=1e-4)
    assert np.max(left[-1]) < 1e-6


@pytest.mark.long
def test_hard_bounds_leave_no_plan_for_a_state_outside_them():
    problem = pushed(speed=2.5, limit=4.0, path=slow(None))
    assert problem.controller()(problem.start).status == "guess"


@pytest.mark.long
def test_an_optimum_says_by_how_much_a_soft_constraint_is_violated():
    optimum = pushed(speed=2.5, limit=4.0, path=slow(Penalty(linear=100.0))).solve()
    over = np.maximum(np.abs(np.asarray(optimum.run.records.mu)) - 0.5, 0.0)
    assert optimum.violated["slow"] == pytest.approx(over, abs=1e-6) and optimum.violation < 1e-8
    assert "`slow` is violated by at most 2 at t = 0 s" in str(optimum)


@pytest.mark.long
@pytest.mark.parametrize("weight", [3.0, 30.0])
def test_a_soft_end_is_missed_by_its_closed_form(weight):
    """Reaching x in 1 s costs 3/2 x²: with ½ρ (x − 1)² a distance of 3/(3 + ρ) is left; h² of it by the steps."""
    problem = pushed(40, end=End(g=[1.0], soft=Penalty(quadratic=weight)))
    optimum, answer = problem.solve(), problem.controller(iterations=2)(problem.start)
    assert optimum.violated["end g"][0, 0] == pytest.approx(3 / (3 + weight), rel=1e-3)
    assert answer.violated["end g"] == pytest.approx(optimum.violated["end g"], abs=1e-6)
    assert answer.plan["push"] == pytest.approx(optimum.inputs["push"], abs=1e-6)


@pytest.mark.long
def test_an_optimum_in_phases_says_by_how_much_each_violates_its_soft_constraints():
    """1.5 m in 2 s from rest at most 0.5 m/s, then 0.7 m/s: neither can hold, and each counts from its own bound."""
    first = pushed(4, path=slow(Penalty(linear=3.0)), accuracy=False)
    ends = pushed(4, path=slow(Penalty(linear=3.0), 0.7), end=End(g=[1.5]), accuracy=False)
    optimum = Phases({"first": first, "ends": ends}).solve()
    for name, most in (("first", 0.5), ("ends", 0.7)):
        over = np.maximum(np.abs(np.asarray(optimum.runs[name].records.mu)) - most, 0.0)
        assert optimum.violated[name]["slow"] == pytest.approx(over, abs=1e-6) and np.max(over) > 0.1
        assert f"`slow in {name}` is violated by at most {np.max(over):.3g} at t = " in str(optimum)
    assert optimum.minimum


@pytest.mark.long
def test_with_a_large_linear_penalty_the_optimum_is_that_of_hard_constraints():
    end = End(function=lambda motion: jnp.concatenate([motion.g - 0.4, motion.xi]), soft=Penalty(linear=500.0))
    soft = pushed(path=slow(Penalty(linear=500.0)), end=end, path_points=1).solve()
    hard = pushed(path=slow(None), end=End(g=[0.4], xi=[0.0]), path_points=1).solve()
    assert soft.cost == pytest.approx(hard.cost, rel=1e-5) and "`slow` holds" in str(soft)
    assert soft.inputs["push"] == pytest.approx(hard.inputs["push"], abs=1e-5)
    plain = pushed(path=slow(Penalty(linear=500.0)), end=end)
    controller = plain.controller(iterations=3)
    assert controller(plain.start).plan["push"] == pytest.approx(plain.solve().inputs["push"], abs=1e-5)


@pytest.mark.long
def test_a_soft_optimum_has_the_derivative_of_its_neighbours():
    system = co.System(
        co.Translation(1), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 1.0},
        forces=lambda motion, p: co.Force(torque=motion.inputs.push),
    )  # fmt: skip

    def least(mass):
        heavy = system.replace(mass=mass)
        return Problem(
            heavy, heavy.state(g=[0.0], xi=[1.0]), dt=0.1, steps=10, inputs={"push": Input((1,))},
            cost=lambda motion, p: effort(motion), end=End(g=[2.0], soft=Penalty(quadratic=5.0)),
            path={"slow": Bounds(lambda motion, p: motion.xi, upper=1.2, soft=Penalty(1.0, 2.0))},
        ).solve()  # fmt: skip

    found = least(1.0).sensitivity("mass").cost["mass"]
    assert found == pytest.approx((least(1.0005).cost - least(0.9995).cost) / 1e-3, rel=1e-4)


WRONG = {
    "a penalty of nothing": (lambda: Penalty(), "needs a positive"),
    "a negative penalty": (lambda: Penalty(linear=-1.0), "`linear` must be numbers from 0 on"),
    "an infinite penalty": (lambda: Penalty(quadratic=np.inf), "`quadratic` must be numbers from 0 on"),
    "a text": (lambda: Penalty("much"), "must be numbers"),
    "penalties of two shapes": (lambda: Penalty([1.0, 2.0], [1.0, 2.0, 3.0]), "needs a positive"),
    "a number in place of a penalty": (lambda: slow(3.0), "`soft` of co.control.Bounds must be a co.control.Penalty"),
    "an end with a number": (lambda: End(xi=[0.0], soft=1.0), "`soft` of co.control.End"),
    "an end of both kinds": (lambda: End(xi=[0.0], function=effort), "values or a `function`, but not both"),
    "a penalty of another shape": (lambda: pushed(path=slow(Penalty([1.0, 2.0]))).solve(), "must have one number or 1"),
    "an estimator": (
        lambda: pushed(path=slow(Penalty(1.0)), measured={"x": Measured(lambda m: m.g, None, 1.0)}).estimator(),
        "leave out `soft`",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_soft_constraint_is_one_sentence(name):
    make, says = WRONG[name]
    with pytest.raises(co.errors.ArgumentError, match=says) as error:
        make()
    assert "\n" not in str(error.value)
