"""Variables of datasets are computed when they are first read."""

from __future__ import annotations

import copy
import pickle
from functools import cache

import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import Tabulated
from coadjoint.simulation.dataset import dataset
from coadjoint.simulation.deferred import Deferred


@cache
def run() -> co.Run:
    top = co.models.catalogue["heavy_top"]
    system = top.make()
    return co.simulate(system, top.start(system), dt=0.01, steps=5, accuracy=False, progress=False)


def test_reading_a_variable_computes_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    computed: list[set[str]] = []
    of_rows = Tabulated.of_rows

    def watched(self: Tabulated, *given: object) -> object:
        computed.append({*self.shapes})
        return of_rows(self, *given)

    monkeypatch.setattr(Tabulated, "of_rows", watched)
    found = dataset(run())
    assert np.all(np.isfinite(found.mu)) and computed == []
    assert found.euler_angles.shape == (6, 3) and computed == []
    assert np.all(np.isfinite(found.euler_angles)) and computed == [{"q", "rotation"}]
    assert np.all(np.isfinite(found.xi)) and np.all(np.isfinite(found.xi_spatial)) and len(computed) == 2


def test_deferred_variables_are_those_of_an_array_in_memory() -> None:
    found = dataset(run())
    whole = found.copy(deep=True).load()
    for same in (found, pickle.loads(pickle.dumps(found)), copy.deepcopy(found), found.isel(time=slice(None))):
        assert same.identical(whole)
    assert str(found) == str(whole) and "..." not in str(found.mu[0])
    before = run().records.mu.copy()
    found["mu"] *= 1000.0
    np.testing.assert_array_equal(found.xi, whole.xi)
    np.testing.assert_array_equal(run().records.mu, before)
    found["mu"][0] = 7.0
    assert np.all(found.mu.values[0] == 7.0) and not np.any(whole.mu.values[0] == 7.0)


def test_a_deferred_array_is_made_once_and_its_views_with_it() -> None:
    made: list[int] = []

    def make() -> np.ndarray:
        made.append(1)
        return np.arange(12.0).reshape(6, 2)

    array = Deferred((6, 2), np.dtype(float), make)
    view = array[..., 1].reshape(3, 2)
    assert (view.shape, view.dtype, made) == ((3, 2), np.dtype(float), [])
    assert np.array_equal(view, [[1, 3], [5, 7], [9, 11]]) and np.asarray(array).shape == (6, 2) and made == [1]
