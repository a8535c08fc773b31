"""Problems and estimators whose measurements live on groups, and losses that outliers do not dominate."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.control import Measured, Problem

pytest.importorskip("casadi")
H, STEPS, S = 0.1, 8, 0.02


@cache
def body():
    return co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi))


@cache
def log() -> tuple[Any, np.ndarray]:
    """The motion at a pitch of 88°, and quaternions of either sign, x, y, z, w, one of which is absent."""
    start = body().state(g=co.attitude.zyx(0.3, np.radians(88), 0.1), xi=[0.2, 0.1, -0.3])
    run = co.simulate(body(), start, dt=H, steps=STEPS, monitors=False)
    e = S * np.random.default_rng(2).normal(size=(STEPS + 1, 3))
    y = co.attitude.to_quaternion(np.asarray(run.records.g) @ co.attitude.from_rotation_vector(e))
    y = np.roll(y, -1, axis=1) * np.where(np.arange(STEPS + 1) % 2, 1.0, -1.0)[:, None]
    y[3, 1] = np.nan
    return run, y


def problem(y: np.ndarray | None, **given: Any) -> Problem:
    attitude = Measured(lambda m: m.g, y, S, space=co.SO3(), coordinates="xyzw", **given)
    free = {"g": 0.3, "xi": 0.3}
    far = body().state(g=co.attitude.zyx(0.4, np.radians(85), 0.1), xi=[0.1, 0.1, -0.2])
    return Problem(
        body(), far, dt=H, steps=STEPS, cost=lambda m: 0.0 * m.xi @ m.xi, free_start=free, measured={"y": attitude}
    )


def off(found: Any, k: int) -> float:
    turn = np.asarray(log()[0].records.g)[k].T @ np.asarray(found)
    return float(np.linalg.norm(co.attitude.rotation_vector(turn)))


def test_quaternions_of_either_sign_lead_to_an_attitude_near_the_pole():
    found = problem(log()[1]).solve()
    left = found.residuals["y"]
    assert left.shape == (STEPS + 1, 3) and np.all(np.isnan(left[3])) and np.sum(np.isnan(left)) == 3
    assert off(found.run.records.g[-1], STEPS) < 2 * S and np.nanmax(np.abs(left)) < 3.5


@pytest.mark.parametrize("loss", [co.losses.Huber(), pytest.param(co.losses.Student(4), marks=pytest.mark.long)])
def test_a_wild_attitude_hardly_moves_an_estimate_with_a_robust_loss(loss: co.losses.Loss):
    y = log()[1].copy()
    y[5] = [1.0, 0.0, 0.0, 0.0]
    plain, robust = (off(problem(y, **more).solve().run.records.g[5], 5) for more in ({}, {"loss": loss}))
    assert robust < 2.5 * S < plain


@pytest.mark.long
def test_an_estimator_reads_attitudes_on_their_group_and_weighs_a_wild_one():
    y = log()[1].copy()
    ends = []
    for loss in (None, co.losses.Student(4)):
        estimator = problem(None, loss=loss).estimator(horizon=0.5, iterations=4)
        y[6] = [1.0, 0.0, 0.0, 0.0]
        estimates = [estimator({"y": one}, inputs={}) for one in y]
        ends.append(off(estimates[-1].state.g, STEPS))
    assert ends[1] < 3 * S < ends[0]


def test_the_weight_of_what_was_measured_is_one_over_its_deviation_and_of_gaps_zero():
    vectors = Measured(lambda m: m.xi, [[1.0, np.nan], [2.0, 3.0]], [0.5, 0.25])
    values, weight = vectors.seen(vectors.space_of(np.zeros(2), "y"), vectors.values, "y")
    np.testing.assert_array_equal(weight, [[2.0, 2.0], [0.0, 4.0]])
    assert values[0].tolist() == [1.0, 2.0] and values[1, 1] == 3.0 and np.isfinite(values[1, 0])
    attitude = Measured(lambda m: m.g, [[0, 0, 0, 1], [np.nan, 0, 0, 1]], S, space=co.SO3(), coordinates="xyzw")
    _, weight = attitude.seen(attitude.space_of(np.eye(3), "y"), attitude.values, "y")
    np.testing.assert_array_equal(weight, [[1 / S, 0.0]] * 3)


@pytest.mark.parametrize(
    ("count", "times", "says"),
    [
        (4, None, "has 4 values, but there are 9 nodes"),
        (2, [0.1], r"has 2 values, but times of the shape \(1,\)"),
        (2, [0.1, 0.11], "has two values at one node"),
        (2, [0.1, 0.9], "was measured outside of the motion from 0 to 0.8 s"),
        (2, [-0.1, 0.1], "was measured outside of the motion from 0 to 0.8 s"),
        (3, [0.1, 0.23, 0.4], "was measured at 0.23 s, between two nodes"),
    ],
)
def test_times_that_are_no_nodes_are_told(count, times, says):
    with pytest.raises(co.errors.ArgumentError, match=says):
        Measured(lambda m: m.xi, np.zeros(count), S, times=times).nodes("y", 0.0, 0.1, 8)
    assert Measured(lambda m: m.xi, [1.0, 2.0], S, times=[0.0, 0.8]).nodes("y", 0.0, 0.1, 8).tolist() == [0, 8]


def test_values_that_do_not_fit_their_space_raise_one_sentence():
    y = log()[1]
    for given, says in (
        (
            {"values": y[:, :3]},
            r"values of the shape \(3,\), but on SO3.., by a unit .* they are 4",
        ),
        ({"values": 2 * y}, "must be on SO3.., by a unit .*: number 1 of 9, .* is off it by 1"),
        ({"deviation": [S] * 4}, r"deviation of the shape \(4,\), but its errors are \(3,\): give one number, or one"),
        ({"error_side": "left"}, '`error_side` of `y` must be "body" or "space"'),
    ):
        usual: dict[str, Any] = {
            "function": lambda m: m.g,
            "values": y,
            "deviation": S,
            "space": co.SO3(),
            "coordinates": "xyzw",
        }
        one, start = Measured(**{**usual, **given}), body().state(xi=[0.1, 0.0, 0.0])
        more: Any = {"cost": lambda m: 0.0 * m.xi @ m.xi, "free_start": {"g": math.inf}, "measured": {"y": one}}
        with pytest.raises(co.errors.ArgumentError, match=says):
            Problem(body(), start, dt=H, steps=STEPS, **more).solve()


@pytest.mark.parametrize("deviation", [0.0, -1.0, [1.0, 0.0], [np.inf, 1.0]])
def test_every_deviation_of_a_measurement_is_positive_and_finite(deviation):
    with pytest.raises(co.errors.ArgumentError, match=r"`deviation` of co\.control\.Measured must be"):
        Measured(lambda motion: motion.xi, np.zeros((3, 2)), deviation)
