"""Steps by momenta beside NumPy's: both make the same."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.momenta import by_numpy, problem

import coadjoint as co


@pytest.mark.parametrize("family", ["so", "u"])
def test_numpy_makes_the_same_steps(family: str) -> None:
    system, start, h, weights = problem(family, 4)
    path = co.trajectory(system, start, dt=h, steps=5, method=co.IsospectralMidpoint())
    assert np.max(np.abs(path.final.mu - start.mu)) > 0.1
    np.testing.assert_allclose(by_numpy(system.group, weights, start.mu, h, 5), path.final.mu, atol=1e-13)
