"""Constraints of the path within steps: the answer says how far they are violated, and `path_points` imposes them."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Bounds, End, Input, Problem
from coadjoint.control.within_steps import WorstWithin, lines

RADIUS = 0.5


def force(motion):
    return co.Force(torque=motion.inputs.f)


def point():
    return co.System(co.Translation(2), lambda xi: 0.5 * xi @ xi, forces=force)


def past_an_obstacle(y=0.0, course="held", **more):
    """Three steps of 1 s from −2 m to 2 m past a disk about the origin; the nodes jump over it."""
    system = point()
    return Problem(
        system, system.state(g=[-2.0, y]), dt=1.0, duration=3.0,
        inputs={"f": Input((2,), -20.0, 20.0, course=course)}, cost=lambda m: 0.5 * m.inputs.f @ m.inputs.f,
        path={"clear": Bounds(lambda m: m.g @ m.g, lower=RADIUS**2)}, end=End(g=[2.0, 0.01], xi=np.zeros(2)), **more,
    )  # fmt: skip


def clearances(optimum, parts):
    """|x|² at these parts of every step, by the dense output of the run."""
    nodes = np.asarray(optimum.run.records.t)[:-1]
    x = np.asarray(optimum.run.at((nodes[:, None] + optimum.run.dt * np.asarray(parts)).ravel()).g)
    return np.sum(x**2, axis=1)


def test_the_largest_violation_between_nodes_is_that_of_the_dense_output():
    optimum = past_an_obstacle().solve()
    assert optimum.violation < 1e-6
    true = RADIUS**2 - clearances(optimum, np.linspace(0.01, 0.99, 99)).min()
    found = optimum.within["clear"]
    assert found.violated and found.bound == RADIUS**2 and true > 0.2
    assert found.excess == pytest.approx(true, abs=1e-3)
    x = np.asarray(optimum.run.at([found.t]).g)[0]
    assert RADIUS**2 - x @ x == pytest.approx(found.excess, abs=1e-9)
    assert f"between the nodes `clear` is violated by {found.excess:.3g} at t = {found.t:.4g} s" in str(optimum)
    assert "path_points" in str(optimum)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("course", ["held", "linear"])
def test_path_points_hold_on_the_dense_output_of_the_run(course):
    """An input that is linear is at the value of that time."""
    optimum = past_an_obstacle(course=course, path_points=3).solve()
    assert clearances(optimum, [0.0, 0.25, 0.5, 0.75]).min() > RADIUS**2 - 1e-6
    rough = past_an_obstacle(course=course).solve()
    assert optimum.within["clear"].excess < 0.5 * rough.within["clear"].excess
    assert optimum.cost > rough.cost


@pytest.mark.long
def test_path_points_hold_with_an_actuator_that_lags_and_a_method_of_two_stages():
    """A part of a step takes the internal state along its own course, with unknowns of both stages."""

    def rule(motion, h, p):
        x, u, late = motion.internal.thrust, motion.inputs.f, jnp.exp(-h / p.lag)
        return {"thrust": co.mechanics.Course(u + (x - u) * late, u + (x - u) * (1 - late) * p.lag / h)}

    system = co.System(
        co.Translation(2), lambda xi, p: 0.5 * xi @ xi, forces=lambda m, p: co.Force(torque=m.internal.thrust),
        internal=rule, parameters={"lag": 0.2},
    )  # fmt: skip
    optimum = Problem(
        system, system.state(g=[-2.0, 0.3], internal={"thrust": np.zeros(2)}), dt=1.0, duration=3.0,
        inputs={"f": Input((2,), -20.0, 20.0)}, cost=lambda m, p: 0.5 * m.inputs.f @ m.inputs.f,
        path={"clear": Bounds(lambda m, p: m.g @ m.g, lower=RADIUS**2)}, end=End(g=[2.0, 0.01]), path_points=2,
        method=co.methods.LeftRight(),
    ).solve()  # fmt: skip
    assert optimum.difference < 1e-6
    assert clearances(optimum, [1 / 3, 2 / 3]).min() > RADIUS**2 - 1e-6
    true = RADIUS**2 - clearances(optimum, np.linspace(0.01, 0.99, 99)).min()
    assert optimum.within["clear"].excess == pytest.approx(max(true, 0.0), abs=1e-3)


def test_the_card_says_the_worst_violation_within_steps_or_how_large_it_may_be():
    held = {"low": WorstWithin(1e-9, 2.0, 0.3), "high": WorstWithin(2e-6, 2.0, 0.4), "none": WorstWithin(0.0, 0.0, 0.0)}
    assert lines(held, 0) == [("between the nodes", "constraints violated by at most 2.0e-06")] and lines({}, 0) == []
    over = {**held, "wall": WorstWithin(0.25, -1.0, 1.5)}
    ((what, said),) = lines(over, 0)
    assert what == "warning" and "`wall` is violated by 0.25 at t = 1.5 s; `path_points=3` imposes it" in said
    assert "more `path_points`" in lines(over, 2)[0][1]
    assert WorstWithin(2.1e-6, 1.0, 0.0).violated and not WorstWithin(1.9e-6, -1.0, 0.0).violated


@pytest.mark.long
def test_a_path_that_holds_within_steps_is_said_to():
    system = point()
    near = Problem(
        system, system.state(g=[-2.0, 0.0]), dt=1.0, duration=4.0, inputs={"f": Input((2,))},
        cost=lambda m: 0.5 * m.inputs.f @ m.inputs.f, path={"near": Bounds(lambda m: m.g, upper=9.0)},
        end=End(g=[2.0, 0.0]),
    ).solve()  # fmt: skip
    assert near.within["near"].excess == 0 and not near.within["near"].violated
    assert "between the nodes constraints violated by at most 0.0e+00" in " ".join(str(near).split())


@pytest.mark.long
def test_the_derivative_of_an_optimum_with_path_points_is_that_of_its_neighbours():
    """dJ/dg₀ with the unknowns of the points among the variables."""
    solved = [past_an_obstacle(y, path_points=1).solve(tolerance=1e-11) for y in (0.3, 0.299, 0.301)]
    slope = np.ravel(solved[0].sensitivity(start="g").cost["start g"])[1]
    assert slope == pytest.approx((solved[2].cost - solved[1].cost) / 0.002, rel=1e-4)


@pytest.mark.parametrize("given", [-1, 1.5, True, 10**6, "3"])
def test_path_points_must_be_a_whole_number(given):
    with pytest.raises(co.errors.ArgumentError, match="path_points"):
        past_an_obstacle(path_points=given)


def test_path_points_need_a_path_and_a_problem_that_is_solved():
    with pytest.raises(co.errors.ArgumentError, match="give `path`"):
        Problem(point(), point().state(), dt=1.0, steps=2, inputs={"f": Input((2,))}, path_points=2)
    for made in (lambda p: p.controller(), lambda p: p.estimator()):
        with pytest.raises(co.errors.ArgumentError, match="nodes alone"):
            made(past_an_obstacle(path_points=2))
