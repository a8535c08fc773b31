"""Noise that follows itself: intervals hold the truth where the noise of sensors is a Gauss–Markov process."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import signal, stats
from tests.identification.test_sensor_model import NEAR, SOUGHT, STATE, SYSTEM, TRUE
from tests.torpedo import NOISE, zigzags

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.identification import Log, identify, synthetic_log
from coadjoint.identification.coloured import Channel, Neighbours, correlation_time, neighbours, whitened


def markov(random, size, sigma, interval, tau):
    """A Gauss–Markov process of the first order, stationary."""
    a = np.exp(-interval / tau)
    driven = sigma * np.sqrt(1 - a**2) * random.normal(size=size)
    driven[0] = sigma * random.normal()
    return signal.lfilter([1.0], [1.0, -a], driven)


@pytest.fixture(scope="module")
def exact():
    t, inputs = zigzags(60.0)
    signals = {name: co.Held(t, values) for name, values in inputs.items()}
    run = co.simulate(SYSTEM, STATE, dt=0.05, duration=59.9, inputs=signals, save_every=2, monitors=False)
    return synthetic_log(run)


def noisy(exact, seed, tau=0.6, sigma=1.0, lost=0.1):
    """A log whose velocities and rates have coloured noise, and a tenth of whose values are missing."""
    random = np.random.default_rng(seed)
    columns = {}
    for name, values in exact.columns.items():
        size = sigma * NOISE[name]
        coloured = name in ("u", "v", "w", "p", "q", "r")
        noise = markov(random, len(values), size, 0.1, tau) if coloured else size * random.normal(size=len(values))
        columns[name] = np.where(random.random(len(values)) < lost, np.nan, values + noise)
    return Log(exact.time, columns, exact.inputs, exact.units, step=exact.step)


def test_prediction_errors_of_a_markov_process_are_white_whatever_is_missing():
    """Cov w = σ² 1: with the matrix of the process, W Σ Wᵀ."""
    random = np.random.default_rng(2)
    time = np.cumsum(random.uniform(0.05, 0.5, 40))[None]
    there = random.random((1, 40, 1)) > 0.3
    near, times = neighbours(time, there), np.array([0.7])
    W = np.stack([whitened(np.where(there, row[None, :, None], 0.0), near, times)[0, :, 0] for row in np.eye(40)], 1)
    covariance = np.exp(-np.abs(time[0][:, None] - time[0]) / 0.7)
    np.testing.assert_allclose(W @ covariance @ W.T, np.diag(there[0, :, 0].astype(float)), atol=1e-12)


def test_a_correlation_time_is_that_of_the_process_though_a_fit_took_up_much_of_it():
    """Of twenty segments of 10 s with a polynomial of three numbers fitted to each, as starts are."""
    random, found = np.random.default_rng(0), []
    slopes = np.zeros((20, 100, 4))
    time = np.tile(np.arange(100) * 0.1, (20, 1))
    near = neighbours(time, np.ones((20, 100, 1), bool))
    alone = Neighbours(near.before[..., 0], near.between[..., 0])
    powers = np.polynomial.legendre.legvander(np.linspace(-1, 1, 100), 2)
    for _ in range(12):
        e = np.stack([markov(random, 100, 0.3, 0.1, 1.0) for _ in range(20)])
        left = e - e @ np.linalg.pinv(powers).T @ powers.T
        slopes[..., :3] = powers
        slopes[..., 3] = np.linspace(-1, 1, 100) ** 5
        one = Channel(left, slopes, alone, 20 * 97 - 1.0)
        found.append(correlation_time(one, np.tile(1e-9 * np.eye(4), (20, 1, 1)), 3, 0.02, 20.0))
    assert abs(np.mean(found) - 1.0) < 0.12
    white = Channel(random.normal(size=(20, 100)), slopes, alone, 1999.0)
    assert correlation_time(white, np.tile(1e-9 * np.eye(4), (20, 1, 1)), 3, 0.02, 20.0) < 0.06


@pytest.mark.long
@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(40), marks=pytest.mark.long)])
def test_intervals_hold_the_truth_with_coloured_noise(exact, seeds):
    """Misses are binomial, 5 % of the intervals, where the noise is told to be coloured; else they are many more."""
    scores = []
    log = found = None
    for seed in seeds:
        log = noisy(exact, seed)
        found = identify(NEAR, log, start=STATE, parameters=SOUGHT, coloured=["velocity", "rates"])
        scores.append([(found[name].value - value) / found[name].standard_error for name, value in TRUE.items()])
        for name in ("u", "v", "w", "p", "q", "r"):
            assert found.noise[name] == pytest.approx(NOISE[name], rel=0.4)
            assert found.correlation_times[name] == pytest.approx(0.6, rel=0.6), name
        assert max(abs(value) for value in found.whiteness.values()) < 0.2
        assert not any("are correlated" in warning for warning in found.warnings)
    assert np.sum(np.abs(scores) > 1.96) <= stats.binom.ppf(1 - 1 / 2000, np.size(scores), 0.05)
    assert log is not None and found is not None
    white = identify(NEAR, log, start=STATE, parameters=SOUGHT)
    assert any("are correlated" in warning for warning in white.warnings)
    for name in SOUGHT:
        assert white[name].standard_error < 0.85 * found[name].standard_error
    assert "over 0." in str(found)


@pytest.mark.long
def test_white_noise_is_found_to_be_white(exact):
    random = np.random.default_rng(3)
    columns = {name: values + NOISE[name] * random.normal(size=len(values)) for name, values in exact.columns.items()}
    log = replace(exact, columns=columns)
    found: Any = identify(NEAR, log, start=STATE, parameters=SOUGHT, coloured=["u", "r"])
    plain = identify(NEAR, log, start=STATE, parameters=SOUGHT)
    assert max(found.correlation_times.values()) < 0.06
    for name in SOUGHT:
        assert found[name].value == pytest.approx(plain[name].value, abs=0.2 * plain[name].standard_error)


def test_columns_of_coloured_noise_must_be_in_the_log(exact):
    with pytest.raises(ArgumentError, match="`coloured` names `speed`, which the log does not hold"):
        identify(NEAR, exact, start=STATE, parameters=SOUGHT, coloured=["speed"])
    with pytest.raises(ArgumentError, match="`coloured` must be a list of names"):
        identify(NEAR, exact, start=STATE, parameters=SOUGHT, coloured="u")
