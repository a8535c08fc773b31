"""The fast heavy top of Brüls, Cardona and Arnold (2012) and the top of Simo and Wong (1991) against their figures."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.models import catalogue

# The centre of mass by an adaptive method of order 8 (DOP853), tolerances 1e-12 and 1e-13 agreeing to all digits.
REFERENCE = {
    0.2: (0.605550561377, 0.598957681795, -0.523983027430),
    1.0: (0.173343964098, 0.640088592070, -0.748490791134),
    2.0: (-0.150416822746, -0.724165591637, -0.673022269560),
}
TOP = catalogue["heavy_top"].make()
START = catalogue["heavy_top"].start(TOP)
EXPONENTIAL, CAYLEY = co.Exponential(), co.Cayley()


def errors(method: co.methods.Method, dt: float) -> np.ndarray:
    """The Euclidean distances of the centre of mass from the reference at t = 0.2, 1, 2 s."""
    run = co.simulate(TOP, START, dt=dt, duration=2.0, method=method, save_every=round(0.2 / dt))
    place = run.records.g @ np.array(catalogue["heavy_top"].parameters["center_of_mass"])
    found = np.array([np.linalg.norm(place[round(t / 0.2)] - x) for t, x in REFERENCE.items()])
    print(f"{method.title}, dt = {dt}: {found}, energy {run.relative_change('energy'):.1e}")
    assert run.relative_change("kelvin_noether") <= 2e-13 and run.largest("balance") <= 1e-14
    return found


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("method", "at_most"),
    [
        (co.methods.LeftRight(EXPONENTIAL), 5e-5),
        (co.methods.LeftRight(CAYLEY), 1.5e-4),
        (co.Midpoint(EXPONENTIAL), 2e-4),
        (co.Midpoint(CAYLEY), 3e-4),
        (co.Trapezoidal(EXPONENTIAL), 2e-4),
        (co.Trapezoidal(CAYLEY), 6e-4),
    ],
    ids=lambda value: getattr(value, "title", f"{value}"),
)
def test_methods_of_order_two_approach_the_reference_at_order_two(method: co.methods.Method, at_most: float):
    coarse, fine = errors(method, 2e-4), errors(method, 1e-4)
    assert np.all(np.abs(np.log2(coarse / fine) - 2) <= 0.03)
    assert fine[-1] <= at_most


@pytest.mark.long
def test_order_four_meets_the_reference_in_all_its_digits():
    found = errors(co.Suzuki4(co.methods.LeftRight(EXPONENTIAL)), 5e-5)
    assert np.max(found) <= 3e-12


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("degree", "dt", "at_most"), [(3, 5e-4, 5e-11), (4, 4e-3, 2e-9), (4, 2e-3, 1e-11)], ids=lambda value: f"{value:g}"
)
def test_single_steps_of_high_order_are_long(degree: int, dt: float, at_most: float):
    """0.3 rad a step at dt = 2e-3, where other programs are off by 3e-3 or fail."""
    assert np.max(errors(co.Galerkin(degree=degree), dt)) <= at_most


@pytest.mark.cases(1)
@pytest.mark.parametrize("tau", [EXPONENTIAL, CAYLEY], ids=repr)
def test_the_top_of_simo_and_wong_keeps_its_energy_where_a_reference_code_loses_a_thousandth(tau):
    entry = catalogue["simo_wong_top"]
    top = entry.make()
    run = co.simulate(top, entry.start(top), dt=0.009, steps=1111, method=co.Midpoint(tau))
    assert run.monitors["energy"][0] == pytest.approx(1250 + 20 * np.cos(0.05), rel=1e-14)
    assert run.monitors["energy"][0] == pytest.approx(1269.975, abs=1e-4)
    assert run.relative_change("energy") <= 2e-7
