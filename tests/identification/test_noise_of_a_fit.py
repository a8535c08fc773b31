"""The noise that a fit leaves, with the degrees of freedom that it took up."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats

from coadjoint.identification.diagnostics import unsettled
from coadjoint.identification.fitting import _estimated
from coadjoint.identification.least_squares import Solution
from coadjoint.identification.misfit import FEWEST, Feature, _correlated
from coadjoint.identification.result import _estimates
from coadjoint.losses import Student

RUNS, SAMPLES, CHANNELS, OWN, SHARED = 2, 5, 2, 2, 3


def design(J):
    """All columns of all runs: each run's own, then those that they share."""
    rows = J.shape[1]
    X = np.zeros((RUNS * rows, RUNS * OWN + SHARED))
    for run in range(RUNS):
        X[run * rows : (run + 1) * rows, run * OWN : (run + 1) * OWN] = J[run, :, :OWN]
        X[run * rows : (run + 1) * rows, RUNS * OWN :] = J[run, :, OWN:]
    return X


@pytest.mark.parametrize("missing", [0, 3])
def test_the_noise_is_over_the_numbers_that_the_fit_left(missing):
    random = np.random.default_rng(7)
    J = random.normal(size=(RUNS, SAMPLES * CHANNELS, OWN + SHARED))
    there = np.ones((RUNS, SAMPLES, CHANNELS), bool)
    there[0, :missing, 0] = False
    J *= there.reshape(RUNS, -1, 1)
    X = design(J)
    hat = X @ np.linalg.pinv(X)
    noise = random.normal(size=len(X)) * there.ravel()
    residual = noise - hat @ noise
    problem = SimpleNamespace(there=there, sigma=np.array([1.0, 2.0]), values=np.zeros(there.shape))
    solution = cast(Any, SimpleNamespace(jacobian=J, residual=residual.reshape(RUNS, -1)))
    left = np.where(there, 1 - np.diag(hat).reshape(there.shape), 0.0).sum(axis=(0, 1))
    expected = problem.sigma * np.sqrt((residual.reshape(there.shape) ** 2).sum(axis=(0, 1)) / left)
    np.testing.assert_allclose(_estimated(solution, cast(Any, problem), OWN), expected, rtol=1e-9)
    weights = random.uniform(0.2, 1.0, size=there.shape)
    robust = _estimated(solution, cast(Any, SimpleNamespace(**vars(problem), weights=weights)), OWN, Student(4.0))
    np.testing.assert_allclose(robust, expected, rtol=1e-9)  # Σ w d² with d² = r²/w
    # All numbers less all columns: 20 of them less 7.
    assert left.sum() == pytest.approx(RUNS * SAMPLES * CHANNELS - missing - RUNS * OWN - SHARED)
    assert "jacobian" in Solution._fields


@pytest.mark.parametrize("level", [0.5, 0.95, 0.99])
@pytest.mark.parametrize("samples", [4, 10_000])
def test_an_interval_has_the_width_that_its_level_asks_for(level, samples):
    """Of so many numbers with normal noise, by Student's t: 95 % are ±1.96 standard errors where there are many."""
    each = [
        SimpleNamespace(
            label=name, value=float, slope=lambda x: 1.0, prior=0.0, interval=lambda x, half: (x - half, x + half)
        )
        for name in "ab"
    ]
    shooting = SimpleNamespace(size=1, runs=1)
    fit = SimpleNamespace(shooting=shooting, each=each, there=np.ones((1, samples, 2), bool))
    found = SimpleNamespace(fit=fit, solution=SimpleNamespace(place=SimpleNamespace(shared=np.array([1.0, -2.0]))))
    errors = np.array([0.1, 0.7])
    estimates = _estimates(cast(Any, found), cast(Any, SimpleNamespace(error=errors)), level)
    freedom = 2 * samples - 1 - 2
    for name, x, error in zip("ab", (1.0, -2.0), errors, strict=True):
        low, high = estimates[name].low, estimates[name].high
        assert (low + high) / 2 == pytest.approx(x)
        inside = stats.t.cdf((high - x) / error, freedom) - stats.t.cdf((low - x) / error, freedom)
        assert inside == pytest.approx(level, rel=1e-9)
        if (level, samples) == (0.95, 10_000):
            assert (high - x) / error == pytest.approx(1.96, abs=1e-3)


def test_parts_of_the_noise_that_still_changed_are_counted_and_the_worst_is_named():
    assert unsettled({}) == []
    (one,) = unsettled({"noise of `u`": 0.25})
    assert "rounds of least squares the noise of `u` still changed, by 25% in the last" in one
    (two,) = unsettled({"noise of `u`": 0.25, "noise of `v`": 0.5})
    assert "the noise of `v`, and 1 more number of its kind still changed, by 50%" in two
    (three,) = unsettled({"a": 0.1, "b": 0.5, "c": 0.2})
    assert "the b, and 2 more numbers of its kind" in three


def test_an_innovation_correlates_with_what_moves_and_with_nothing_that_rests_or_is_seldom_there():
    random, count = np.random.default_rng(6), 40 * FEWEST
    values, there = random.normal(size=(count, 1)), np.ones(count, bool)
    w = 2.0 * values[:, 0] + 0.1 * random.normal(size=count)

    def feature(values: np.ndarray) -> Feature:
        return Feature("rudder", "δ", 0.0, values)

    found, score = _correlated("v", w, there, feature(values))
    assert found.column == "v" and found.input == "rudder" and score > 0.9 * count
    for given, where in ((np.ones((count, 1)), there), (values, np.arange(count) < FEWEST - 1)):
        assert _correlated("v", w, where, feature(given))[1] == 0.0
    gaps = np.where(np.arange(count)[:, None] % 2 == 0, values, np.nan)
    assert _correlated("v", w, there, feature(gaps))[1] > 0.4 * count
    slow, other = np.cumsum(random.normal(size=(2, count)), axis=1) / np.arange(9, 9 + count)
    for one, both in ((w, values[:, 0]), (slow, other), (1.0 * there + w * (-1.0) ** np.arange(count), other)):
        a, b = one - one.mean(), both - both.mean()
        follows = np.clip(a[1:] @ a[:-1] / (a @ a), 0.0, 0.95)
        a, b = a[1:] - follows * a[:-1], b[1:] - follows * b[:-1]
        found, total = _correlated("v", one, there, feature(both[:, None]))
        assert found.correlation == pytest.approx(a @ b / np.sqrt(a @ a * (b @ b)), rel=1e-9)
        assert total == pytest.approx(count * found.correlation**2)
