"""Writes a dataset as a file of netCDF 4, which is HDF5, by h5py alone.

A dimension is a scale of HDF5: the variable of its name, or else an array without numbers. Every variable refers to the
scales of its axes and lists their numbers. xarray encodes names, texts and coordinates, as for its `to_netcdf`, which
reads and writes each attribute through two libraries more: for the sixty variables of a vehicle ten times as long.

Source: *NetCDF-4 file format*, in the NetCDF users' guide of Unidata, appendix B.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import h5py
    import xarray

_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."


def write(dataset: xarray.Dataset, path: Path) -> None:
    """Write all variables and attributes to `path`, over what is there; raises OSError, ValueError."""
    if all(map(_is_plain, dataset.variables, dataset.variables.values())):
        _write(dataset, path)
    else:
        dataset.to_netcdf(path.absolute(), engine="h5netcdf")


def _is_plain(name: object, variable: xarray.Variable) -> bool:
    """Whether a variable has numbers or texts in a row, without the compression that a user may ask of xarray."""
    asked = any(variable.encoding.get(key) for key in ("zlib", "compression", "chunksizes", "shuffle", "fletcher32"))
    return "/" not in str(name) and variable.dtype.kind in "biufOU" and not asked


def _write(dataset: xarray.Dataset, path: Path) -> None:
    import h5py
    from xarray.conventions import cf_encoder, encode_dataset_coordinates

    variables, attributes = cf_encoder(*encode_dataset_coordinates(dataset))
    ids = {str(name): np.int32(k) for k, name in enumerate(dataset.sizes)}
    with h5py.File(path, "w", track_order=True) as file:
        made = {str(name): _array(file, str(name), variable) for name, variable in variables.items()}
        for name, size in dataset.sizes.items():
            scale = made[str(name)] if name in made else _made(file, str(name), (size,), ">f4")
            scale.attrs["_Netcdf4Dimid"] = ids[str(name)]
            scale.make_scale(str(name) if name in made else f"{_NO_VARIABLE}{size:10}")
        for name, variable in variables.items():
            if variable.dims:
                made[name].attrs["_Netcdf4Coordinates"] = np.array([ids[dim] for dim in variable.dims], np.int32)
            for axis, dim in enumerate(variable.dims):
                if dim != name:
                    made[name].dims[axis].attach_scale(file[dim])
        _put(file, attributes)


def _array(file: h5py.File, name: str, variable: xarray.Variable) -> h5py.Dataset:
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
