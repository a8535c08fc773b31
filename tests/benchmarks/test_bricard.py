"""Bricard's mechanism of the benchmark of mechanisms."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import bricard


def test_the_curve_of_the_angles_closes_the_loop() -> None:
    for alpha in (-1.5, 0.4, 2.0):
        closed = bricard.corners(np.array([alpha, 2 * np.arccos(0.5 / np.cos(alpha / 2))]))
        assert closed[-1] == pytest.approx(np.zeros(3), abs=1e-14)


@pytest.mark.long
@pytest.mark.parametrize(("library", "bound"), [("coadjoint", 2e-3), ("mujoco", 2e-2), ("exudyn", 1e-3)])
@pytest.mark.filterwarnings("ignore:The constraints have 30 rows")
def test_the_third_corner_moves_as_the_one_freedom_has_it(library: str, bound: float) -> None:
    pytest.importorskip(library)
    found = {}
    for name, dt, prepare in getattr(bricard, f"by_{library}")():
        found[name, dt] = bricard.off(prepare()())
    assert max(found.values()) < bound
    if library == "coadjoint":
        assert min(found.values()) < 1e-10
