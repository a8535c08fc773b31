"""The store of a sweep: a zarr group of all members, laid out first, in which each task writes separate chunks.

A folder of a sweep holds `run.toml` (the sweep with its run file), `inputs/` (the files that it names), `members.zarr`,
`statistics.nc`, figures, `summary.json` and `manifest.json`, which has the SHA-256 of all others. During the sweep
`unfinished/shards` has a file for each finished task: its statistics, the SHA-256 of its chunks, and the sign that all
of them are on the disk. Every array has one chunk for each task, so that no two tasks ever write to one file.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.codecs import Crc32cCodec
from zarr.storage import MemoryStore

from coadjoint import disk
from coadjoint.archives import stored_arrays
from coadjoint.disk import reading
from coadjoint.errors import FileError, rephrased
from coadjoint.manifest import Manifest, checksum, entry
from coadjoint.report.folder import UNFINISHED
from coadjoint.simulation.zarr_writer import unset
from coadjoint.sweeps.sketch import Sketch
from coadjoint.texts import Table


@dataclass
class Shard:
    """The results of a task: results of members by name, statistics, and the causes of failures."""

    members: dict[str, np.ndarray]
    sketches: dict[str, Sketch]
    courses: dict[str, list[Sketch]]
    times: np.ndarray
    refusals: dict[int, str]
    warnings: dict[str, int]
    events: int = 0
    kernel: float = 0.0
    seconds: float = 0.0
    nodes: dict[str, np.ndarray] | None = None


MEMBERS, STATISTICS, SHARDS = "members.zarr", "statistics.nc", "shards"


WHOLE = ("code", "steps_done")
"""The integer arrays, int64; all others are float64."""


Layout = Mapping[str, tuple[tuple[str, ...], tuple[int, ...], str, Mapping[str, Any]]]
"""Dimensions, shape, kind of number and attributes of each array, by name."""


def lay_out(manifest: Manifest, layout: Layout, size: int, attributes: Mapping[str, Any]) -> None:
    """Put the metadata of the arrays into the folder and the manifest; chunks are of `size` members."""
    made: Table = {}
    group = zarr.create_group(MemoryStore(made), zarr_format=3, attributes={**attributes, "order": list(layout)})
    for name, (dims, shape, dtype, attrs) in layout.items():
        group.create_array(
            name,
            shape=shape,
            chunks=tuple(size if dim == "member" else max(n, 1) for dim, n in zip(dims, shape, strict=True)),
            dtype=dtype,
            compressors=[Crc32cCodec()],
            chunk_key_encoding={"name": "default", "separator": "."},
            fill_value=unset(np.dtype(dtype)),
            dimension_names=dims,
            attributes=dict(attrs),
        )
    for key, data in made.items():
        name, content = f"{MEMBERS}/{key}", data.to_bytes()
        disk.make((manifest.folder / name).parent)
        disk.write(manifest.folder / name, [content])
        manifest.files[name] = entry(content)


def write(folder: Path, number: int, size: int, shard: Shard, kept: bool) -> None:
    """Put a shard into the store: its chunks, of `size` members, synced to disk, then the sign that they exist.

    The same task again writes the same bytes. Raises FileError if this fails.
    """
    place = folder / UNFINISHED / SHARDS
    again = "correct this, then the same command again continues with the missing tasks"
    with rephrased(f"A task could not write to {folder}", then=again):
        values = {**shard.members, **(shard.nodes or {})} if kept else {}
        files = dict(_write_chunk(folder, name, number, size, rows) for name, rows in values.items() if rows.size)
        if not place.is_dir():
            raise FileError(
                f"The folder {place} is gone: the sweep has ended, or was deleted while a task was at work."
            )
        _put(place / _shard(number), _packed(shard, files))


def _write_chunk(folder: Path, array: str, number: int, size: int, rows: np.ndarray) -> tuple[str, list[Any]]:
    """Write the chunk of an array that belongs to a task: returns its name, and its entry in the manifest."""
    dtype = np.dtype("<i8" if array in WHOLE else "<f8")
    filled = np.full((size, *rows.shape[1:]), unset(dtype), dtype)
    filled[: len(rows)] = rows
    data = filled.tobytes()
    data += checksum(data)
    name = f"{MEMBERS}/{array}/{'.'.join(['c', str(number), *('0' for _ in rows.shape[1:])])}"
    _put(folder / name, data)
    return name, entry(data)


def _put(path: Path, data: bytes) -> None:
    """Write a file atomically, under a separate name first: another worker may compute the same task."""
    hidden = path.with_name(f".{uuid.uuid4().hex}{disk.PARTIAL}")
    try:
        with open(hidden, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        disk.move(hidden, path)
    finally:
        with contextlib.suppress(OSError):
            hidden.unlink()


def _shard(number: int) -> str:
    return f"{number:06d}.shard"


def _packed(shard: Shard, files: Mapping[str, list[Any]]) -> bytes:
    """A shard as bytes, the SHA-256 of all others in front. files: its chunks, as entries of the manifest."""
    good, counts = shard.members["code"], np.unique_counts(shard.members["code"])
    header = {
        "files": files,
        "members": len(good),
        "codes": {str(code): int(n) for code, n in zip(counts.values, counts.counts, strict=True)},
        "refusals": {str(member): sentence for member, sentence in list(shard.refusals.items())[:20]},
        "warnings": shard.warnings,
        "events": shard.events,
        "kernel": shard.kernel,
        "seconds": shard.seconds,
        "sketches": list(shard.sketches),
        "courses": {name: len(nodes) for name, nodes in shard.courses.items()},
    }
    arrays = {"header": np.frombuffer(json.dumps(header).encode(), np.uint8), "times": shard.times}
    for name, sketch in shard.sketches.items():
        arrays |= sketch.numbers(name)
    for name, nodes in shard.courses.items():
        for k, sketch in enumerate(nodes):
            arrays |= sketch.numbers(f"{name}@{k}")
    stream = BytesIO()
    np.savez(stream, **arrays)  # pyright: ignore[reportArgumentType]
    return hashlib.sha256(stream.getvalue()).digest() + stream.getvalue()


def done(folder: Path) -> set[int]:
    """The tasks whose shards are in the store."""
    return {int(path.stem) for path in (folder / UNFINISHED / SHARDS).glob(f"[0-9]*{Path(_shard(0)).suffix}")}


def problems(folder: Path, number: int) -> list[str]:
    """The problems of the shard of a task and of its chunks, a sentence each."""
    try:
        return [*Manifest(folder, {}, Statistics(folder, number).header["files"]).problems()]
    except FileError as error:
        return [str(error)]


def discard_damaged(folder: Path) -> None:
    """Remove shards that have changed, or whose chunks have: their tasks are then missing."""
    for number in done(folder):
        if problems(folder, number):
            disk.remove(folder / UNFINISHED / SHARDS / _shard(number))


def enter_chunks(manifest: Manifest, tasks: int) -> None:
    """Take the chunks of all tasks into the manifest, as they were written; raises FileError for one that has
    changed."""
    for number in range(tasks):
        manifest.files |= Statistics(manifest.folder, number).header["files"]
    names = [name for name in manifest.files if name.startswith(f"{MEMBERS}/")]
    for place in {manifest.path(name).parent for name in names}:
        disk.sweep(place)
    for name in names:
        manifest.require(name)


class Statistics:
    """The data of a shard other than the results of its members; raises FileError if it is damaged."""

    def __init__(self, folder: Path, number: int):
        path = folder / UNFINISHED / SHARDS / _shard(number)
        with reading(path):
            data = path.read_bytes()
        damaged = FileError(f"The file {path} is damaged: the same command again recomputes it.")
        if hashlib.sha256(data[32:]).digest() != data[:32]:
            raise damaged
        try:
            self._arrays = stored_arrays(data[32:])
            self.header: Table = json.loads(self._arrays["header"].tobytes())
            self.times = self._arrays["times"]
        except (ValueError, KeyError, RecursionError) as error:
            raise damaged from error

    def sketches(self) -> dict[str, Sketch]:
        """The statistics of results by name."""
        return {name: Sketch.read(self._arrays, name) for name in self.header["sketches"]}

    def courses(self) -> dict[str, list[Sketch]]:
        """The statistics at each node of variables by name."""
        nodes = self.header["courses"]
        return {name: [Sketch.read(self._arrays, f"{name}@{k}") for k in range(n)] for name, n in nodes.items()}


def statistics(folder: Path, tasks: int) -> Iterable[Statistics]:
    """Those of all shards, in their order."""
    return (Statistics(folder, number) for number in range(tasks))
