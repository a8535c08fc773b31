"""Differences of a fit and their derivatives with attitudes as rotations, delays, coloured noise and process noise."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from coadjoint.identification import fit as fits
from coadjoint.identification import fitting, process_noise_estimate, rotations
from coadjoint.identification.coloured import Neighbours
from coadjoint.identification.fit import Fit
from coadjoint.identification.log import Log
from coadjoint.identification.process_noise import Knots, Wander
from coadjoint.identification.sensor_model import Sensing

NAMES = ("u", "roll", "pitch", "heading")
TIME = np.array([0.0, 0.5, 1.0])
MEASURED = {
    "u": np.array([1.0, 2.0, 3.0]), "roll": np.array([0.1, 0.2, np.nan]), "pitch": np.array([0.3, -0.4, 0.1]),
    "heading": np.array([3.0, -3.1, 0.2]),
}  # fmt: skip
KNOTS = Knots(("a", "b"), np.array([4, 5]), np.array([0, 1]), 0.5, 3)
WANDER = Wander(np.array([0.7, 3.0]), np.array([0.3, 5.0]))


def made(biased=(0, 2), delayed=(("compass", (1, 2, 3)),), knots=None, held=False, settle=0.0, **more: Any) -> Fit:
    """A fit of one segment with one number of its start, and knots if there are any, and one parameter."""
    units = {"u": "m/s"} | dict.fromkeys(NAMES[1:], "rad")
    sensing = Sensing(NAMES, biased, delayed, rotation=True)
    asked = SimpleNamespace(log=Log(TIME, MEASURED, {}, units), sensing=sensing, settle=settle, simulated=lambda: None)
    size = 1
    samples = SimpleNamespace(rows=np.arange(3)[None], early=np.zeros((1, 3), bool), turning=[1, 2, 3], h=0.25)
    shooting = SimpleNamespace(
        samples=samples, channels=SimpleNamespace(names=NAMES), size=size, runs=1, knots=knots,
        own=size + (0 if knots is None else knots.size), unknowns=SimpleNamespace(each=("p",)), **more,
    )  # fmt: skip
    return Fit(cast(Any, shooting), cast(Any, asked), np.ones(4), held)


R = Rotation.from_euler("ZYX", [[2.9, 0.2, 0.2], [-3.0, -0.3, 0.1], [0.1, 0.2, 0.3]])
VALUES = np.concatenate([np.arange(12.0).reshape(3, 4), R.as_matrix().reshape(3, 9)], axis=1)[None]
SHARED = np.array([9.0, 0.25, 0.1, 0.02])
"""The parameter, the biases of u and pitch, and the delay of the compass."""


def predicted(values=VALUES) -> Any:
    return SimpleNamespace(values=values)


def test_attitudes_differ_by_a_rotation_with_their_bias_and_are_left_out_together():
    off = made().differences(predicted(), SHARED)
    np.testing.assert_allclose(off[0, :, 0], VALUES[0, :, 0] + 0.25 - MEASURED["u"])
    measured = Rotation.from_euler("ZYX", np.stack([MEASURED[name] for name in NAMES[:0:-1]], axis=1)[:2])
    expected = (measured.inv() * R[:2] * Rotation.from_rotvec([0.0, 0.1, 0.0])).as_rotvec()
    np.testing.assert_allclose(off[0, :2, 1:], expected, atol=1e-14)
    assert not off[0, 2, 1:].any()
    assert made(settle=0.5).there[0, :, 0].tolist() == [False, True, True]


def test_a_delay_of_the_attitude_is_that_of_its_matrix():
    asked: list[Any] = []
    fit = made(predict=lambda *given: asked.append(given) or "found")
    fit.internal = "kept"
    assert fit.predict(cast(Any, SimpleNamespace(shared=SHARED, own="own"))) == "found"
    parameters, own, internal, delays = asked[0]
    assert (parameters.tolist(), own, internal) == ([9.0], "own", "kept")
    assert delays.tolist() == [0.0, 0.02, 0.02, 0.02] + [0.02] * 9


@pytest.mark.parametrize("held", [False, True])
def test_derivatives_of_differences_are_their_difference_quotients(held):
    """By the start, the parameter, both biases and the delay, whose change is −dy/dt."""
    random, eps = np.random.default_rng(2), 1e-6
    turns = random.normal(size=(3, 3))  # of the start, of the parameter, and in time
    along = np.zeros((1, 3, 3, 13))
    along[..., :4] = random.normal(size=(1, 3, 3, 4))
    for column, omega in enumerate(turns):
        along[0, :, column, 4:] = (R.as_matrix() @ rotations.hat(omega)).reshape(3, 9)
    fit = made(slopes=lambda parameters, way: along[:, :, :2], speeds=lambda way: along[:, :, 2], held=held)
    found = fit.slopes(cast(Any, SimpleNamespace(shared=SHARED)), predicted())

    def quotient(values=0.0, shared=0.0):
        ends = [fit.differences(predicted(VALUES + s * eps * values), SHARED + s * eps * shared) for s in (1, -1)]
        return (ends[0] - ends[1]) / (2 * eps)

    expected = [quotient(along[:, :, 0]), quotient(along[:, :, 1])]
    by_sensors = [quotient(shared=np.eye(4)[1]), quotient(shared=np.eye(4)[2])]
    late = -along[:, :, 2]
    late[..., 0] = 0.0
    by_sensors.append(quotient(late))
    expected += [0 * one for one in by_sensors] if held else by_sensors
    np.testing.assert_allclose(found, np.stack(expected, axis=2), atol=1e-7)


def test_knots_are_driven_by_their_roots_in_residual_and_jacobian():
    fit, random = made(knots=KNOTS), np.random.default_rng(3)
    fit.wander = WANDER
    own = random.normal(size=(1, 1 + KNOTS.size))
    expected = KNOTS.spread(KNOTS.roots(WANDER)) @ own[0, 1:]
    np.testing.assert_allclose(fit._driving(own)[0], expected)
    slopes = random.normal(size=(1, 3, 9, 4))
    fit.slopes = lambda place, way: slopes  # type: ignore[method-assign]
    fit.weights[0, 1] = 4.0
    fit.sigma = np.array([1.0, 2.0, 4.0, 5.0])
    J = fit.jacobian(cast(Any, None), cast(Any, None))
    weighted = slopes / fit.sigma
    weighted[0, 1] *= 2.0
    np.testing.assert_allclose(J[0, :12], weighted[0].swapaxes(1, 2).reshape(12, 9))
    assert J.shape == (1, 12 + KNOTS.size, 9)
    np.testing.assert_allclose(J[0, 12:, 1 : 1 + KNOTS.size] @ own[0, 1:], expected)
    assert not J[0, 12:, 0].any() and not J[0, 12:, 1 + KNOTS.size :].any()
    fit.wander = None
    assert fit.jacobian(cast(Any, None), cast(Any, None)).shape == (1, 12, 9)


def test_the_strength_of_process_noise_changes_by_the_logarithm_of_its_roots(monkeypatch):
    fit, asked = made(knots=KNOTS), list[Any]()
    monkeypatch.setattr(fits, "likeliest", lambda *given: asked.append(given) or WANDER)
    fit.normal_equations = lambda place: place  # type: ignore[method-assign]
    assert fit.find_process_noise(cast(Any, None)) == 0.0 and fit.wander is None
    assert fit.find_process_noise(cast(Any, "given")) == np.inf and asked == [("given", KNOTS, 4.0, None)]
    doubled = Wander(WANDER.deviation * [2.0, 1.25], WANDER.time)
    monkeypatch.setattr(fits, "likeliest", lambda *given: doubled)
    assert fit.find_process_noise(cast(Any, "given")) == pytest.approx(np.log(2.0)) and fit.wander is doubled
    assert made().find_process_noise(cast(Any, "given")) == 0.0 and fit.longest_time == 4.0


def test_finer_steps_keep_what_a_fit_knows():
    fit = made(knots=KNOTS)
    fit.asked.shooting = lambda *given: asked.append(given) or fit.shooting  # type: ignore[method-assign]
    asked: list[Any] = []
    fit.internal, fit.wander, fit.times = "internal", WANDER, np.ones(4)
    assert fit.finer(20.0, 1) is fit and asked == []
    found = fit.finer(20.0, 2)
    assert asked == [(0.125, 20.0, KNOTS)] and found is not fit
    assert (found.internal, found.wander, found.times is fit.times) == ("internal", WANDER, True)
    assert found.weights is fit.weights and found.sigma is fit.sigma


def test_correlation_times_are_sought_with_the_information_of_the_other_channels(monkeypatch):
    random = np.random.default_rng(5)
    slopes, off = random.normal(size=(2, 3, 5, 2)), random.normal(size=(2, 3, 2))
    rows = random.normal(size=(2, 6 + 4, 5))
    near = Neighbours(np.arange(12).reshape(2, 3, 2), np.ones((2, 3, 2)))
    fit: Any = SimpleNamespace(
        times=np.array([0.0, 7.0]), sensing=SimpleNamespace(coloured=(1,)), predict=lambda place: "found", own=3,
        differences=lambda found, shared: off, slopes=lambda place, found: slopes, sigma=np.array([2.0, 4.0]),
        near=near, jacobian=lambda place, found: rows, log=SimpleNamespace(interval=0.1, duration=30.0), there="there",
        shooting=SimpleNamespace(runs=2),
    )  # fmt: skip
    asked: list[Any] = []
    monkeypatch.setattr(fitting, "whitened", lambda given, near, times: given)
    monkeypatch.setattr(fitting, "freedom", lambda J, there, d: asked.append((J, there, d)) or np.array([9.0, 0.5]))
    monkeypatch.setattr(fitting, "correlation_time", lambda *given: asked.append(given) or 2.5)
    place: Any = SimpleNamespace(shared=None)
    assert fitting._correlation_times(fit, place).tolist() == [0.0, 2.5] and fit.times.tolist() == [0.0, 7.0]
    (J, there, d), (channel, information, of_start, shortest, longest) = asked
    parts = slopes / fit.sigma
    np.testing.assert_allclose(J, np.concatenate([parts.swapaxes(2, 3).reshape(2, 6, 5), rows[:, 6:]], axis=1))
    assert (there, d, of_start, channel.freedom) == ("there", 3, 3, 1.0)
    expected = [parts[s, :, :, 0].T @ parts[s, :, :, 0] + rows[s, 6:].T @ rows[s, 6:] for s in range(2)]
    np.testing.assert_allclose(information, expected)
    np.testing.assert_array_equal(channel.off, off[..., 1])
    np.testing.assert_array_equal(channel.slopes, slopes[..., 1])
    np.testing.assert_array_equal(channel.near.before, near.before[..., 1])
    assert (shortest, longest) == (fitting.SHORTEST * 0.1, fitting.LONGEST * 15.0)
    fit.sensing.coloured = ()
    assert fitting._correlation_times(fit, place).tolist() == [0.0, 7.0]


def test_what_wandered_is_read_at_the_times_of_the_log_with_log_normal_intervals(monkeypatch):
    """Two segments of two samples, the second of which has no second one; knots 0.5 s apart, steps of 0.25 s."""
    rows = np.array([[0, 1], [3, -1]])
    samples = SimpleNamespace(rows=rows, steps_away=np.array([[0, 2], [4, 9]]), h=0.25)
    variances = np.arange(1.0, 13.0).reshape(2, 6) ** 2
    covariance = np.stack([np.diag(one) for one in variances])
    monkeypatch.setattr(process_noise_estimate, "posterior", lambda *given: SimpleNamespace(covariance=covariance))
    monkeypatch.setattr(process_noise_estimate, "_units", lambda system, knots: ["N", ""])
    errors = Wander(np.array([0.1, 0.2]), np.array([0.3, 0.4]))
    monkeypatch.setattr(process_noise_estimate, "wander_errors", lambda *given: errors)
    shooting = SimpleNamespace(knots=KNOTS, samples=samples, size=2, unknowns=SimpleNamespace(system=None))
    fit: Any = SimpleNamespace(
        shooting=shooting, wander=WANDER, longest_time=99.0, log=np.zeros(5), normal_equations=lambda place: "given"
    )
    own = np.concatenate([np.full((2, 2), -1.0), np.arange(12.0).reshape(2, 6)], axis=1)
    found = process_noise_estimate.wandered(fit, cast(Any, SimpleNamespace(own=own)), 0.9)
    a, b = found["a"], found["b"]
    np.testing.assert_array_equal(a.values, [0.0, 2.0, np.nan, 10.0, np.nan])
    np.testing.assert_array_equal(b.values, [1.0, 3.0, np.nan, 11.0, np.nan])
    np.testing.assert_array_equal(a.errors, [1.0, 3.0, np.nan, 11.0, np.nan])
    half = stats.norm.ppf(0.95)
    assert (b.deviation, b.correlation_time, a.unit, b.unit) == (3.0, 5.0, "N", "")
    assert b.deviation_interval == pytest.approx((3.0 * np.exp(-0.2 * half), 3.0 * np.exp(0.2 * half)))
    assert b.correlation_time_interval == pytest.approx((5.0 * np.exp(-0.4 * half), 5.0 * np.exp(0.4 * half)))
    fit.wander = None
    assert process_noise_estimate.wandered(fit, cast(Any, SimpleNamespace(own=own)), 0.9) == {}
