"""Arrays over named dimensions with attributes, by names: what a run holds before anybody asks for xarray.

A `Labelled` answers to the part of the interface of `xarray.Dataset` that the library uses, by the same names, so that
figures, logs and files take either. Everything else is asked of the dataset that `to_xarray` makes of it: only then
xarray and pandas are imported, which takes as long as a short run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    import xarray

    AnyDataset: TypeAlias = "xarray.Dataset | Labelled"


class LabelledArray(NDArrayOperatorsMixin):
    """Values with the names of their dimensions, attributes, and the coordinates along these dimensions.

    data: an array, or an object with `shape` and `dtype` whose `values` are made when they are first read.
    """

    def __init__(
        self,
        dims: tuple[str, ...],
        data: PyTree,
        attrs: dict[str, PyTree] | None = None,
        coords: Mapping[str, LabelledArray] | None = None,
        name: str | None = None,
    ):
        self.dims, self.data, self.name = dims, data, name
        self.attrs = {} if attrs is None else attrs
        self.coords = {} if coords is None else coords

    @property
    def values(self) -> np.ndarray:
        return self.data if isinstance(self.data, np.ndarray) else np.asarray(self.data.values)

    @property
    def shape(self) -> tuple[int, ...]:
        return self.data.shape

    @property
    def dtype(self) -> np.dtype:
        return self.data.dtype

    @property
    def ndim(self) -> int:
        return len(self.dims)

    @property
    def size(self) -> int:
        return int(np.prod(self.shape))

    def isel(self, **indices: PyTree) -> LabelledArray:
        """The values at indices along dimensions: an integer takes the dimension away."""
        places = [(axis, indices[dim]) for axis, dim in enumerate(self.dims) if dim in indices]
        data, gone = self.data, {self.dims[axis] for axis, index in places if np.ndim(index) == 0 and _is_one(index)}
        for axis, index in reversed(places):
            data = data[(slice(None),) * axis + (index,)]
        data = np.asarray(data) if isinstance(data, np.generic) else data
        return LabelledArray(tuple(dim for dim in self.dims if dim not in gone), data, self.attrs)

    def transpose(self, *dims: PyTree) -> LabelledArray:
        """The values with their dimensions in this order; `...` stands for those that are not named."""
        rest = [dim for dim in self.dims if dim not in dims]
        order = [one for dim in dims for one in (rest if dim is ... else [dim])]
        return LabelledArray(tuple(order), self.values.transpose([*map(self.dims.index, order)]), self.attrs)

    def to_xarray(self) -> xarray.DataArray:
        """The same as an array of xarray."""
        name = self.name or ""
        return Labelled({name: self, **self.coords}, {*self.coords}).to_xarray()[name].rename(self.name)

    def __array__(self, dtype: PyTree = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.values, dtype, copy=True) if copy else np.asarray(self.values, dtype)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: PyTree, **more: PyTree) -> PyTree:
        arrays = [one.to_xarray() if isinstance(one, LabelledArray) else one for one in given]
        return getattr(ufunc, method)(*arrays, **more)

    def __getitem__(self, key: PyTree) -> PyTree:
        return self.coords[key] if isinstance(key, str) and key in self.coords else self.to_xarray()[key]

    def __getattr__(self, name: str) -> PyTree:
        """Anything else is xarray's."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.to_xarray(), name)


