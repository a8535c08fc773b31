"""Runs that stream to disk: records in a zarr store, and a checkpoint from which a killed run continues.

A folder of a run holds `configuration.npz` (the problem), `records.zarr` (the variables of `run.dataset`, zarr format
3, every chunk with its CRC-32C), alternately `checkpoint-0.npz` and `checkpoint-1.npz` (the position of the run), and
`manifest.json`, which lists the valid content: every file with its SHA-256, the fingerprint, and the checkpoint. A
`lock` exists while a process uses the folder.

The order of writes. At the beginning: all files under a hidden name, files and folders synced to disk, then one move.
At each checkpoint: chunks, synced to disk with the names in their folders; the checkpoint that the manifest does not
name, synced to disk; the manifest, synced to disk under a hidden name and moved. This move makes the new records valid.
Until then the old manifest is valid: full chunks are written once, and for the last, partly filled chunk a manifest
counts the rows known then, which later versions of the chunk repeat. Thus a run that is killed at any moment leaves a
folder from which it continues with bitwise identical results.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import numpy as np

from coadjoint import disk
from coadjoint.arrays import PyTree
from coadjoint.errors import FileError
from coadjoint.kernels.run.backend import monitor_shapes
from coadjoint.log import logger
from coadjoint.manifest import Manifest, entry
from coadjoint.mechanics.energy_scale import largest_kinetic
from coadjoint.mechanics.state import State
from coadjoint.methods.program import EVENTS, Constants
from coadjoint.methods.step import in_records
from coadjoint.simulation import configuration
from coadjoint.simulation.dataset import Variables, meanings, member_variables, members_of, variables
from coadjoint.simulation.derived import derivation, times
from coadjoint.simulation.lock import Lock
from coadjoint.simulation.plan import AnyPosition
from coadjoint.simulation.result import Result
from coadjoint.simulation.zarr_reader import RECORDS
from coadjoint.simulation.zarr_writer import Chunks, array_metadata, group_metadata

_log = logger(__name__)

BLOCK_BYTES, BLOCK_ROWS = 8 << 20, 8192
"""The most memory, and the most rows, of a chunk of all variables together."""

FLUSH_BYTES = 32 << 20
"""The most memory for the chunks of all members of an ensemble, written together, unless they hold one node."""

PERIOD, BURDEN = 2.0, 20.0
"""Seconds between checkpoints: PERIOD, or BURDEN times the time for writing the last one, whichever is more."""


class Store:
    """A sink that streams records to a folder; its memory does not grow with the run.

    Those of `members` have a second axis, of members; on the disk it is the first.
    """

    def __init__(self, run: Result, manifest: Manifest, lock: Lock | None):
        self.manifest = manifest
        self.system, self.plan, self.start = run.system, run.plan, run.start
        self.members = run.plan.members
        self.lock = lock
        self.attributes: Callable[[], Mapping[str, Any]] = dict
        self.sample: Callable[[], Mapping[str, np.ndarray]] = dict
        self.sampled: Mapping[str, np.ndarray] = {}
        self.seconds = 0.0
        self.ends: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.last: State | None = None
        self.kinetic: np.ndarray | float = 0.0
        self._pending: list[tuple[np.ndarray, State, Mapping[str, np.ndarray]]] = []
        self._chunks = Chunks(manifest)
        self._slot = 0
        self._derive = derivation(run.plan.program)
        self._due, self._kept = 0.0, 0

    @property
    def folder(self) -> Path:
        """Where the run is."""
        return self.manifest.folder

    @property
    def count(self) -> int:
        """The records that were taken."""
        return self._chunks.count

    @property
    def length(self) -> int:
        """The records of a chunk."""
        return self._chunks.length

    @property
    def complete(self) -> bool:
        """Whether the run has ended and its complete certificate is written."""
        return bool(self.manifest.facts.get("complete"))

    # A new folder, or one that holds a run.

    def lay_out(self, constants: Constants, state: State) -> None:
        """Allocate all arrays, empty, for records like `state`, which belongs to one member."""
        rows = jax.tree.map(lambda leaf: np.asarray(leaf)[None], in_records(state))
        backend = self.plan.backend if self.members is None else "xla"  # the kernel of many does not know one
        shapes = monitor_shapes(self.plan.program, constants, state, backend) if self.plan.monitors else {}
        seen = {name: np.zeros((1, *shape)) for name, shape in shapes.items() if name != EVENTS}
        found = {**self._grid(np.zeros(1, np.int64), rows), **variables(self.system, rows, seen, self._of_first)}
        known = meanings(found, self.system)
        length, across = self._blocks(sum(values[0].nbytes for _, values in found.values()))
        self.put(f"{RECORDS}/zarr.json", group_metadata({"order": list(found)}))
        for name, (dims, values) in found.items():
            lead = () if self.members is None or name in ("time", "step") else (self.members,)
            made = array_metadata(
                shape=(*lead, self.plan.nodes, *values.shape[1:]),
                chunks=(*(across for _ in lead), length, *values.shape[1:]),
                dtype=values.dtype,
                dims=(*("member" for _ in lead), *dims),
                attributes={**known.get(name, {})},
            )
            self.put(f"{RECORDS}/{name}/zarr.json", made)
        self._open()

    def _blocks(self, size: int) -> tuple[int, int]:
        """How many nodes and how many members a chunk holds, where a record takes `size` bytes."""
        if self.members is None:
            return max(1, min(BLOCK_ROWS, BLOCK_BYTES // size, self.plan.nodes)), 1
        length = max(1, min(BLOCK_ROWS, FLUSH_BYTES // (size * self.members), self.plan.nodes))
        return length, max(1, min(self.members, BLOCK_BYTES // (size * length)))

    def put(self, name: str, data: bytes) -> None:
        """Write a file of the folder and enter it into the manifest."""
        path = self.folder / name
        disk.make(path.parent)
        disk.write(path, [data])
        self.manifest.files[name] = entry(data)

    def _open(self) -> None:
        self._chunks.open()
        self._due = time.monotonic() + PERIOD

    def take_up(self, header: Mapping[str, Any], arrays: Mapping[str, np.ndarray], begun: PyTree) -> PyTree:
        """Continue from a checkpoint; raises FileError if records that it counts are damaged.

        `begun` is the position of the run at its start.
        """
        position = configuration.position_at(header, arrays, begun)
        self._due, self._kept = time.monotonic() + PERIOD, header["records"]
        self._chunks.take_up(self._kept)
        if self.lock is not None:
            self._chunks.sweep()
        self.ends = {name: (arrays[f"first/{name}"], arrays[f"last/{name}"]) for name in header["monitors"]}
        self.last = configuration.state_like("record", arrays, in_records(begun.state)) if self.count else None
        sampled = ((name.partition("/"), numbers) for name, numbers in arrays.items())
        self.sampled = {name: numbers for (kind, _, name), numbers in sampled if kind == "sample"}
        self.kinetic = arrays.get("kinetic", 0.0)
        self._slot = int(self.manifest.facts["checkpoint"] == _checkpoint(0))
        return position

    def move_to(self, folder: Path) -> None:
        """Stream to `folder`, which is where all of it is now."""
        self.manifest.folder = folder
        self._open()

    # The contract of a sink.

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        """Take records; they are written when a chunk is full or a checkpoint is due."""
        self._pending.append((steps, records, monitors))
        self.last = jax.tree.map(lambda rows: rows[-1], records)
        self.kinetic = np.fmax(self.kinetic, largest_kinetic(records))
        self.ends = {name: (self.ends.get(name, rows)[0], rows[-1]) for name, rows in monitors.items()}
        if sum(len(steps) for steps, _, _ in self._pending) >= self.length:
            with self._writing():
                self._absorb()

    def checkpoint(self, position: AnyPosition) -> None:
        """Write a checkpoint if one is due, or if the run has ended."""
        if position.ended or time.monotonic() >= self._due:
            self.finish(position, complete=False)

    def finish(self, position: AnyPosition, complete: bool = True) -> None:
        """Write all records and a checkpoint; `complete`: the last one, with the complete certificate."""
        began = time.monotonic()
        with self._writing():
            self._absorb()
            if self._chunks.partial:
                self._chunks.write(complete)
            self._chunks.settle()
            self.write_checkpoint(position, complete)
        self._kept = self.count
        ended = time.monotonic()
        self._due = ended + max(PERIOD, BURDEN * (ended - began))
        _log.debug("%s: checkpoint at %d of %d records.", self.folder, self.count, self.plan.nodes)

    def release(self) -> None:
        """Let other processes use the folder."""
        if self.lock is not None:
            self.lock.release()

    # From records to rows, and from rows to chunks.

    def _grid(self, steps: np.ndarray, records: State) -> Variables:
        time = times(self.plan.program, self.start, self.plan.h, steps, records)
        return {"time": (("time",), time), "step": (("time",), steps.astype(np.int64))}

    def _variables(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> Variables:
        """`time`, `step` and the variables of `run.dataset`."""
        grid = self._grid(steps, records)
        if self.members is None:
            return {**grid, **variables(self.system, records, monitors, self._of_first)}
        return {**grid, **member_variables(self.system, records, monitors, self._derive, members_of(records, 1))}

    def _of_first(self, records: State) -> dict[str, object]:
        """Quantities derived from the records of a run, or of the first member."""
        return self._derive(self.system.parameters, records)

    def _absorb(self) -> None:
        if not self._pending:
            return
        steps, records, monitors = jax.tree.map(lambda *parts: np.concatenate(parts), *self._pending)
        self._pending.clear()
        found = self._variables(steps, records, monitors)
        self._chunks.place({name: values for name, (_, values) in found.items()}, len(steps))

    def write_checkpoint(self, position: AnyPosition, complete: bool = False) -> None:
        """Write the position of the run, and the manifest that counts it."""
        header, arrays = configuration.position_numbers(position)
        header |= {"records": self.count, "monitors": list(self.ends)}
        header["attributes"] = {name: _plain(value) for name, value in self.attributes().items()}
        arrays |= {} if self.last is None else configuration.state_numbers("record", self.last)
        for name, (first, last) in self.ends.items():
            arrays[f"first/{name}"], arrays[f"last/{name}"] = first, last
        arrays |= {f"sample/{name}": numbers for name, numbers in self.sample().items()}
        arrays["kinetic"] = np.asarray(self.kinetic)
        before, now = _checkpoint(1 - self._slot), _checkpoint(self._slot)
        self.put(now, configuration.packed(header, arrays))
        self.manifest.files.pop(before, None)
        self.manifest.facts |= {"checkpoint": now, "records": self.count, "complete": complete}
        self.manifest.write()
        self._slot = 1 - self._slot
        if complete:
            disk.remove(self.folder / before)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        began = time.monotonic()
        try:
            self._require_there()
            yield
        except FileError:
            raise
        except OSError as error:
            self._require_there()
            raise FileError(
                f"The run stops, for {self.folder} could not be written: {error.strerror or error}; its first "
                f"{self._kept:,} records are kept there: mend this, then go on with co.resume or `coadjoint resume`."
            ) from error
        finally:
            self.seconds += time.monotonic() - began

    def _require_there(self) -> None:
        """Raise FileError if the folder was deleted, or another was put in its place."""
        if self.lock is not None and not self.lock.held:
            raise FileError(
                f"The run stops, for its folder {self.folder} was deleted or moved while it ran: begin it again, or "
                "move the folder back and go on with co.resume or `coadjoint resume`."
            )


def _checkpoint(slot: int) -> str:
    return f"checkpoint-{slot}.npz"


def _plain(value: object) -> PyTree:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
