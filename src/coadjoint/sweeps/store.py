"""The store of a sweep: a zarr group of all members, laid out first, in which each task writes chunks of its own.

A folder of a sweep holds `run.toml` (the sweep with its run file), `inputs/` (what that names), `members.zarr`,
`statistics.nc`, figures, `summary.json` and `manifest.json`. While it is at work `unfinished` has `plan.json` and, of
each task that is done, `shards/NUMBER.npz`: its statistics, and the sign that all its chunks are on the disk. Every
array has one chunk for each task, so that no two tasks ever write to one file.
"""

from __future__ import annotations

import contextlib
import json
import os
import uuid
from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import zarr
from zarr.codecs import Crc32cCodec

from coadjoint import disk
from coadjoint.errors import FileError
from coadjoint.report.folder import UNFINISHED
from coadjoint.simulation.chunks import unset
from coadjoint.sweeps.sketch import Sketch

if TYPE_CHECKING:
    from coadjoint.sweeps.task import Shard

MEMBERS, STATISTICS, PLAN, SHARDS = "members.zarr", "statistics.nc", "plan.json", "shards"

Layout = Mapping[str, tuple[tuple[str, ...], tuple[int, ...], str, Mapping[str, Any]]]
"""Dimensions, shape, kind of number and attributes of each array, by name."""


def lay_out(folder: Path, layout: Layout, size: int, attributes: Mapping[str, Any]) -> None:
    """Make the arrays, empty, with chunks of `size` members; nothing where they are there already."""
    path = folder / MEMBERS
    if path.exists():
        return
    made = disk.partial(path)
    disk.remove(made)
    group = zarr.create_group(made, zarr_format=3, attributes={**attributes, "order": list(layout)})
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
    disk.move(made, path)


def write(folder: Path, number: int, first: int, shard: Shard, kept: bool) -> None:
    """Put a shard into the store: its chunks, forced to the disk, then the sign that they are there.

    The same task again writes the same bytes. Raises FileError where this cannot be done.
    """
    place = folder / UNFINISHED / SHARDS
    try:
        if kept:
            _write_members(folder / MEMBERS, number, first, {**shard.members, **(shard.nodes or {})})
        if not place.is_dir():
            raise FileError(
                f"The folder {place} is gone: the sweep has ended, or was deleted while a task was at work."
            )
        _put(place / f"{number:06d}.npz", _packed(shard))
    except FileError:
        raise
    except OSError as error:
        raise FileError(
            f"A task could not write to {folder}: {error.strerror or error}; mend this, then the same command again "
            "goes on with what is missing."
        ) from error


def _write_members(path: Path, number: int, first: int, values: Mapping[str, np.ndarray]) -> None:
    group = zarr.open_group(path, mode="r+")
    for name, rows in values.items():
        array: Any = group[name]
        array[first : first + len(rows)] = rows
        chunk = path / name / ".".join(["c", str(number), *("0" for _ in rows.shape[1:])])
        if chunk.exists():  # One that holds nothing but its fill value is not written.
            disk.settle(chunk)
        disk.settle(path / name)


def _put(path: Path, data: bytes) -> None:
    """Write a file whole, under a name of its own first: another worker may be at the same task."""
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


def _packed(shard: Shard) -> bytes:
    good, counts = shard.members["code"], np.unique_counts(shard.members["code"])
    header = {
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
    return stream.getvalue()


def done(folder: Path) -> set[int]:
    """The tasks whose shards are in the store."""
    return {int(path.stem) for path in (folder / UNFINISHED / SHARDS).glob("[0-9]*.npz")}


class Statistics:
    """What a shard left beside the results of its members."""

    def __init__(self, path: Path):
        try:
            with np.load(path) as found:
                self._arrays = dict(found)
        except (OSError, ValueError) as error:
            raise FileError(
                f"The file {path} is damaged: delete it, and the same command computes it again."
            ) from error
        self.header: dict[str, Any] = json.loads(self._arrays["header"].tobytes())
        self.times = self._arrays["times"]

    def sketches(self) -> dict[str, Sketch]:
        """The statistics of results by name."""
        return {name: Sketch.read(self._arrays, name) for name in self.header["sketches"]}

    def courses(self) -> dict[str, list[Sketch]]:
        """The statistics at each node of variables by name."""
        nodes = self.header["courses"]
        return {name: [Sketch.read(self._arrays, f"{name}@{k}") for k in range(n)] for name, n in nodes.items()}


def statistics(folder: Path, tasks: int) -> Iterable[Statistics]:
    """Those of all shards, in their order."""
    for number in range(tasks):
        yield Statistics(folder / UNFINISHED / SHARDS / f"{number:06d}.npz")


def plan(folder: Path) -> dict[str, Any] | None:
    """What a sweep that was interrupted had planned; None where it had not."""
    path = folder / UNFINISHED / PLAN
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise FileError(f"The file {path} is damaged: begin the sweep again with --overwrite.") from error


def write_plan(folder: Path, made: Mapping[str, Any]) -> None:
    """Put the plan into the folder of a sweep, and make room for its shards."""
    disk.make(folder / UNFINISHED / SHARDS)
    disk.write(folder / UNFINISHED / PLAN, [json.dumps(made, indent=1).encode()])
