"""A filter whose steps do not resolve the motion says so: by their local error, or by the deviations that it claims."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import coadjoint as co
from coadjoint.estimation import Filter, Measurement, ModelProcess

RATE, SECONDS = 8.0, 3.0
BODY = co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi))
START = BODY.state(xi=[0.0, 0.0, RATE])
PROCESS = ModelProcess(BODY, START, noise={"torque": 1e-4})


def made(**more):
    rate = {"rate": Measurement(lambda motion: motion.xi, 0.001**2)}
    return Filter(PROCESS, START, measurements=rate, deviations={"g": 1e-3, "xi": 1e-3}, **more)


def followed(dt, **more):
    """A steady spin about the largest moment, R = exp(t ω): the error in deviations, and what was warned of."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        filter = made(**more)
        for _ in range(round(SECONDS / dt)):
            filter.predict(dt)
            filter.update({"rate": [0.0, 0.0, RATE]})
    R = np.asarray(co.attitude.zyx(RATE * SECONDS, 0.0, 0.0))
    error = np.arccos(np.clip((np.trace(R.T @ np.asarray(filter.state.g)) - 1) / 2, -1, 1))
    return error / filter.deviations["g[2]"], [str(one.message) for one in said]


@pytest.mark.parametrize("dt", [*(pytest.param(dt, marks=pytest.mark.long) for dt in (0.01, 0.05, 0.1)), 0.3])
def test_predictions_that_leave_the_claimed_deviations_warn_once_with_a_dt_that_would_do(dt):
    error, said = followed(dt)
    assert error > 3 and len(said) == 1 and f"dt = {dt:g} does not resolve this motion" in said[0]
    assert followed(dt, accuracy=False)[1] == []


@pytest.mark.long
def test_the_dt_that_is_proposed_keeps_the_claim():
    _, said = followed(0.05)
    proposed = float(said[0].split("Take dt = ")[1].split(" or less")[0])
    error, said = followed(SECONDS / np.ceil(SECONDS / proposed))
    assert error < 2 and said == []


@pytest.mark.parametrize(("dt", "count"), [(0.3, 1), (0.05, 1), (0.001, 0)])
def test_a_log_is_judged(dt, count):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        t = np.arange(0.1, 1.0, 0.1)
        made(members=3).run({"rate": (t, np.tile([0.0, 0.0, RATE], (len(t), 1)))}, dt=dt, until=1.0, save_every=2)
    assert len(said) == count


@pytest.mark.long
def test_a_measured_attitude_takes_the_error_of_the_steps_away():
    """Measured ten times as closely as the steps of 0.01 s are off, the attitude claims no more than it keeps."""
    see = {"R": Measurement(lambda motion: motion.g.ravel(), 0.02**2)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        process = ModelProcess(BODY, START, noise={"torque": 0.3})
        filter = Filter(process, START, measurements=see, deviations={"g": 1e-2, "xi": 1e-2})
        for k in range(1, 200):
            filter.predict(0.01)
            filter.update({"R": np.asarray(co.attitude.zyx(RATE * 0.01 * k, 0.0, 0.0)).ravel()})


def test_what_is_known_exactly_claims_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        filter = Filter(ModelProcess(BODY, START), START, measurements={}, deviations={})
        for _ in range(5):
            filter.predict(0.01)
    row = filter.process.row(filter.state)[None]
    assert np.array_equal(filter.process.parts.probe(row, np.array([0.01]))[0], filter.process.advanced(row, 0.01))
