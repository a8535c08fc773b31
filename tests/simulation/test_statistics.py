"""Statistics over the members of an ensemble."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation.run import statistics

RATES = np.array([-0.2, 0.1, 0.3, 0.7])


def turning(around: float, rates=RATES):
    """Bodies that turn about down at rates of their own, from a heading; q stays."""
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
    xi = co.each(np.outer(rates, [0.0, 0.0, 1.0]))
    start = body.state(g=co.each(np.stack([co.attitude.zyx(around, 0.0, 0.0)] * len(rates))), xi=xi)
    return co.simulate(body, start, dt=0.1, steps=20)


def test_mean_deviation_and_quantiles_over_members_are_those_of_their_values():
    fleet = turning(0.3)
    found = fleet.statistics(["mu", "euler_angles"], quantiles=(0.25, 0.5))
    assert list(found.statistic.values) == ["mean", "std", "min", "max", "25%", "50%"]
    assert set(found.data_vars) == {"mu", "euler_angles"} and np.all(found.members == 4)
    expected = [RATES.mean(), RATES.std(ddof=1), -0.2, 0.7, *np.quantile(RATES, [0.25, 0.5])]
    np.testing.assert_allclose(found.mu[:, 7, 2], expected, rtol=1e-12)
    heading = fleet.dataset.euler_angles[:, -1, 0].values
    mean, deviation = heading.mean(), heading.std(ddof=1)
    np.testing.assert_allclose(found.euler_angles[:2, -1, 0], [mean, deviation], rtol=1e-12)


def test_headings_about_south_have_south_as_their_mean():
    found = turning(np.pi, np.array([-0.1, 0.1])).statistics("euler_angles").euler_angles
    assert abs(found.sel(statistic="mean")[-1, 0]) == pytest.approx(np.pi, abs=1e-12)
    spread = 2 * np.arctan(0.1 * 0.1 / 2) * 20
    assert found.sel(statistic="max")[-1, 0] - found.sel(statistic="min")[-1, 0] == pytest.approx(2 * spread, rel=1e-2)


def test_members_that_have_failed_do_not_count_from_there_on():
    fleet = turning(0.0)
    made = fleet.dataset.copy(deep=True)
    made.mu.values[0, 10:] = np.nan
    made.mu.values[:, 20:] = np.nan
    found = statistics(made, "mu")
    assert list(found.members.values[[9, 10, 20]]) == [4, 3, 0]
    left = RATES[1:]
    np.testing.assert_allclose(found.mu[:2, 10, 2], [left.mean(), left.std(ddof=1)], rtol=1e-12)
    np.testing.assert_allclose(found.mu[4:, 10, 2], np.quantile(left, [0.05, 0.5, 0.95]), rtol=1e-12)
    assert np.all(np.isnan(found.mu[:, 20]))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"variables": ["speed"]}, "no variable `speed`"),
        ({"quantiles": [95]}, "a number from 0 to 1, but is 95"),
    ],
)
def test_what_statistics_cannot_give_is_said(arguments, sentence):
    with pytest.raises(co.errors.ArgumentError, match=sentence):
        turning(0.0).statistics(**arguments)


def test_a_single_run_has_no_statistics():
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
    run = co.simulate(body, body.state(xi=[0, 0, 1.0]), dt=0.1, steps=2)
    with pytest.raises(co.errors.ArgumentError, match="has none"):
        statistics(run.dataset)
