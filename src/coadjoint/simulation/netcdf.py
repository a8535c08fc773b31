"""Writes labelled arrays as a file of netCDF 4, which is HDF5, by h5py alone.

A dimension is a scale of HDF5: the variable of its name, or else an array without numbers. Every variable refers to the
scales of its axes and lists their numbers. Names, texts and coordinates are encoded as by xarray's `to_netcdf`, which
reads and writes each attribute through two libraries more: for the sixty variables of a vehicle ten times as long.

Source: *NetCDF-4 file format*, in the NetCDF users' guide of Unidata, appendix B; *CF conventions*, section 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.labelled import Labelled, LabelledArray
from coadjoint.texts import Table

if TYPE_CHECKING:
    import h5py
    import xarray

    from coadjoint.labelled import AnyDataset

_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."


def write(dataset: AnyDataset, path: Path) -> None:
    """Write all variables and attributes to `path`, over what is there; raises OSError, ValueError."""
    if all(map(_is_plain, dataset.variables, dataset.variables.values())):
        _write(*_encoded(dataset), dataset.sizes, path)
    else:
        complete = dataset.to_xarray() if isinstance(dataset, Labelled) else dataset
        complete.to_netcdf(path.absolute(), engine="h5netcdf")


def _is_plain(name: object, variable: LabelledArray | xarray.Variable) -> bool:
    """Whether a variable has numbers or texts in a row, without the compression that a user may ask of xarray."""
    encoding = {} if isinstance(variable, LabelledArray) else variable.encoding
    asked = any(encoding.get(key) for key in ("zlib", "compression", "chunksizes", "shuffle", "fletcher32"))
    return "/" not in str(name) and variable.dtype.kind in "biufOU" and not asked


def _encoded(dataset: AnyDataset) -> tuple[Mapping[str, LabelledArray | xarray.Variable], Table]:
    """Variables and attributes by the conventions of CF; of a dataset of xarray, which may ask for more, by xarray."""
    if not isinstance(dataset, Labelled):
        from xarray.conventions import cf_encoder, encode_dataset_coordinates

        variables, attributes = cf_encoder(*encode_dataset_coordinates(dataset))
        return variables, dict(attributes)
    other = {name: {*one.dims} for name, one in dataset.coords.items() if name not in dataset.sizes}
    found: dict[str, LabelledArray] = {}
    for name, one in dataset.variables.items():
        named = name not in other and name not in one.dims
        along = sorted(coordinate for coordinate, dims in other.items() if named and dims <= {*one.dims})
        found[name] = _of_variable(one, {"coordinates": " ".join(along)} if along else {})
    unnamed = set(other).difference(*(one.attrs.get("coordinates", "").split() for one in found.values()))
    return found, dataset.attrs | ({"coordinates": " ".join(sorted(unnamed))} if unnamed else {})


def _of_variable(one: LabelledArray, more: Table) -> LabelledArray:
    """A variable with more attributes: truths become integers, and of floats NaN stands where nothing was written."""
    attributes = {**one.attrs, **more}
    if one.dtype.kind == "b":
        return LabelledArray(one.dims, one.values.astype("i1"), attributes | {"dtype": "bool"})
    fill = {"_FillValue": one.dtype.type(np.nan)} if one.dtype.kind == "f" and "_FillValue" not in attributes else {}
    return LabelledArray(one.dims, one.data, attributes | fill)


def _write(
    variables: Mapping[str, LabelledArray | xarray.Variable], attributes: Table, sizes: Mapping[PyTree, int], path: Path
) -> None:
    import h5py

    ids = {str(name): np.int32(k) for k, name in enumerate(sizes)}
    with h5py.File(path, "w", track_order=True) as file:
        made = {str(name): _array(file, str(name), variable) for name, variable in variables.items()}
        for name, size in sizes.items():
            scale = made[str(name)] if name in made else _made(file, str(name), (size,), ">f4")
            scale.attrs["_Netcdf4Dimid"] = ids[str(name)]
            scale.make_scale(str(name) if name in made else f"{_NO_VARIABLE}{size:10}")
        for name, variable in variables.items():
            if variable.dims:
                made[name].attrs["_Netcdf4Coordinates"] = np.array([ids[str(dim)] for dim in variable.dims], np.int32)
            for axis, dim in enumerate(variable.dims):
                if dim != name:
                    made[name].dims[axis].attach_scale(file[str(dim)])
        _put(file, attributes)


def _array(file: h5py.File, name: str, variable: LabelledArray | xarray.Variable) -> h5py.Dataset:
    """The values and the attributes of a variable."""
    import h5py

    values = np.asarray(variable.values)
    kind: Any = h5py.string_dtype() if values.dtype.kind in "OU" else values.dtype
    made = _made(file, name, values.shape, kind, fillvalue=variable.attrs.get("_FillValue"))
    made[...] = values.astype(object) if values.dtype.kind == "U" else values
    _put(made, variable.attrs)
    return made


def _made(file: h5py.File, name: str, shape: tuple[int, ...], kind: Any, **options: Any) -> h5py.Dataset:
    """An array; an axis without numbers is one of unlimited length, as netCDF has no other of length 0."""
    longest = tuple(n or None for n in shape)
    if longest != shape:
        options["maxshape"] = longest
    return file.create_dataset(name, shape, kind, track_order=True, **options)


def _put(owner: h5py.File | h5py.Dataset, attributes: Mapping[Any, Any]) -> None:
    for key, value in attributes.items():
        numbers = np.atleast_1d(value)
        text = numbers.dtype.kind == "U"
        owner.attrs[str(key)] = value if isinstance(value, str) else numbers.astype(object) if text else numbers
