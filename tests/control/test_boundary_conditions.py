"""Residuals of the ends of an optimal motion, and of a start that may be free, on flat spaces and on a sphere."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import End, Input
from coadjoint.control.boundary_conditions import (
    end_conditions,
    moved_start,
    start_deviations,
    start_residual,
    start_values,
)
from coadjoint.control.given import given_values
from coadjoint.control.problem_data import ProblemData
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate

TURNED = co.attitude.zyx(0.3, -0.2, 0.5)
GIVEN = {"g": co.attitude.zyx(0.1, 0.2, 0.3), "a0": [0.0, 0.6, 0.8]}


def carried(space=co.Defining()):  # noqa: B008
    return co.System(
        co.SO3(), lambda xi, n, nu, a: 0.5 * xi @ xi + nu @ nu + n @ a, additional=space, advected=co.Defining(),
        forces=lambda motion: co.Force(torque=motion.inputs.u),
    )  # fmt: skip


def problem(system, start, **more):
    return ProblemData(system, start, dt=0.1, steps=3, inputs={"u": Input((3,))}, **more)


@pytest.mark.parametrize("space", [co.Defining(), co.Sphere()])
def test_an_end_is_reached_where_all_its_residuals_vanish_and_they_are_its_distance(space):
    system = carried(space)
    q, qdot = np.array([0.0, 0.6, 0.8]), np.array([0.1, 0.8, -0.6])
    start = system.state(**GIVEN, q=[1.0, 0, 0], xi=[1.0, 2.0, 3.0], qdot=[0, 0.1, 0.2])
    given = problem(system, start, end=End(g=TURNED, q=q, xi=[0.4, 0.5, 0.6], qdot=qdot))
    residuals, goal = end_conditions(given), given_values(given)["goal"]
    target = system.state(g=TURNED, a0=GIVEN["a0"], q=q, xi=[0.4, 0.5, 0.6], qdot=qdot)
    assert list(residuals) == ["g", "q", "xi", "qdot"]
    angle = 0.4
    moved = target.replace(g=TURNED @ co.attitude.zyx(angle, 0, 0), xi=target.xi + np.array([0.1, 0.2, 0.3]))
    on_goal, off = evaluate(
        lambda *states: [[one(system, s, goal[name]) for name, one in residuals.items()] for s in states], target, moved
    )
    assert all(np.max(np.abs(part)) < 1e-14 for part in on_goal)
    np.testing.assert_allclose(off[0], [0, 0, 2 * np.tan(angle / 2)], atol=1e-14)
    np.testing.assert_allclose(off[2], [0.1, 0.2, 0.3], atol=1e-14)
    back = TURNED @ co.attitude.zyx(angle, 0, 0) @ TURNED.T
    for found, goal, at in ((off[1], q, q), (off[3], qdot, back @ q)):
        apart = back @ goal - goal
        expected = apart if space == co.Defining() else apart - at * (at @ apart)
        assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(expected), rel=1e-12)
        assert found.shape == ((3,) if space == co.Defining() else (2,))


def test_the_momenta_of_an_end_are_compared_in_the_body():
    system = carried()
    start = system.state(**GIVEN, q=[1.0, 0, 0], mu=[1.0, 2.0, 3.0], pi=[0, 0.1, 0.2])
    given = problem(system, start, end=End(mu=[1.0, 0, 0], pi=[0.5, 0, 0]))
    goal = given_values(given)["goal"]
    mu, pi = evaluate(lambda s: [one(system, s, goal[name]) for name, one in end_conditions(given).items()], start)
    np.testing.assert_allclose(mu, [0, 2.0, 3.0], atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(pi + np.array([0.5, 0, 0])), np.linalg.norm([0, 0.1, 0.2]), rtol=1e-12)


@pytest.mark.parametrize("kind", ["velocities", "momenta"])
def test_a_start_moved_by_its_free_numbers_leaves_no_residual_and_the_start_leaves_them(kind):
    system = carried()
    first, second = ("xi", "qdot") if kind == "velocities" else ("mu", "pi")
    start = system.state(**GIVEN, q=[1.0, 0, 0], **{first: [1.0, 2.0, 3.0], second: [0, 0.1, 0.2]})
    given = problem(system, start, free_start={"g": 0.1, "q": [1.0, 2.0, 3.0], first: 1.0, second: 0.5})
    np.testing.assert_array_equal(start_deviations(given), [0.1] * 3 + [1, 2, 3] + [1.0] * 3 + [0.5] * 3)
    eta = np.array([0, 0, 0.3, 0.1, 0.2, 0.3, 1.0, 0, 0, 0, 2.0, 0])
    moved, residual, values = moved_start(given, system, eta), start_residual(given), start_values(given, start)

    def rows(system, state, eta):
        return residual(system, state, eta, values)

    np.testing.assert_allclose(moved.g, GIVEN["g"] @ co.attitude.zyx(0.3, 0, 0), atol=1e-14)
    np.testing.assert_allclose(moved.q, [1.1, 0.2, 0.3], atol=1e-14)
    np.testing.assert_allclose(getattr(moved, first), [2.0, 2.0, 3.0], atol=1e-14)
    np.testing.assert_allclose(getattr(moved, second), [0, 2.1, 0.2], atol=1e-14)
    none, at_start, zero = evaluate(
        lambda moved, start, eta: (rows(system, moved, eta), rows(system, start, eta), rows(system, start, 0 * eta)),
        moved, start, eta,
    )  # fmt: skip
    assert np.max(np.abs(none)) < 1e-14 and np.max(np.abs(zero)) < 1e-14 and len(none) == 9 + 3 + 3 + 3 + 3
    np.testing.assert_allclose(at_start[:9], (GIVEN["g"] - moved.g).ravel(), atol=1e-14)
    np.testing.assert_allclose(at_start[9:], [-0.1, -0.2, -0.3, 0, 0, 0, -1.0, 0, 0, 0, -2.0, 0], atol=1e-14)
    held = problem(system, start)
    assert moved_start(held, system, np.zeros(0)) is start and start_deviations(held).shape == (0,)


@pytest.mark.parametrize(
    ("free", "space", "says"),
    [
        ({"q": 1.0}, co.Sphere(), "this system's q lies on a manifold"),
        ({"mu": 1.0}, co.Defining(), "`mu`, but the start was given by its velocities: name xi or qdot"),
        ({"g": [1.0, 2.0]}, co.Defining(), "must give `g` one standard deviation, or 3 numbers"),
    ],
)
def test_a_part_of_the_start_that_cannot_be_free_is_named(free, space, says):
    system = carried(space)
    start = system.state(**GIVEN, q=[1.0, 0, 0], xi=[1.0, 2.0, 3.0])
    with pytest.raises(ArgumentError, match=says):
        start_deviations(problem(system, start, free_start=free))


def test_an_end_of_nothing_and_one_in_q_without_q_are_refused():
    system = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.u))
    for end, says in ((End(), "co.control.End is empty"), (End(qdot=[1.0]), "has `qdot`, but .* no `additional`")):
        with pytest.raises(ArgumentError, match=says):
            end_conditions(problem(system, system.state(), end=end))
    assert end_conditions(problem(system, system.state())) == {}