class Labelled:
    """Arrays by their names, in an order, with attributes of all of them; some arrays are coordinates.

    variables: name → an array, or (dimensions, values) or (dimensions, values, attributes). coords: the names of those
    that are coordinates; a variable that has the name of its only dimension is one too.
    """

    def __init__(
        self,
        variables: Mapping[str, PyTree] | None = None,
        coords: frozenset[str] | set[str] = frozenset(),
        attrs: Mapping[str, PyTree] | None = None,
    ):
        self.variables: dict[str, LabelledArray] = {}
        self.attrs = dict(attrs or {})
        self._coordinates = set(coords)
        for name, given in (variables or {}).items():
            self[name] = given

    @property
    def sizes(self) -> dict[str, int]:
        """The length of every dimension."""
        return {dim: n for one in self.variables.values() for dim, n in zip(one.dims, one.shape, strict=True)}

    dims = sizes

    @property
    def coords(self) -> dict[str, LabelledArray]:
        return {name: one for name, one in self.variables.items() if name in self._coordinates}

    @property
    def data_vars(self) -> dict[str, LabelledArray]:
        """The variables that are not coordinates."""
        return {name: one for name, one in self.variables.items() if name not in self._coordinates}

    def get(self, name: str) -> LabelledArray | None:
        return self[name] if name in self.variables else None

    def assign(self, variables: Mapping[str, PyTree] | None = None, **named: PyTree) -> Labelled:
        """A copy with these variables too."""
        made = Labelled(self.variables, self._coordinates, self.attrs)
        for name, given in {**(variables or {}), **named}.items():
            made[name] = given
        return made

    def isel(self, **indices: PyTree) -> Labelled:
        """The variables at indices along dimensions."""
        chosen = {name: one.isel(**indices) for name, one in self.variables.items()}
        return Labelled(chosen, self._coordinates, self.attrs)

    def to_xarray(self) -> xarray.Dataset:
        """The same as a dataset of xarray, in which values are still made when they are first read."""
        import xarray

        variables = {name: xarray.Variable(*_of_xarray(one)) for name, one in self.variables.items()}
        made = xarray.Dataset(variables, attrs=self.attrs)
        return made.set_coords([name for name in self.variables if name in self._coordinates])

    def __getitem__(self, name: PyTree) -> PyTree:
        if not isinstance(name, str) or name not in self.variables:
            return self.to_xarray()[name]
        one = self.variables[name]
        along = {key: other for key, other in self.coords.items() if {*other.dims} <= {*one.dims}}
        return LabelledArray(one.dims, one.data, one.attrs, along, name)

    def __setitem__(self, name: str, given: PyTree) -> None:
        made = _array(given)
        if len(made.dims) != len(made.shape):
            raise ArgumentError(
                f"Variable `{name}` has {len(made.shape)} axes, but {len(made.dims)} dimensions are named for them: "
                f"{', '.join(made.dims) or 'none'}."
            )
        others = (one for other, one in self.variables.items() if other != name)
        known = {dim: n for one in others for dim, n in zip(one.dims, one.shape, strict=True)}
        for dim, n in zip(made.dims, made.shape, strict=True):
            if known.get(dim, n) != n:
                raise ArgumentError(
                    f"Variable `{name}` has {n} values along {dim}, but the others have {known[dim]}: give as many."
                )
        self.variables[name] = made
        if made.dims == (name,):
            self._coordinates.add(name)

    def __contains__(self, name: object) -> bool:
        return name in self.variables

    def __iter__(self) -> Iterator[str]:
        return iter(self.data_vars)

    def __len__(self) -> int:
        return len(self.data_vars)

    def __bool__(self) -> bool:
        return len(self) > 0

    def __repr__(self) -> str:
        return repr(self.to_xarray())

    def __getattr__(self, name: str) -> PyTree:
        """Anything else is xarray's."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.to_xarray(), name)


def _is_one(index: PyTree) -> bool:
    return not isinstance(index, slice)


def _array(given: PyTree) -> LabelledArray:
    """An array of its own of what stands for one; attributes are copied, values are not."""
    if isinstance(given, tuple):
        dims, data, *attrs = given
        if not hasattr(data, "dtype"):
            data = np.asarray(data)
        return LabelledArray((dims,) if isinstance(dims, str) else tuple(dims), data, dict(*attrs))
    if isinstance(given, LabelledArray):
        return LabelledArray(given.dims, given.data, dict(given.attrs))
    return LabelledArray(tuple(map(str, given.dims)), given.values, dict(given.attrs))


def _of_xarray(one: LabelledArray) -> tuple[tuple[str, ...], PyTree, dict[str, PyTree], dict[str, PyTree] | None]:
    """Dimensions, values, attributes and encoding of a variable of xarray; values that are made later say how."""
    if not isinstance(one.data, np.ndarray):
        data, encoding = one.data.of_xarray()
        return one.dims, data, dict(one.attrs), encoding
    return one.dims, one.data, dict(one.attrs), None


def of_run(run: PyTree) -> AnyDataset:
    """The records of a run as it holds them now: labelled arrays, or the dataset of xarray if that has been read.

    Of anything else its dataset, or the thing itself.
    """
    if isinstance(run, Labelled):
        return run
    own = getattr(run, "_labelled", None)
    return getattr(run, "dataset", run) if own is None else own
