"""Variables of datasets are computed when they are first read."""

from __future__ import annotations

import copy
import pickle
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import Tabulated
from coadjoint.mechanics.energy_scale import largest_kinetic, near_zero, paired
from coadjoint.simulation.dataset import dataset
from coadjoint.simulation.deferred import Deferred, are_deferred, blank, of_each, together


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
    found = dataset(run()).to_xarray()
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


def squares(x: np.ndarray) -> Deferred:
    return Deferred(x.shape, x.dtype, lambda: x**2)


def test_a_copy_of_a_deferred_array_is_the_callers_and_another_type_is_converted() -> None:
    array = squares(np.arange(3.0))
    mine = np.array(array, copy=True)
    mine[0] = 9.0
    assert array.values[0] == 0.0 and np.shares_memory(np.asarray(array), array.values)
    assert np.array(array, np.float32).dtype == np.float32 and blank((2, 10**12), float).strides == (0, 0)


def test_records_are_deferred_where_one_of_them_is_and_a_function_of_them_is_too() -> None:
    x, y = np.arange(4.0), np.ones(4)
    made: list[int] = []

    def both() -> tuple[np.ndarray, np.ndarray]:
        made.append(1)
        return x, y

    first, second = together((x, y), both)
    assert are_deferred((x, first)) and are_deferred([second]) and not are_deferred((x, y))
    now = of_each(lambda a, b: {"sum": a + 2 * b}, x, y)
    later = of_each(lambda a, b: {"sum": a + 2 * b}, first, second)["sum"]
    assert isinstance(later, Deferred) and later.shape == (4,) and made == []
    assert later.values.tolist() == now["sum"].tolist() == [2.0, 3.0, 4.0, 5.0] and made == [1]


@pytest.mark.parametrize("size", [1, 7, 8, 9])
def test_pairings_of_records_of_members_are_those_of_the_last_axis(size: int) -> None:
    momenta, velocities = np.random.default_rng(1).normal(size=(2, 3, 2, size))
    assert paired(momenta, velocities) == pytest.approx(np.einsum("ijk,ijk->ij", momenta, velocities), rel=1e-14)


def test_an_energy_is_near_zero_where_the_kinetic_energy_is_more_than_twenty_times_it() -> None:
    assert near_zero([1.0, 1.0, 0.0], [20.0, 20.1, 1e-9]).tolist() == [False, True, True]
    names = ("mu", "xi", "pi", "nu")
    parts: list[Any] = [
        SimpleNamespace(**{name: np.array([[k]]) for name, k in zip(names, four, strict=True)})
        for four in ((1.0, 2.0, 3.0, -5.0), (1.0, 2.0, 0.5, 2.0))
    ]
    assert largest_kinetic(*parts).tolist() == 6.5
