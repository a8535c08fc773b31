"""Steps by momenta beside NumPy's: both make the same."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.momenta import by_numpy, by_quflow, fluid, matrix, problem, spectrum

import coadjoint as co


@pytest.mark.parametrize("family", ["so", "u"])
def test_numpy_makes_the_same_steps(family: str) -> None:
    system, start, h, weights = problem(family, 4)
    path = co.trajectory(system, start, dt=h, steps=5, method=co.IsospectralMidpoint())
    assert np.max(np.abs(path.final.mu - start.mu)) > 0.1
    np.testing.assert_allclose(by_numpy(system.group, weights, start.mu, h, 5), path.final.mu, atol=1e-13)


def test_steps_of_fluids_are_as_long_as_said_and_quflow_is_left_out_where_it_is_not_installed(monkeypatch) -> None:
    """ε‖P̃‖ = 0.079, with ξ of the record −P/ħ and ε = h/2ħ."""
    system, start, h = fluid(4)
    path = co.trajectory(system, start, dt=h, steps=4, method=co.IsospectralMidpoint())
    assert 0.5 * h * np.linalg.norm(matrix(system, path.records.xi[0]), 2) == pytest.approx(0.079, rel=1e-2)
    before, after = (spectrum(matrix(system, mu)) for mu in (start.mu, path.final.mu))
    np.testing.assert_allclose(after, before, atol=1e-14)
    monkeypatch.setattr("benchmarks.momenta.find_spec", lambda name: None)
    assert by_quflow(matrix(system, start.mu), h, 1) is None
