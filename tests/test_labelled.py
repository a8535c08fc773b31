"""Labelled arrays answer as the dataset of xarray that they become."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import xarray

from coadjoint.errors import ArgumentError
from coadjoint.labelled import Labelled, LabelledArray, of_run
from coadjoint.simulation.deferred import Deferred


def made() -> Labelled:
    draw = np.random.default_rng(3).normal
    later = draw(size=(2, 4))
    variables = {
        "x": (("member", "time", "axis"), draw(size=(2, 4, 3)), {"units": "m"}),
        "y": (("member", "time"), Deferred(later.shape, later.dtype, lambda: later)),
        "time": ("time", np.arange(4.0), {"units": "s"}),
        "step": ("time", np.arange(4)),
        "member": ("member", np.arange(2)),
        "axis": ("axis", ["a", "b", "c"]),
    }
    return Labelled(variables, {"step"}, {"system": "top"})


def outer(dataset) -> tuple:
    """What both answer."""
    sizes = dict(dataset.sizes)
    names = [*dataset], [*dataset.data_vars], {*dataset.coords}, {*dataset.dims}, "x" in dataset, "z" in dataset
    arrays = {name: (one.dims, one.shape, one.ndim, one.size, one.dtype) for name, one in dataset.variables.items()}
    return sizes, names, arrays, dataset.attrs, {name: one.attrs for name, one in dataset.variables.items()}


def require_same(ours, theirs) -> None:
    if isinstance(ours, LabelledArray):
        assert ours.dims == theirs.dims and {*ours.coords} == {*theirs.coords}
        for one, other in ((ours, theirs), *((ours[name], theirs[name]) for name in theirs.coords)):
            np.testing.assert_array_equal(one.values, other.values)
    else:
        assert outer(ours) == outer(theirs)
        xarray.testing.assert_identical(ours.to_xarray(), theirs)


@pytest.mark.parametrize(
    "ask",
    [
        lambda d: d,
        lambda d: d.isel(member=1),
        lambda d: d.isel(member=np.array([1, 0]), time=slice(1, 3)),
        lambda d: d.isel(time=np.array([True, False, True, True])),
        lambda d: d.assign({"z": ("time", np.ones(4)), "w": ((), 3)}),
        lambda d: d.assign(w=((), 3)),
        lambda d: d["x"],
        lambda d: d.get("y"),
    ],
)
def test_an_answer_is_that_of_xarray(ask):
    ours = made()
    require_same(ask(ours), ask(ours.to_xarray()))


def test_a_variable_that_does_not_fit_the_others_is_refused_and_not_kept():
    ours = made()
    with pytest.raises(ArgumentError, match="`z` has 3 values along time, but the others have 4"):
        ours["z"] = ("time", np.zeros(3))
    with pytest.raises(ArgumentError, match="`z` has 2 axes, but 1 dimensions are named for them: time"):
        ours["z"] = ("time", np.zeros((4, 2)))
    ours["axis"] = ("axis", ["d", "e", "f"])
    assert "z" not in ours and len(ours) == len(ours.to_xarray()) == 2
    assert repr(ours) == repr(ours.to_xarray())


def test_axes_change_places_as_those_of_xarray():
    ours = made()
    for order in (("time", "member", "axis"), ("axis", ...), (..., "member")):
        found, expected = ours["x"].transpose(*order), ours.to_xarray()["x"].transpose(*order)
        assert found.dims == expected.dims
        np.testing.assert_array_equal(found, expected)


def test_what_they_lack_is_asked_of_xarray():
    ours = made()
    theirs = ours.to_xarray()
    for ask in (
        lambda d: d.sel(time=2.0),
        lambda d: d[["x", "y"]],
        lambda d: d.x.mean("time"),
        lambda d: d["x"][0],
        lambda d: d["x"] + 2 * d["y"],
        lambda d: np.sin(d["y"]),
    ):
        xarray.testing.assert_equal(ask(ours), ask(theirs))
    with pytest.raises(AttributeError, match="no_such"):
        _ = ours.no_such


def test_values_are_made_when_they_are_read_and_once():
    asked = []
    ours = Labelled({"x": ("time", Deferred((3,), np.dtype(float), lambda: asked.append(1) or np.arange(3.0)))})
    whole, part = ours.to_xarray(), ours.isel(time=2)
    assert whole.x.shape == (3,) and part["x"].shape == () and not asked
    assert float(part["x"].values) == 2.0 and whole.x.values[1] == 1.0 and asked == [1]


def test_a_copy_has_attributes_of_its_own_and_leaves_the_process():
    ours = made()
    for other in (ours.assign(), pickle.loads(pickle.dumps(ours)), copy.deepcopy(ours)):
        xarray.testing.assert_identical(other.to_xarray(), ours.to_xarray())
        other["x"].attrs["units"] = "km"
        assert ours["x"].attrs["units"] == "m"
    assert of_run(ours) is ours
