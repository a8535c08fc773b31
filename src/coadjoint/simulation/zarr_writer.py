"""The chunks of a stored run: rows of records in memory, written when a chunk is full, counted by the manifest."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from coadjoint import disk
from coadjoint.manifest import Manifest, checksum, entry
from coadjoint.simulation.zarr_reader import CODECS, RECORDS, StoredArray, along_time, arrays, chunk_names
from coadjoint.texts import Table


class Chunks:
    """The arrays of a folder's records and, of each, the rows of the chunk that is not full yet.

    There are `count` rows, written or in memory. A full chunk is written once; for a growing chunk the manifest counts
    the rows known then, which later versions of the chunk repeat.
    """

    def __init__(self, manifest: Manifest):
        self.manifest, self.count = manifest, 0
        self._arrays: dict[str, StoredArray] = {}
        self._block: dict[str, np.ndarray] = {}
        self._unsettled: set[Path] = set()

    @property
    def length(self) -> int:
        """The rows of a chunk, the same for all variables."""
        return self._arrays["time"].chunks[0]

    @property
    def partial(self) -> bool:
        """Whether the last chunk is not full."""
        return self.count % self.length > 0

    def open(self) -> None:
        """Find the arrays where the manifest's folder is now."""
        self._arrays = arrays(self.manifest, RECORDS)
        self._empty()

    def take_up(self, count: int) -> None:
        """Continue after `count` rows; the rows of a chunk that is not full are read back."""
        self.open()
        self.count = count
        if filled := count % self.length:
            for name, block in self._block.items():
                block[:filled] = _read(self._arrays[name], count - filled, count)

    def sweep(self) -> None:
        """Remove the hidden files of an interrupted writer."""
        root = self.manifest.folder
        for place in (root, *(path for path in (root / RECORDS).rglob("*") if path.is_dir())):
            disk.sweep(place)

    def place(self, values: Mapping[str, np.ndarray], rows: int) -> None:
        """Take rows of all variables, nodes first, and write the chunks that they fill."""
        done = 0
        while done < rows:
            at = self.count % self.length
            taken = min(self.length - at, rows - done)
            for name, block in self._block.items():
                block[at : at + taken] = values[name][done : done + taken]
            done, self.count = done + taken, self.count + taken
            if not self.partial:
                self.write()
                self._empty()

    def write(self, complete: bool = False) -> None:
        """Write the chunk of every variable that holds the last row; `complete`: no rows will follow."""
        index = (self.count - 1) // self.length
        rows = self.count - index * self.length
        growing = rows < self.length and not complete
        for name, array in self._arrays.items():
            block, size = self._block[name], 1
            if along_time(array):
                size = array.chunks[0]
                block = np.swapaxes(block, 0, 1)
            for place, name_of in enumerate(chunk_names(array, index)):
                part = block[place * size : (place + 1) * size] if along_time(array) else block
                self._write_chunk(name_of, _filled(part, array.chunks, array.dtype), size if growing else 0, rows)

    def settle(self) -> None:
        """Sync written files to disk, files before the folders of their names."""
        for path in sorted(self._unsettled, reverse=True):
            disk.settle(path)
        self._unsettled.clear()

    def _empty(self) -> None:
        for name, array in self._arrays.items():
            axis = along_time(array)
            shape = (self.length, *array.shape[:axis], *array.shape[axis + 1 :])
            self._block[name] = np.full(shape, unset(array.dtype), array.dtype)

    def _write_chunk(self, name: str, values: np.ndarray, blocks: int, rows: int) -> None:
        """Write a chunk with its checksum; for a growing chunk the manifest counts `rows` of each of its blocks."""
        data = values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
        data += checksum(data)
        used = rows * (len(data) - 4) // (blocks * self.length) if blocks else 0
        path, counted = self.manifest.folder / name, name in self.manifest.files
        # Rows that a manifest counts already must not be lost with the old version of the chunk.
        disk.write(path, [data], forced=counted, named=False)
        self.manifest.files[name] = entry(data, blocks, used)
        self._unsettled |= {path.parent} if counted else {path, path.parent}


def group_metadata(attributes: Table) -> bytes:
    """The zarr.json of a group (zarr format 3)."""
    return _json({"attributes": attributes, "zarr_format": 3, "node_type": "group"})


def array_metadata(
    shape: Sequence[int], chunks: Sequence[int], dtype: np.dtype, dims: Sequence[str], attributes: Table
) -> bytes:
    """The zarr.json of an array of numbers of a fixed size, whose chunks end with their CRC-32C (zarr format 3)."""
    fill = {"f": "NaN", "c": [-1.0, 0.0], "b": True}.get(dtype.kind, -1)
    to_bytes, to_sum = CODECS
    return _json(
        {
            "shape": list(shape),
            "data_type": dtype.name,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(chunks)}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "."}},
            "fill_value": fill,
            "codecs": [{"name": to_bytes, "configuration": {"endian": "little"}}, {"name": to_sum}],
            "attributes": attributes,
            "dimension_names": list(dims),
            "zarr_format": 3,
            "node_type": "array",
            "storage_transformers": [],
        }
    )


def _json(found: Table) -> bytes:
    return json.dumps(found, indent=2).encode()


def unset(dtype: Any) -> Any:
    """The value of rows that are not written yet, which is never shown."""
    return np.nan if np.dtype(dtype).kind == "f" else -1


def _filled(values: np.ndarray, shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """Values as a full chunk; entries beyond the array are unset."""
    if values.shape == shape:
        return values
    whole = np.full(shape, unset(dtype), dtype)
    whole[tuple(map(slice, values.shape))] = values
    return whole


def _read(array: StoredArray, begin: int, end: int) -> np.ndarray:
    """Rows of an array, nodes first."""
    return np.swapaxes(array[:, begin:end], 0, 1) if along_time(array) else array[begin:end]
