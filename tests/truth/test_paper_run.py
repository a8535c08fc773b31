"""The run of the paper's section 5: 50 000 steps of 0.01 s, by both difference maps and by the midpoint rule."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

import coadjoint as co
from coadjoint import models
from coadjoint.simulation.run import Run

MAPS = [co.Cayley(), co.Exponential()]
VEHICLE = models.paper_vehicle()
START = models.paper_start(VEHICLE)


@lru_cache(maxsize=8)
def run(method: co.methods.Method, dt: float = models.PAPER_STEP) -> Run:
    made = co.simulate(VEHICLE, START, dt=dt, duration=models.PAPER_DURATION, method=method, save_every=round(1 / dt))
    print(made)
    return made


def paper(tau: co.difference_maps.DifferenceMap) -> co.methods.Method:
    """The paper's scheme."""
    return co.LeftRectangle(tau, start="velocity")


@pytest.mark.parametrize("tau", MAPS, ids=repr)
def test_the_start_is_that_of_table_2(tau):
    made = run(paper(tau))
    first = made.records
    assert np.max(np.abs(START.g - np.eye(3))) <= 1e-15 and np.array_equal(START.q, [0, 0, 1])
    assert np.max(np.abs(START.xi - np.radians([10, 0, 20]))) <= 1e-15
    # Velocity start: ξ₀ and ν₀ are the unknowns of the first step.
    assert np.max(np.abs(first.xi[0] - START.xi)) <= 1e-15 and np.max(np.abs(first.nu[0] - START.nu)) <= 1e-15
    assert made.good_steps == 50_000


@pytest.mark.parametrize("tau", MAPS, ids=repr)
def test_the_vehicle_dives_and_then_floats_up(tau):
    """z points down: q_z grows from the initial push, then falls because the vehicle is lighter than its water.

    On an even keel it would reach z₀ + v²(m + A₃₃)/(2(B − mg)) at v(m + A₃₃)/(B − mg); it rolls and pitches little.
    """
    lift, inertia = 1215.8 - 123.8 * 9.81, 123.8 + 75.0
    z = run(paper(tau)).records.q[:, 2]
    deepest = int(np.argmax(z))
    assert deepest == pytest.approx(0.8 * inertia / lift, rel=0.01)
    assert z[deepest] == pytest.approx(1 + 0.8**2 * inertia / (2 * lift), rel=0.01)
    assert np.all(np.diff(z[:deepest]) > 0) and np.all(np.diff(z[deepest + 2 :]) < 0) and z[-1] < -400


@pytest.mark.parametrize("tau", MAPS, ids=repr)
def test_both_maps_keep_the_kelvin_noether_quantity_the_balance_and_the_group(tau):
    made = run(paper(tau))
    assert made.relative_change("kelvin_noether") <= 3e-11
    assert made.largest("balance") <= 2e-14 and made.largest("newton_residual") <= 1e-14
    assert made.largest("group_defect") <= 1e-12


@pytest.mark.parametrize("tau", MAPS, ids=repr)
def test_the_energy_error_of_the_left_rule_grows_and_halves_with_the_step(tau):
    """The slow growth is that of a method of order 1, not of the solver: it is proportional to h."""
    whole, half = run(paper(tau)), run(paper(tau), 0.005)
    at_h, at_half = (made.relative_change("discrete_energy") for made in (whole, half))
    assert 4.2e-4 <= at_h <= 4.4e-4
    assert at_h / at_half == pytest.approx(2.0, abs=0.03)
    assert half.largest("newton_residual") <= 1e-14


@pytest.mark.long
@pytest.mark.parametrize("tau", MAPS, ids=repr)
def test_the_midpoint_rule_keeps_the_energy_a_thousand_times_better_at_the_same_step(tau):
    made = run(co.Midpoint(tau))
    assert made.relative_change("energy") <= 3e-7
    assert made.relative_change("kelvin_noether") <= 6e-11
    assert made.largest("balance") <= 2e-14 and made.largest("group_defect") <= 1e-12


def test_the_maps_agree_to_their_order():
    """They differ by O(h²) a step, hence O(h) over the run; the dive is the same to a few micrometres."""
    cayley, exponential = (run(paper(tau)).records.q for tau in MAPS)
    difference = float(np.max(np.abs(cayley - exponential)))
    print(f"largest distance {difference:.2e} m")
    assert 1e-9 < difference <= 1e-4


@pytest.mark.long
def test_order_four_brings_the_energy_error_down_to_round_off():
    made = run(co.Suzuki4(co.Midpoint(co.Exponential())))
    assert made.relative_change("energy") <= 2e-11
    assert made.relative_change("kelvin_noether") <= 3e-10
