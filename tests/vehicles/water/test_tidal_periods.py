"""Periods of tides from the rates of the moon and the sun."""

import pytest

from coadjoint_vehicles.water.currents import HOUR, TIDES

SUN_DAY, MOON, SUN, PERIGEE = 15.0, 0.54901653, 0.04106864, 0.00464183
"""Rates of the mean solar time, and of the mean longitudes of moon, sun and lunar perigee, degrees an hour.
Source: Schureman, Manual of Harmonic Analysis (1958), table 1."""

DOODSON = {
    "M2": (2, -2, 2, 0), "S2": (2, 0, 0, 0), "N2": (2, -3, 2, 1), "K2": (2, 0, 2, 0), "K1": (1, 0, 1, 0),
    "O1": (1, -2, 1, 0), "P1": (1, 0, -1, 0), "M4": (4, -4, 4, 0),
}  # fmt: skip
"""How many times each rate is in a constituent."""


@pytest.mark.parametrize("name", DOODSON)
def test_the_period_of_a_constituent_is_that_of_its_rates(name):
    speed = sum(n * rate for n, rate in zip(DOODSON[name], (SUN_DAY, MOON, SUN, PERIGEE), strict=True))
    assert TIDES[name] == pytest.approx(360.0 / speed * HOUR, rel=3e-7)  # the rates have seven digits


def test_every_constituent_is_checked():
    assert set(DOODSON) == set(TIDES)
