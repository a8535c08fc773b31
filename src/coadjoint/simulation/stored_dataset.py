"""The records in the folder of a run as labelled arrays, read when their values are used."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import FileError
from coadjoint.labelled import Labelled
from coadjoint.manifest import DAMAGED, Manifest, as_written
from coadjoint.simulation.dataset import Variables, coordinates_of, labelled
from coadjoint.simulation.deferred import Deferred
from coadjoint.simulation.store_reader import standing
from coadjoint.simulation.zarr_reader import RECORDS, StoredArray, along_time, arrays
from coadjoint.texts import Table


class StoredRows(Deferred):
    """The first `count` records of an array on the disk; once `values` has been read they stay in memory."""

    def __init__(self, array: StoredArray, count: int):
        self.array, self.count, self._axis = array, count, along_time(array)
        shape = (*array.shape[: self._axis], count, *array.shape[self._axis + 1 :])
        super().__init__(shape, array.dtype, self.read)

    def _part(self, members: slice, every: int) -> tuple[slice, ...]:
        inner = [slice(None)] * (len(self.shape) - self._axis - 1)
        return (*[members] * self._axis, slice(0, self.count, every), *inner)

    def read(self, members: slice = slice(None), every: int = 1) -> np.ndarray:
        """The records of some members at every so many-th node, read anew each time."""
        return self.array[self._part(members, every)]

    def of_xarray(self) -> tuple[PyTree, PyTree]:
        """The array as xarray reads it when its values are used; `Dataset.chunk({})` takes the chunks of the file."""
        from coadjoint.simulation.of_xarray import stored

        chunks = self.array.chunks
        encoding = {"chunks": chunks, "preferred_chunks": dict(zip(self.array.dims, chunks, strict=True))}
        return stored(self.array, self._part(slice(None), 1)), encoding


def stored_rows(manifest: Manifest, count: int) -> dict[str, StoredRows]:
    """The first `count` records of every array of a folder; raises FileError if it cannot hold them."""
    opened = arrays(manifest, RECORDS)
    _require_held(manifest, opened, count)
    return {name: StoredRows(array, count) for name, array in opened.items()}


def stored_dataset(
    manifest: Manifest, count: int, attributes: Mapping[str, PyTree], coordinates: Variables | None = None
) -> Labelled:
    """The first `count` records, read from the disk when they are used; only the times are in memory.

    `coordinates` are those of an ensemble's members.
    """
    rows = stored_rows(manifest, count)
    time = rows.pop("time")
    found: Table = {name: (one.array.dims, one, one.array.attrs) for name, one in rows.items()}
    found |= {"time": ("time", time.read(), time.array.attrs), **(coordinates or {})}
    known: Table = {name: np.array(value) if isinstance(value, list) else value for name, value in attributes.items()}
    return labelled(found, {"step", "time", *(coordinates or {})}, known)


def saved_dataset(folder: Path) -> Labelled:
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
