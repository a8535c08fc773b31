"""Local optima: several guesses, stationary points that are no minima, and guesses past an obstacle."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import coadjoint as co
from coadjoint.control import Bounds, End, Input, Problem

BODY = co.System(
    co.SO3(), lambda xi, p: 0.5 * xi @ (p.J * xi), parameters={"J": np.array([1.0, 2.0, 3.0])},
    forces=lambda motion, p: co.Force(torque=motion.inputs.torque),
)  # fmt: skip


def turning(angle, steps=20, **more):
    end = End(g=Rotation.from_rotvec([0, 0, angle]).as_matrix(), xi=np.zeros(3))
    return Problem(
        BODY, BODY.state(), dt=5.0 / steps, steps=steps, inputs={"torque": Input((3,))}, end=end, accuracy=False,
        cost=lambda motion, p: 0.5 * motion.inputs.torque @ motion.inputs.torque, **more,
    )  # fmt: skip


def test_a_turn_about_the_axis_of_the_largest_moment_is_no_minimum_and_several_guesses_find_one():
    """The closed form 6 J₃²θ²/T³ of the principal axis is a saddle at 2.5 rad; a turn out of the plane costs less."""
    problem = turning(2.5, steps=10)
    best = problem.solve(guesses=4, tolerance=1e-8)
    assert best.minimum
    costs = [one for one in best.guesses.values() if isinstance(one, float)]
    assert best.cost == min(costs) and best.cost < 0.95 * best.guesses["first"]
    assert "the other way round" in best.guesses and len(best.guesses) == 4
    assert f"costs {best.cost:.9g}" in str(best)


@pytest.mark.long
def test_an_optimum_that_is_no_minimum_warns_and_a_minimum_does_not():
    saddle, minimum = turning(2.5).solve(), turning(1.0).solve()
    assert not saddle.minimum and "no minimum: a motion nearby costs less" in str(saddle)
    assert minimum.minimum and "no minimum" not in str(minimum)


@pytest.mark.long
@pytest.mark.parametrize("angle", [np.pi, np.pi - 1e-6])
def test_half_a_turn_and_nearly_half_a_turn_have_the_same_optimum(angle):
    assert turning(angle, 50).solve(guesses=4).cost == pytest.approx(3.4077, abs=1e-3)


@pytest.mark.long
def test_the_other_way_round_is_found_where_it_is_the_shorter_one():
    """A body that spins against the short way: to go on is cheaper."""
    start = BODY.state(xi=[-2.5, 0.0, 0.0])
    goal = End(g=Rotation.from_rotvec([2.9, 0, 0]).as_matrix(), xi=np.zeros(3))
    once = turning(1.0)
    best = once.solve(start=start, goal=goal, guesses=3)
    assert best.guesses["the other way round"] <= best.guesses["first"] + 1e-9


@pytest.mark.long
def test_an_obstacle_on_the_straight_guess_is_passed():
    mass = co.System(
        co.Translation(2), lambda xi: 0.5 * xi @ xi, forces=lambda motion: co.Force(torque=motion.inputs.push)
    )
    clear = Bounds(lambda motion: jnp.sum((motion.g - jnp.array([1.0, 0.0])) ** 2), lower=0.16)
    optimum = Problem(
        mass, mass.state(g=[0.0, 0.0]), dt=0.2, steps=20, inputs={"push": Input((2,))}, path={"post": clear},
        cost=lambda motion: motion.inputs.push @ motion.inputs.push, end=End(g=[2.0, 0.0], xi=[0.0, 0.0]),
        accuracy=False,
    ).solve(max_iterations=60)  # fmt: skip
    assert "from a bent guess" in optimum.solver
    distance = np.hypot(*(np.asarray(optimum.run.records.g) - [1.0, 0.0]).T)
    assert np.min(distance) > 0.4 - 1e-6 and np.max(np.abs(optimum.run.records.g[:, 1])) > 0.3


def away(motion, p):
    torque = motion.inputs.torque
    return (
        10 * jnp.sum((motion.g - jnp.diag(jnp.array([-1.0, -1.0, 1.0]))) ** 2) + motion.xi @ motion.xi + torque @ torque
    )


def test_a_controller_leaves_half_a_turn_and_stays_at_its_goal():
    controller = Problem(
        BODY, BODY.state(), dt=0.2, steps=10, inputs={"torque": Input((3,), -2, 2)}, cost=away, final_cost=away,
        accuracy=False,
    ).controller()  # fmt: skip
    assert np.max(np.abs(controller(BODY.state()).command["torque"])) > 0.1
    controller.reset()
    there = BODY.state(g=np.diag([-1.0, -1.0, 1.0]))
    assert np.max(np.abs(controller(there).command["torque"])) < 1e-8


def test_a_number_of_guesses_is_a_whole_number():
    with pytest.raises(co.errors.ArgumentError, match="`guesses` must be a whole number"):
        turning(1.0).solve(guesses=0)
