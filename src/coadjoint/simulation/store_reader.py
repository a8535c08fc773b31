"""Reads the folder of a run: its manifest, its configuration, its checkpoint and its records."""

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

from coadjoint.disk import reading, require_folder
from coadjoint.errors import FileError
from coadjoint.manifest import DAMAGED, MANIFEST, Manifest, as_written
from coadjoint.simulation import configuration
from coadjoint.simulation.dataset import coordinates_of, labelled
from coadjoint.simulation.zarr_reader import RECORDS, StoredArray, along_time, arrays
from coadjoint.texts import Table

CONFIGURATION = "configuration.npz"


CHECKPOINTS = "checkpoint-*.npz"


OLD_CHECKPOINT = "checkpoint.npz"
"""The checkpoint in a folder of format 1."""


_AGAIN = 20
"""How often reading a folder is tried while a run there replaces the file that is read."""


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


def require_run(folder: Path) -> None:
    """Raise FileError if a folder holds no run, or one that an older version wrote."""
    require_folder(folder)
    if (folder / MANIFEST).exists():
        return
    if (folder / OLD_CHECKPOINT).exists() and (folder / CONFIGURATION).exists():
        raise FileError(
            f"The folder {folder} was written in format 1 of stored runs, by an older version of coadjoint: go on with "
            "that version, or begin the run again in another folder."
        )
    state = (
        "has lost its manifest: put back a copy of it"
        if (folder / CONFIGURATION).exists()
        else ("holds no run that streamed to disk")
    )
    raise FileError(f"The folder {folder} {state}.")


def run_manifest(folder: Path) -> Manifest:
    """The manifest of the run that streamed to a folder; raises FileError if the folder holds no run."""
    require_run(folder)
    found = Manifest.read(folder)
    if found.facts["kind"] != "records":
        raise FileError(
            f"The folder {folder} holds the results of a run file, not a run that streamed to disk: give co.load its "
            "trajectory.nc, and `coadjoint run` or `coadjoint resume` the folder."
        )
    return found


def standing(folder: Path) -> tuple[Manifest, Table, dict[str, np.ndarray]]:
    """The manifest of the run in a folder with the checkpoint that it names, also during the run.

    Raises FileError if a file is missing or does not have its full length.
    """
    manifest = run_manifest(folder)
    for _ in range(_AGAIN):
        try:
            for name in manifest.files:
                manifest.require_size(name)
            return manifest, *_read(manifest, manifest.facts["checkpoint"])
        except FileError:
            before, manifest = manifest.facts, run_manifest(folder)
            if manifest.facts == before:
                raise
    raise FileError(f"The folder {folder} changes faster than it can be read: wait until its run has ended.")


def read_configuration(manifest: Manifest) -> tuple[Table, dict[str, np.ndarray]]:
    """The configuration of the run in a folder; raises FileError if it is damaged."""
    return _read(manifest, CONFIGURATION)


def _read(manifest: Manifest, name: str) -> tuple[Table, dict[str, np.ndarray]]:
    manifest.require(name)
    with reading(manifest.folder / name):
        return configuration.unpacked(manifest.path(name))


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
