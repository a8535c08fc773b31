"""Reads arrays of a run's folder: lazily, only the files that its manifest lists, and only if they are unchanged.

No array is read before its metadata have been compared with the manifest and found plain: zarr format 3, numbers of a
fixed size, regular chunks, and the codecs `bytes` and `crc32c`. An array therefore takes no more memory than its files
take on disk, and numbers are read without the library zarr, whose import takes longer than a short run.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, TypeGuard

import numpy as np

from coadjoint.disk import reading
from coadjoint.errors import FileError, rephrased
from coadjoint.manifest import DAMAGED, Manifest, sums_up
from coadjoint.texts import Table

CODECS = ("bytes", "crc32c")
"""The codecs of every array, in their order."""


NUMBERS = ("bool", "int32", "int64", "float64", "complex128")
"""The types of numbers that arrays may hold."""


LARGEST = 1 << 20
"""Bytes of metadata at most."""


MANY = 64
"""How many times larger than their files arrays may be."""


_GROUP = {"zarr_format", "node_type", "attributes", "consolidated_metadata"}


_ARRAY = _GROUP - {"consolidated_metadata"} | {
    "shape", "data_type", "chunk_grid", "chunk_key_encoding", "fill_value", "codecs", "dimension_names",
    "storage_transformers",
}  # fmt: skip


@dataclass(frozen=True)
class StoredArray:
    """An array of the folder `place`, of which parts are read by integers and slices; metadata: those of its zarr.json.

    Reading raises FileError that names a file that differs from the manifest.
    """

    manifest: Manifest
    place: str
    basename: str
    metadata: Table

    @property
    def dims(self) -> tuple[str, ...]:
        """The names of the dimensions."""
        return tuple(self.metadata["dimension_names"])

    @property
    def attrs(self) -> Table:
        """Unit and meaning."""
        return self.metadata["attributes"]

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Numbers along each dimension."""
        return tuple(self.metadata["shape"])

    @cached_property
    def chunks(self) -> tuple[int, ...]:
        """Numbers of a chunk along each dimension."""
        return tuple(self.metadata["chunk_grid"]["configuration"]["chunk_shape"])

    @cached_property
    def dtype(self) -> np.dtype:
        """The type of the numbers, little-endian."""
        return np.dtype(self.metadata["data_type"]).newbyteorder("<")

    def __getitem__(self, key: Any) -> np.ndarray:
        given = key if isinstance(key, tuple) else (key,)
        given = [*given, *[slice(None)] * (len(self.shape) - len(given))]
        ranges = [_places(one, n) for one, n in zip(given, self.shape, strict=True)]
        box = [(min(span, default=0), max(span, default=-1) + 1) for span in ranges]
        found = np.empty([end - begin for begin, end in box], self.dtype)
        blocks = [range(begin // n, -(-end // n)) for (begin, end), n in zip(box, self.chunks, strict=True)]
        for index in product(*blocks):
            here = [(i * n, (i + 1) * n) for i, n in zip(index, self.chunks, strict=True)]
            both = [
                (max(*low), min(*high))
                for low, high in (zip(*pair, strict=True) for pair in zip(box, here, strict=True))
            ]
            into = tuple(slice(low - begin, high - begin) for (low, high), (begin, _) in zip(both, box, strict=True))
            of = tuple(slice(low - begin, high - begin) for (low, high), (begin, _) in zip(both, here, strict=True))
            found[into] = self._chunk(index)[of]
        steps = zip(given, ranges, strict=True)
        return found[tuple(slice(None, None, span.step) if isinstance(one, slice) else 0 for one, span in steps)]

    def _chunk(self, index: tuple[int, ...]) -> np.ndarray:
        """The numbers of a chunk, which must be listed and unchanged."""
        name = f"{self.place}/{self.basename}/c{''.join(f'.{i}' for i in index)}"
        self.manifest.require_size(name)
        path = self.manifest.path(name)
        with reading(path):
            data = path.read_bytes()
        self.manifest.require(name, data)
        if not sums_up(data):
            raise FileError(f"The file {path} does not have the checksum with which it ends: {DAMAGED}.")
        if len(data) != math.prod(self.chunks) * self.dtype.itemsize + 4:
            raise _strange(self.manifest, name, "has not the bytes of a chunk")
        return np.frombuffer(data[:-4], self.dtype).reshape(self.chunks)


def _places(index: Any, n: int) -> range:
    """The places of an integer or a slice among n."""
    found: Any = range(n)[index]
    return found if isinstance(found, range) else range(found, found + 1)


def arrays(manifest: Manifest, place: str) -> dict[str, StoredArray]:
    """The arrays of the folder `place` by their names, in the order in which they were declared.

    Values are checked when they are read. Raises FileError unless all of it is plain.
    """
    group = _metadata(manifest, place, "group", _GROUP)
    order = group["attributes"].get("order")
    if group.get("consolidated_metadata") is not None:
        raise _strange(manifest, place, "has consolidated metadata")
    if not isinstance(order, list) or not all(_is_name(name) for name in order) or len({*order}) != len(order):
        raise _strange(manifest, place, "does not list its arrays")
    return {name: StoredArray(manifest, place, name, _plain(manifest, f"{place}/{name}")) for name in order}


def require_chunks(manifest: Manifest, place: str, whole: bool) -> None:
    """Raise FileError unless the manifest has the chunks of all arrays, in the size that each array declares.

    If not `whole`, chunks may be missing, but arrays must not be much larger than their files.
    """
    declared = held = 0
    for name in _metadata(manifest, place, "group", _GROUP)["attributes"]["order"]:
        made = _metadata(manifest, f"{place}/{name}", "array", _ARRAY)
        chunks = made["chunk_grid"]["configuration"]["chunk_shape"]
        counts = [-(-n // chunk) for n, chunk in zip(made["shape"], chunks, strict=True)]
        size = math.prod(chunks) * np.dtype(made["data_type"]).itemsize + 4
        declared += math.prod(counts) * size
        if math.prod(counts) > MANY * (1 + len(manifest.files)):
            raise _strange(manifest, f"{place}/{name}", "declares more chunks than there are files")
        for index in np.ndindex(*counts):
            chunk = f"{place}/{name}/c.{'.'.join(map(str, index))}"
            if chunk in manifest.files:
                held += size
                if manifest.files[chunk][0] != size:
                    raise _strange(manifest, chunk, f"has not the {size} bytes of a chunk")
            elif whole:
                raise FileError(f"The file {manifest.folder / chunk} is not among those of the manifest: {DAMAGED}.")
    if declared > MANY * (held + LARGEST):
        raise _strange(manifest, place, "declares more numbers than its files hold")


def _metadata(manifest: Manifest, place: str, kind: str, known: set[str]) -> Table:
    """The content of zarr.json in a folder; raises FileError if it was changed or is of another kind."""
    name = f"{place}/zarr.json"
    manifest.require_size(name)
    if manifest.files[name][0] > LARGEST:
        raise _strange(manifest, name, "is too large")
    manifest.require(name)
    with rephrased(f"The file {manifest.folder / name} cannot be read", OSError, ValueError, RecursionError):
        found = json.loads(manifest.path(name).read_bytes())
    if not isinstance(found, dict) or found.get("zarr_format") != 3 or found.get("node_type") != kind:
        raise _strange(manifest, place, f"is no {kind} of zarr format 3")
    if not found.keys() <= known or not _is_plain(found.get("attributes")):
        raise _strange(manifest, place, "has metadata that coadjoint does not write")
    return found


def _plain(manifest: Manifest, place: str) -> Table:
    """The metadata of an array; raises FileError for one that the library does not write."""
    made = _metadata(manifest, place, "array", _ARRAY)
    codecs = [(one.get("name"), one.get("configuration") or {}) for one in _tables(made.get("codecs"))]
    little = all(given in ({}, {"endian": "little"}) for _, given in codecs)
    if tuple(name for name, _ in codecs) != CODECS or not little or made.get("storage_transformers"):
        raise _strange(manifest, place, f"has other codecs than {' and '.join(CODECS)}")
    if made.get("data_type") not in NUMBERS:
        raise _strange(manifest, place, "does not hold numbers of a fixed size")
    shape, grid = made.get("shape"), made.get("chunk_grid")
    chunks = grid["configuration"].get("chunk_shape") if _is_regular(grid) else None
    dims = made.get("dimension_names")
    if not _are_counts(shape, 0) or not _are_counts(chunks, 1) or len(shape) != len(chunks):
        raise _strange(manifest, place, "has no regular chunks")
    if made.get("chunk_key_encoding") != {"name": "default", "configuration": {"separator": "."}}:
        raise _strange(manifest, place, "has other names of chunks")
    if not isinstance(dims, list) or not all(map(_is_name, dims)) or len(dims) != len(shape):
        raise _strange(manifest, place, "does not name its dimensions")
    if not isinstance(made.get("fill_value"), (bool, int, float, str, list)):
        raise _strange(manifest, place, "has no fill value")
    return made


def _strange(manifest: Manifest, place: str, what: str) -> FileError:
    return FileError(f"{manifest.folder / place} was not written by coadjoint: it {what}.")


def _tables(found: Any) -> list[Mapping[str, Any]]:
    return [one if isinstance(one, dict) else {} for one in found] if isinstance(found, list) else []


def _is_regular(found: Any) -> TypeGuard[Table]:
    return isinstance(found, dict) and found.get("name") == "regular" and isinstance(found.get("configuration"), dict)


def _are_counts(found: Any, least: int) -> TypeGuard[list[int]]:
    return isinstance(found, list) and all(type(n) is int and least <= n < 2**40 for n in found) and len(found) <= 32


def _is_name(found: Any) -> bool:
    """Whether this names an array or dimension: the name of a file in its folder."""
    return (
        isinstance(found, str)
        and 0 < len(found) < 200
        and found.isprintable()
        and not {*found} & {"/", "\\"}
        and (not found.startswith("."))
    )


def _is_plain(found: Any) -> bool:
    """Whether attributes are texts, numbers, and lists of these, by names."""
    if not isinstance(found, dict):
        return False
    values = [one for value in found.values() for one in (value if isinstance(value, list) else [value])]
    return all(isinstance(one, (bool, int, float, str, type(None))) for one in values)


RECORDS = "records.zarr"
"""The folder of the records of a run."""


def along_time(array: StoredArray) -> int:
    """The axis of an array that counts the nodes: 1 if members come first."""
    return array.dims.index("time")


def chunk_names(array: StoredArray, index: int) -> list[str]:
    """The files of the chunks of an array with the block of nodes `index`: one, or one for each block of members."""
    axis = along_time(array)
    blocks = np.ndindex(*(-(-array.shape[i] // array.chunks[i]) for i in range(axis)))
    rest = [0] * (len(array.shape) - axis - 1)
    return [f"{RECORDS}/{array.basename}/c.{'.'.join(map(str, (*block, index, *rest)))}" for block in blocks]
