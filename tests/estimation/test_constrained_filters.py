"""Filters of systems with constraints: estimates on them, and errors as large as the filter states."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2
from simulated import around, drawn, measured

import coadjoint as co
from coadjoint.estimation import Filter, Measurement, ModelProcess, smoothed
from coadjoint.estimation.process import Process
from pinned import INERTIA, MASS, PIN, RATES, pinned, start, top

H = 0.02
GYRO = Measurement(lambda motion: motion.xi[0], 0.05**2)
PLACE = Measurement(lambda motion: motion.g[1], 0.05**2)


@cache
def sleigh(error="left"):
    """Chaplygin's sleigh on a blade that does not slip, under random pushes."""
    system = co.System(
        co.SE2(),
        lambda xi: 0.5 * (0.59 * xi[0] ** 2 + xi[1:] @ xi[1:]) + 0.3 * xi[0] * xi[2],
        constraints={"blade": co.Nonholonomic(lambda: [[0, 0, 1]])},
    )
    begun = system.state(xi=[1.2, -0.5, 0])
    return ModelProcess(system, begun, error=error, noise={"torque": [0.1, 0.2, 0.3]}), begun


def filtering(process, begun, members, steps, seed=3, **more):
    """A filter after measurements of truths that its process draws, and these."""
    random = np.random.default_rng(seed)
    measurements = {"gyro": GYRO, "place": PLACE}
    filter = Filter(process, begun, measurements=measurements, deviations={"g": 0.03, "xi": 0.05}, members=members)
    truth = drawn(process, around(process, process.row(begun), filter.P[0], members, random), steps, H, random)
    seen = measured(filter, truth, H * np.arange(steps + 1), {"gyro": 1, "place": 5}, random)
    return filter.run(seen, dt=H, covariances=True, **more), truth


def test_errors_are_projected_onto_the_velocities_that_a_blade_admits():
    process, begun = sleigh()
    row = process.row(begun)[None]
    slopes = process.projector(np.zeros((1, 6)), row)[1][0]
    # On the blade μ₂ = 0.3 ξ₀ and μ₀ = 0.59 ξ₀: errors keep this ratio, and pushes along the blade's axis do nothing.
    assert slopes[5] == pytest.approx(0.3 / 0.59 * slopes[3], abs=1e-15)
    assert slopes @ slopes == pytest.approx(slopes, abs=1e-15) and np.trace(slopes) == pytest.approx(5)
    moved = process.moved(row, np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]]))
    mu = process._layout.unpack(moved[0, : process._layout.size]).mu
    assert mu[2] == pytest.approx(0.3 / 0.59 * mu[0], abs=1e-15)


def test_covariances_are_projected_from_both_sides():
    random = np.random.default_rng(4)
    S, P = random.normal(size=(2, 3, 3)), random.normal(size=(2, 3, 3))
    process = SimpleNamespace(projector=lambda e, rows: (None, S), width=3)
    found = Process.admitted(process, np.zeros((2, 5)), P)  # type: ignore[arg-type]
    np.testing.assert_allclose(found, [s @ q @ s.T for s, q in zip(S, P, strict=True)], rtol=1e-14)
    free = SimpleNamespace(projector=None)
    assert Process.admitted(free, np.zeros((2, 5)), P) is P  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.parametrize("error", ["left", "right"])
def test_the_errors_of_a_sleigh_are_those_that_its_filter_states(error):
    members = 200
    found, truth = filtering(*sleigh(error), members, 100)
    nees, degrees = found.nees(truth)
    low, high = chi2.ppf([0.005, 0.995], members * degrees) / members
    mean = nees.mean(axis=1)
    assert degrees == 5 and np.mean((low < mean) & (mean < high)) > 0.9
    for rows in (truth, found.rows):
        assert np.abs(found._process.state(rows.reshape(-1, rows.shape[-1])).xi[:, 2]).max() < 1e-15
    if error == "right":
        with pytest.raises(co.errors.ArgumentError, match="takes errors in body axes"):
            smoothed(found)
    else:
        mean = smoothed(found).nees(truth)[0].mean(axis=1)
        assert np.mean((low < mean) & (mean < high)) > 0.9


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.long
def test_a_pinned_body_and_the_top_in_minimal_coordinates_have_the_same_filter():
    """200 members of one truth: the same estimates and deviations to the error of the steps, and a NEES of 6."""
    members, h, steps, random = 200, 0.004, 200, np.random.default_rng(1)
    measurements = {"gyro": Measurement(lambda m: m.xi, 0.02**2), "down": Measurement(lambda m: m.a, 0.008**2)}
    system, free = pinned(), top()
    upright, noise = free.state(xi=RATES, a0=[0, 0, 1]), {"torque": 0.08}
    given, least = ModelProcess(system, start(system), noise=noise), ModelProcess(free, upright, noise=noise)
    reference = Filter(
        least, upright, measurements=measurements, deviations={"g": 0.02, "xi": 0.04}, members=members, accuracy=False
    )
    # (η, δμ) of the top are (η, −n × η, J W δμ, −m n × W δμ) of the body, W the inverse of the top's inertia.
    n, W = -PIN, np.linalg.inv(INERTIA + MASS * (PIN @ PIN * np.eye(3) - np.outer(PIN, PIN)))
    own = np.zeros((12, 6))
    own[:6, :3], own[6:, 3:] = np.vstack([np.eye(3), -cross(n)]), np.vstack([INERTIA @ W, -MASS * cross(n) @ W])
    P = own @ reference.P[0] @ own.T
    filter = Filter(given, start(system), measurements=measurements, covariance=P, members=members, accuracy=False)
    assert filter.P[0] == pytest.approx(P, abs=1e-15)
    truth = drawn(given, around(given, given.row(start(system)), P, members, random), steps, h, random)
    seen = measured(filter, truth, h * np.arange(steps + 1), {"gyro": 1, "down": 5}, random)
    found, other = (one.run(seen, dt=h, save_every=10, covariances=True) for one in (filter, reference))
    nees, degrees = found.nees(truth[::10])
    low, high = chi2.ppf([0.005, 0.995], members * 6) / members
    assert degrees == 6 and np.mean((low < nees.mean(axis=1)) & (nees.mean(axis=1) < high)) > 0.9
    assert found.deviations[..., :3] == pytest.approx(other.deviations[..., :3], rel=0.02)
    last, also = given.state(found.rows[-1]), least.state(other.rows[-1])
    assert np.abs(last.n + PIN).max() < 1e-15
    assert last.g == pytest.approx(also.g, abs=0.01) and last.xi == pytest.approx(also.xi, abs=0.01)
