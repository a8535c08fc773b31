"""What the page on filters shows of a vehicle: a wrong model, a minute without a DVL, and late fixes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "figures"))
import filters  # pyright: ignore[reportMissingImports]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("members", [20, 100])
def test_a_model_that_is_wrong_by_a_tenth_stays_in_its_ellipsoids_with_noise_that_20_others_fixed(members):
    """The noise is fixed on seed 7; these are others."""
    _, nees = filters.wrong_model(members, filters.FACTOR, filters.THRUST, 10, steps=300 if members < 100 else 600)
    high = chi2.ppf(0.975, members * filters.FREE) / members
    assert np.mean(nees.mean(axis=1) < high) >= 0.95 and nees.mean() < high
    assert np.mean(nees < chi2.ppf(0.95, filters.FREE)) >= 0.9


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("members", [4, 20])
def test_a_minute_without_a_dvl_costs_a_fifth_of_what_it_costs_the_inertial_unit_alone(members):
    """Honeywell HG1700, a current of 0.3 m/s; depth and compass go on for both."""
    assert np.linalg.norm(filters.CURRENT) == pytest.approx(0.3)
    t, ours, ins = filters.gap(members, 3)
    drift, alone = (np.sqrt(np.mean(one[-1] ** 2)) for one in (ours, ins))
    assert t[-1] == pytest.approx(180.0) and 1.0 < alone < 20.0
    assert drift <= alone / 5


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("members", "seconds"), [(3, 150), (20, 300)])
@pytest.mark.parametrize("names", [("depth", "compass", "usbl"), ("dvl", "depth", "compass", "usbl")])
def test_a_delay_of_two_seconds_of_the_usbl_costs_less_than_a_tenth(members, seconds, names):
    """REMUS 100 on a square with two depths in a current of 0.3 m/s; what counts is each time's estimate then."""
    errors = {}
    for delay, dated in ((0.0, True), (filters.DELAY, True), (filters.DELAY, False)):
        _, off = filters.late(members, 5, delay, seconds, names, dated)
        errors[delay, dated] = filters.root_mean_square(off[filters.AFTER :])
    assert 0.1 < errors[0.0, True] < 1.0 < errors[filters.DELAY, False]
    assert errors[filters.DELAY, True] < 1.1 * errors[0.0, True]
