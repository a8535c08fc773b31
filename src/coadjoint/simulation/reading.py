"""Reads the folder of a run: lazily, and only what its checkpoint counts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import google_crc32c
import numpy as np
import xarray
import zarr
from zarr.storage import LocalStore

from coadjoint.errors import FileError
from coadjoint.simulation import checkpoint as disk
from coadjoint.simulation.dataset import labelled, member_coordinates

CONFIGURATION, CHECKPOINT, RECORDS = "configuration.npz", "checkpoint.npz", "records.zarr"

_DAMAGED = "put back a copy of it; nothing has been changed"


class Verified(LocalStore):
    """Chunks are there and carry the right checksum, or FileError says which file is not."""

    async def get(self, key: str, *rest: Any, **options: Any) -> Any:
        return self._checked(key, await super().get(key, *rest, **options))

    def get_sync(self, key: str, *rest: Any, **options: Any) -> Any:
        return self._checked(key, super().get_sync(key, *rest, **options))

    def _checked(self, key: str, found: Any) -> Any:
        if "/c/" not in key:
            return found
        if found is None:
            raise FileError(f"The file {self.root / key} of the run is missing: {_DAMAGED}.")
        data = found.to_bytes()
        if len(data) < 4 or google_crc32c.value(data[:-4]) != int.from_bytes(data[-4:], "little"):
            raise FileError(f"The file {self.root / key} of the run is damaged: {_DAMAGED}.")
        return found


def stored_dataset(
    folder: Path, count: int, attributes: Mapping[str, Any], coordinates: Mapping[str, Any] | None = None
) -> xarray.Dataset:
    """The first `count` records, read from the disk when they are used; only the times are in memory.

    `coordinates` are those of an ensemble's members.
    """
    store = Verified(folder / RECORDS, read_only=True)
    # Opened with the times, xarray would read all of them, and those to come are not there.
    options: Any = {"consolidated": False, "chunks": None, "decode_cf": False, "zarr_format": 3}
    found = xarray.open_zarr(store, drop_variables=["time"], **options)
    time = opened_arrays(folder, "r")["time"]
    order = [name for name in found.attrs["order"] if name != "time"]
    found = found[order].set_coords("step").isel(time=slice(0, count))
    found = found.assign_coords(time=("time", time[:count], dict(time.attrs)), **(coordinates or {}))
    found.attrs = {name: np.array(value) if isinstance(value, list) else value for name, value in attributes.items()}
    return labelled(found, {})


def saved_dataset(folder: Path) -> xarray.Dataset:
    """The dataset of the run in a folder, as far as its checkpoint; raises FileError where it is incomplete."""
    configuration, _ = read_configuration(folder)
    header, arrays = read_checkpoint(folder, configuration["identity"])
    require_whole(folder, opened_arrays(folder, "r"), header["records"])
    members = [arrays[name] for name in ("position/steps_done", "position/codes") if name in arrays]
    coordinates = member_coordinates(*members) if members else {}
    return stored_dataset(folder, header["records"], header["attributes"], coordinates)


def read_configuration(folder: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What is run in a folder; raises FileError where it holds no run."""
    if not folder.is_dir():
        raise FileError(f"There is no folder {folder}.")
    return _read(folder, CONFIGURATION, "holds no run that streamed to disk")


def read_checkpoint(folder: Path, identity: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Where the run in a folder stands; raises FileError where that is unknown or belongs to another run."""
    header, arrays = _read(folder, CHECKPOINT, "has lost its checkpoint: put back a copy of it, or start again")
    if header["identity"] != identity:
        raise FileError(
            f"The file {folder / CHECKPOINT} is the checkpoint of another configuration than the run in this folder: "
            f"{_DAMAGED}."
        )
    return header, arrays


def _read(folder: Path, name: str, otherwise: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    try:
        return disk.read(folder / name)
    except FileNotFoundError:
        raise FileError(f"The folder {folder} {otherwise}.") from None
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"The file {folder / name} cannot be read: {error.strerror or error}.") from error


def opened_arrays(folder: Path, mode: Any) -> dict[str, Any]:
    """The arrays in a folder by their names: "r" to read with verified chunks, "r+" to write."""
    try:
        place = Verified(folder / RECORDS, read_only=True) if mode == "r" else LocalStore(folder / RECORDS)
        group = zarr.open_group(place, mode=mode, zarr_format=3)
        # A block of members that have all failed is written too: NaN on purpose, not by absence.
        with zarr.config.set({"array.write_empty_chunks": True}):
            return dict(group.arrays())
    except (OSError, ValueError, KeyError) as error:
        raise FileError(f"The records in {folder / RECORDS} cannot be opened ({error}): {_DAMAGED}.") from error


def along_time(array: Any) -> int:
    """The axis of an array that counts the nodes: 1 where members come first."""
    return array.metadata.dimension_names.index("time")


def chunk_files(folder: Path, array: Any, index: int) -> list[Path]:
    """Where the chunks of an array with the block of nodes `index` are: one, or one for each block of members."""
    axis = along_time(array)
    place = folder / RECORDS / array.basename / "c"
    blocks = np.ndindex(*(-(-array.shape[i] // array.chunks[i]) for i in range(axis)))
    rest = [0] * (array.ndim - axis - 1)
    return [place / Path(*map(str, (*block, index, *rest))) for block in blocks]


def require_whole(folder: Path, arrays: Mapping[str, Any], count: int) -> None:
    """Raise FileError unless every chunk with one of the first `count` records is there in full length."""
    for array in arrays.values():
        size = int(np.prod(array.chunks)) * array.dtype.itemsize + 4
        for index in range(-(-count // array.chunks[along_time(array)])):
            for file in chunk_files(folder, array, index):
                found = file.stat().st_size if file.exists() else None
                if found != size:
                    state = "missing" if found is None else f"truncated: it has {found} bytes of {size}"
                    raise FileError(f"The file {file} of the run is {state}; {_DAMAGED}.")
