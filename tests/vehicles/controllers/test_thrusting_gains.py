"""Proposed gains of thruster vehicles follow from delays and from a capped acceleration, as the page says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint_vehicles.controllers import Manoeuvre

PAGE = Path(__file__).parents[3] / "docs/controllers.md"


LAG = 0.1
"""s, of the thrusters of both."""


@pytest.mark.parametrize("name", ["bluerov2_heavy_von_benzon", "bluerov2_heavy_blue"])
def test_attitude_gains_are_capped_at_half_of_5_rad_per_s2_as_the_page_says(name: str):
    for period in (0.1, 0.5):
        made = Manoeuvre(period=period).fitted(vehicles.load(name))
        frequency = min(np.sqrt(5.0 / 2), 0.3 / (LAG + period / 2), 2.0)
        expected = np.array([frequency**2, frequency**3 / 8, 1.8 * frequency])
        np.testing.assert_allclose(made.attitude_gains, expected, rtol=1e-12)
        if period == 0.1:
            assert ", ".join(f"{gain:.4g}" for gain in expected) in " ".join(PAGE.read_text().split())
