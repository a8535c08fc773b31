"""Steps by momenta beside NumPy's: both make the same."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.momenta import by_numpy, fluid, fluid_rows, matrix, problem, quflow_steps, spectrum

import coadjoint as co


@pytest.mark.long
@pytest.mark.parametrize("family", ["so", "u"])
def test_numpy_makes_the_same_steps(family: str) -> None:
    system, start, h, weights = problem(family, 4)
    path = co.trajectory(system, start, dt=h, steps=5, method=co.IsospectralMidpoint())
    assert np.max(np.abs(path.final.mu - start.mu)) > 0.1
    np.testing.assert_allclose(by_numpy(system.group, weights, start.mu, h, 5), path.final.mu, atol=1e-13)


@pytest.mark.long
def test_steps_of_fluids_are_as_long_as_said_and_quflow_is_left_out_where_it_is_not_installed(monkeypatch) -> None:
    """ε‖P̃‖ = 0.079, with ξ of the record −P/ħ and ε = h/2ħ."""
    system, start, h = fluid(4)
    path = co.trajectory(system, start, dt=h, steps=4, method=co.IsospectralMidpoint())
    assert 0.5 * h * np.linalg.norm(matrix(system, path.records.xi[0]), 2) == pytest.approx(0.079, rel=1e-2)
    before, after = (spectrum(matrix(system, mu)) for mu in (start.mu, path.final.mu))
    np.testing.assert_allclose(after, before, atol=1e-14)
    monkeypatch.setattr("benchmarks.momenta.find_spec", lambda name: None)
    assert quflow_steps() is None and len(fluid_rows(4, rounds=1)) == 1


@pytest.mark.long
def test_quflow_takes_the_same_steps_from_the_same_start_and_its_change_of_the_spectrum_is_beside_ours(monkeypatch):
    """Of one that doubles W, whose eigenvalues change by as much as they are."""
    asked = []

    def wrong(W, h, steps, maxit, tol, compsum):
        asked.append((h, steps, tol, compsum))
        return 2 * W

    monkeypatch.setattr("benchmarks.momenta.quflow_steps", lambda: wrong)
    _, _, h = fluid(4)
    rows = [row.split("|")[2:6] for row in fluid_rows(4, rounds=1)]
    assert [row[0].strip() for row in rows] == ["1e-14", "quflow, its own", "quflow, 1e-14 of W"]
    assert float(rows[0][3]) < 1e-13 and float(rows[0][2]) == 1.0
    assert [float(row[3]) for row in rows[1:]] == [1.0, 1.0]
    assert {(used, steps) for used, steps, _, _ in asked} == {(h, 1250), (h, 2500)}
    assert all(compsum for *_, compsum in asked) and {tol for _, _, tol, _ in asked} > {"auto"}
