"""The records in the folder of a run as a dataset of xarray, read when their values are used."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from xarray.backends import BackendArray, BackendEntrypoint
from xarray.core import indexing

from coadjoint.errors import FileError
from coadjoint.manifest import DAMAGED, Manifest, as_written
from coadjoint.simulation.dataset import coordinates_of, labelled
from coadjoint.simulation.store_reader import standing
from coadjoint.simulation.zarr_reader import RECORDS, StoredArray, along_time, arrays


class _Lazy(BackendArray):
    """An array that xarray reads when its values are used."""

    def __init__(self, array: StoredArray):
        self.array, self.shape, self.dtype = array, array.shape, array.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> np.ndarray:
        basic = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, basic, self.array.__getitem__)


class _Backend(BackendEntrypoint):
    """Makes a lazy dataset of arrays by their names."""

    def open_dataset(self, filename_or_obj: Any, *, drop_variables: object = None) -> xarray.Dataset:
        return xarray.Dataset({name: _variable(array) for name, array in filename_or_obj.items()})


def _variable(array: StoredArray) -> xarray.Variable:
    """The array, read when its values are used; `Dataset.chunk({})` takes the chunks of the file."""
    chunks = {"chunks": array.chunks, "preferred_chunks": dict(zip(array.dims, array.chunks, strict=True))}
    return xarray.Variable(array.dims, indexing.LazilyIndexedArray(_Lazy(array)), dict(array.attrs), chunks)


def stored_dataset(
    manifest: Manifest, count: int, attributes: Mapping[str, Any], coordinates: Mapping[str, Any] | None = None
) -> xarray.Dataset:
    """The first `count` records, read from the disk when they are used; only the times are in memory.

    `coordinates` are those of an ensemble's members.
    """
    opened = arrays(manifest, RECORDS)
    _require_held(manifest, opened, count)
    time = opened.pop("time")
    found: xarray.Dataset = xarray.open_dataset(opened, engine=_Backend)  # pyright: ignore[reportArgumentType]
    found = found.set_coords("step").isel(time=slice(0, count))
    found = found.assign_coords(time=("time", time[:count], dict(time.attrs)), **(coordinates or {}))
    found.attrs = {name: np.array(value) if isinstance(value, list) else value for name, value in attributes.items()}
    return labelled(found, {})


def saved_dataset(folder: Path) -> xarray.Dataset:
    """The dataset of the run in a folder, as far as its checkpoint; raises FileError if it is incomplete."""
    with as_written(folder):
        manifest, header, arrays = standing(folder)
        if type(header["records"]) is not int:
            raise TypeError("no number of records")
        members = [arrays[name] for name in ("position/steps_done", "position/codes") if name in arrays]
        coordinates = coordinates_of(*members) if members else {}
        return stored_dataset(manifest, header["records"], header["attributes"], coordinates)


def _require_held(manifest: Manifest, opened: Mapping[str, Any], count: int) -> None:
    """Raise FileError if the chunks of an array cannot hold so many records."""
    held: Counter[str] = Counter()
    for name, (size, *_) in manifest.files.items():
        held[name.split("/")[1] if name.startswith(f"{RECORDS}/") else ""] += size
    for name, array in opened.items():
        axis = along_time(array)
        declared = array.dtype.itemsize * math.prod(count if i == axis else n for i, n in enumerate(array.shape))
        if declared > held[array.basename]:
            raise FileError(
                f"The checkpoint of {manifest.folder} counts {count:,} records, more than the chunks of {name} hold: "
                f"{DAMAGED}."
            )
