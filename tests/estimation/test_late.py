"""Measurements that come late are taken where they belong."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import coadjoint as co
from coadjoint.estimation import Filter, Measurement, ModelProcess

H, DELAY = 0.1, 2.0


@cache
def boat():
    """A point that drifts in a plane, with a drag and white forces."""
    system = co.System(
        co.Translation(1),
        lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu,
        additional=co.Trivial(2),
        forces=lambda motion: co.Force(force=motion.inputs.push - 0.2 * motion.nu),
    )
    start = system.state(q=[0.0, 0.0], qdot=[0.5, 0.0], inputs={"push": np.zeros(2)})
    return ModelProcess(system, start, inputs={"push": np.zeros(2)}, noise={"force": 0.02}), start


def filter(memory=3.0):
    process, start = boat()
    measurements = {
        "usbl": Measurement(lambda motion: motion.q, 1.0),
        "speed": Measurement(lambda motion: motion.nu, 0.05**2),
    }
    return Filter(process, start, measurements=measurements, deviations={"q": 5.0, "nu": 0.1}, memory=memory)


@pytest.mark.cases(1)
@pytest.mark.parametrize("t", [None, 1.0])
def test_a_measurement_that_is_refused_leaves_the_filter_as_it_was(t):
    one = filter()
    for _ in range(20):
        one.predict(0.1)
    before = one.t, one.rows.copy(), one.P.copy()
    with pytest.raises(co.errors.ArgumentError, match="is 2 numbers at each time"):
        one.update({"usbl": [1.0, 2.0, 3.0]}, t=t)
    assert one.t == before[0] and np.array_equal(one.rows, before[1]) and np.array_equal(one.P, before[2])
    one.update({"usbl": [1.0, 2.0]}, t=1.0)
    assert one.t == pytest.approx(2.0)


def test_a_late_measurement_leaves_the_filter_as_if_it_had_come_in_time():
    now, late, first, told = filter(), filter(), None, None
    for k in range(1, 41):
        push = {"push": [0.1 * np.sin(0.3 * k), 0.05]} if k % 5 == 0 else None
        for one in (now, late):
            one.predict(H, push)
            one.update({"speed": [0.5, 0.01 * k]})
        if k == 10:
            first = now.update({"usbl": [1.0, 2.0]})["usbl"]
        if k == 20:
            now.update({"usbl": [1.5, -0.5]})
        if k == 38:  # the later one comes first
            late.update({"usbl": [1.5, -0.5]}, t=2.0)
            told = late.update({"usbl": [1.0, 2.0]}, t=1.0)["usbl"]
    assert late.t == pytest.approx(4.0)
    assert np.allclose(late.rows, now.rows, atol=1e-12) and np.allclose(late.P, now.P, rtol=1e-10, atol=1e-15)
    assert told and first and told.nis == pytest.approx(first.nis, rel=1e-10)


def test_a_measurement_within_a_step_splits_it():
    one = filter()
    one.predict(H)
    one.predict(H)
    one.update({"usbl": [1.0, 2.0]}, t=0.15)
    found = filter()
    found.run({"usbl": ([0.15], [[1.0, 2.0]])}, dt=H, until=0.2)
    assert one.t == pytest.approx(0.2)
    assert np.allclose(one.rows, found.rows, atol=1e-12) and np.allclose(one.P, found.P, rtol=1e-10, atol=1e-15)


@pytest.mark.long
def test_a_delay_of_two_seconds_costs_less_than_a_tenth_of_the_error():
    """Positions every two seconds, known at once or two seconds later, over ten minutes."""
    process, start = boat()
    random, steps = np.random.default_rng(11), 3000
    row, truth = process.row(start)[None], []
    pi = [process.names.index(name) for name in ("pi[0]", "pi[1]")]
    for _ in range(steps):
        e = np.zeros((1, process.width))
        e[0, pi] = 0.02 * np.sqrt(H) * random.normal(size=2)
        row = process.moved(process.advanced(row, H), e)
        truth.append(row[0])
    states = process.state(np.array(truth))
    fixes = states.n + random.normal(size=(steps, 2))
    speeds = states.nu * 0 + states.pi + 0.05 * random.normal(size=(steps, 2))
    errors = {}
    for delay in (0.0, DELAY):
        one, places, behind = filter(), [], round(delay / H)
        for k in range(steps):
            one.predict(H)
            if k % 5 == 0:
                one.update({"speed": speeds[k]})
            if k >= behind and (k - behind) % 20 == 0:
                one.update({"usbl": fixes[k - behind]}, t=one.t - delay)
            places.append(one.state.n)
        errors[delay] = np.sqrt(np.mean((np.array(places) - states.n)[300:] ** 2))
    assert 0.05 < errors[0.0] < 1.0
    assert errors[DELAY] < 1.1 * errors[0.0]


def test_what_is_too_late_is_told():
    one = filter(memory=0.5)
    for _ in range(10):
        one.predict(H)
    with pytest.raises(co.errors.ArgumentError, match=r"remembers its steps from 0.5 s on; `memory`"):
        one.update({"usbl": [0.0, 0.0]}, t=0.2)
    with pytest.raises(co.errors.ArgumentError, match="is later than the filter, which is at 1 s: predict"):
        one.update({"usbl": [0.0, 0.0]}, t=2.0)
    with pytest.raises(co.errors.ArgumentError, match="The filter has no measurement `gps`"):
        one.update({"gps": [0.0, 0.0]}, t=0.8)
    with pytest.raises(co.errors.ArgumentError, match="`memory` must be a finite number from 0, but is"):
        filter(memory=-1.0)


def test_angles_go_the_shorter_way():
    process, start = boat()
    angle = Measurement(lambda motion: np.pi - 0.1 + 0 * motion.q[:1], 0.01, space=co.SO2())
    one = Filter(process, start, measurements={"heading": angle}, deviations={"q": 1.0})
    assert one.update({"heading": -np.pi + 0.1})["heading"].nis == pytest.approx(0.2**2 / 0.01)


def test_a_late_time_may_be_a_whole_number_of_numpy():
    whole, real = filter(), filter()
    for one, t in ((whole, np.int64(1)), (real, 1.0)):
        for _ in range(20):
            one.predict(H)
        one.update({"usbl": [1.0, 2.0]}, t=t)
    assert np.array_equal(whole.rows, real.rows)
