"""Runs that stream to disk: records in a zarr store, and a checkpoint from which a killed run goes on.

A folder of a run holds `configuration.npz` (what is run, with its fingerprint), `records.zarr` (the variables of
`run.dataset`, zarr format 3, every chunk with its CRC-32C), `checkpoint.npz` (where the run stands) and `lock`. Chunks
reach the disk before the checkpoint that counts them, and every file is replaced in one move: whenever the run is
killed, the records that the checkpoint counts are there.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import numpy as np
import zarr
from zarr.codecs import Crc32cCodec

from coadjoint.errors import FileError
from coadjoint.kernels.evaluate import evaluate, tabulate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.simulation import checkpoint as disk
from coadjoint.simulation.dataset import derived, meanings, variables
from coadjoint.simulation.driver import Plan, Position
from coadjoint.simulation.lock import Lock
from coadjoint.simulation.reading import CHECKPOINT, CONFIGURATION, RECORDS, chunk_file, opened_arrays, require_whole
from coadjoint.simulation.recording import umask

BATCH = 1024
"""Records whose derived variables are computed at once. Always this many, so that no value depends on which others
were computed beside it."""

BLOCK_BYTES, BLOCK_ROWS = 8 << 20, 8192
"""The most that a chunk of all variables together may take in memory."""

PERIOD, BURDEN = 2.0, 20.0
"""Seconds between checkpoints: PERIOD, or BURDEN times what writing the last one took, whichever is more."""


class Store:
    """A sink that streams records to a folder; its memory does not grow with the run."""

    def __init__(self, folder: Path, system: System, plan: Plan, start: State, identity: str, lock: Lock):
        self.folder, self.system, self.plan, self.start, self.identity = folder, system, plan, start, identity
        self.lock = lock
        self.attributes: Callable[[], Mapping[str, Any]] = dict
        self.count, self.seconds = 0, 0.0
        self.ends: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.last: State | None = None
        self._pending: list[tuple[np.ndarray, State, Mapping[str, np.ndarray]]] = []
        self._arrays: dict[str, Any] = {}
        self._block: dict[str, np.ndarray] = {}
        self._unsettled: set[Path] = set()
        self._derive: Callable[[State], dict[str, Any]] | None = None
        self._due, self._kept = 0.0, 0

    @property
    def total(self) -> int:
        """The number of records of the whole run: every save_every-th node before the last, and the last."""
        return -(-self.plan.steps // self.plan.save_every) + 1

    # A new folder, or one that holds a run.

    def lay_out(self, state: State) -> None:
        """Allocate all arrays, empty, for records like `state`."""
        rows = jax.tree.map(lambda leaf: np.asarray(leaf)[None], state)
        plan = self.plan
        seen = evaluate(plan.program.monitors, plan.constants, state, np.float64(plan.h)) if plan.monitors else {}
        found = self._variables(np.zeros(1, np.int64), rows, {name: np.asarray(x)[None] for name, x in seen.items()})
        size = sum(values[0].nbytes for _, values in found.values())
        length = max(1, min(BLOCK_ROWS, BLOCK_BYTES // size, self.total))
        told = meanings(found, self.system)
        group = zarr.create_group(self.folder / RECORDS, zarr_format=3, attributes={"order": list(found)})
        for name, (dims, values) in found.items():
            self._arrays[name] = group.create_array(
                name,
                shape=(self.total, *values.shape[1:]),
                chunks=(length, *values.shape[1:]),
                dtype=values.dtype,
                compressors=[Crc32cCodec()],
                fill_value=_unset(values.dtype),
                dimension_names=dims,
                attributes={**told.get(name, {})},
            )
        self._empty_block()

    def take_up(self, header: Mapping[str, Any], arrays: Mapping[str, np.ndarray], like: State) -> Position:
        """Go on where a checkpoint stands; raises FileError where records that it counts are missing or damaged."""
        position = disk.position_at(header, arrays, like)
        self._arrays = opened_arrays(self.folder, "r+")
        self.count = self._kept = header["records"]
        require_whole(self.folder, self._arrays, self.count)
        for partial in (self.folder / RECORDS).rglob("*.partial"):
            partial.unlink(missing_ok=True)
        self._empty_block()
        if filled := self.count % self._length:
            checked = opened_arrays(self.folder, "r")
            for name, block in self._block.items():
                block[:filled] = checked[name][self.count - filled : self.count]
        self.ends = {name: (arrays[f"first/{name}"], arrays[f"last/{name}"]) for name in header["monitors"]}
        self.last = disk.state_like("record", arrays, like) if self.count else None
        return position

    # The contract of a sink.

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        """Take records; they are written when a chunk is full or a checkpoint is due."""
        self._pending.append((steps, records, monitors))
        self.last = jax.tree.map(lambda rows: rows[-1], records)
        self.ends = {name: (self.ends.get(name, rows)[0], rows[-1]) for name, rows in monitors.items()}
        if sum(len(steps) for steps, _, _ in self._pending) >= self._length:
            with self._writing():
                self._absorb()

    def checkpoint(self, position: Position) -> None:
        """Write a checkpoint if one is due, or if the run has ended."""
        if position.complete or position.code or time.monotonic() >= self._due:
            self.finish(position)

    def finish(self, position: Position) -> None:
        """Write all records and a checkpoint."""
        began = time.monotonic()
        with self._writing():
            self._absorb()
            if self.count % self._length:
                self._write_block()
            for path in (*self._unsettled, *{path.parent for path in self._unsettled}):
                disk.settle(path)
            self._unsettled.clear()
            self._write_checkpoint(position)
        self._kept = self.count
        ended = time.monotonic()
        self._due = ended + max(PERIOD, BURDEN * (ended - began))

    def release(self) -> None:
        """Let other processes use the folder."""
        self.lock.release()

    # From records to rows, and from rows to chunks.

    @property
    def _length(self) -> int:
        """The rows of a chunk, the same for all variables."""
        return next(iter(self._arrays.values())).chunks[0]

    def _variables(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> dict[str, Any]:
        """`time`, `step` and the variables of `run.dataset`, BATCH rows at most."""
        rows = len(steps)

        def derive(records: State) -> dict[str, Any]:
            filled = jax.tree.map(lambda x: np.concatenate([x, np.repeat(x[-1:], BATCH - rows, axis=0)]), records)
            self._derive = self._derive or tabulate(derived, filled)
            return jax.tree.map(lambda x: x[:rows], self._derive(filled))

        found = variables(self.system, records, monitors, derive)
        time = self.start.t + self.plan.h * steps
        return {"time": (("time",), time), "step": (("time",), steps.astype(np.int64)), **found}

    def _absorb(self) -> None:
        if not self._pending:
            return
        steps, records, monitors = jax.tree.map(lambda *parts: np.concatenate(parts), *self._pending)
        self._pending.clear()
        for start in range(0, len(steps), BATCH):
            part = slice(start, start + BATCH)
            cut = jax.tree.map(lambda x, part=part: x[part], (steps, records, dict(monitors)))
            self._place({name: values for name, (_, values) in self._variables(*cut).items()}, len(cut[0]))

    def _place(self, values: Mapping[str, np.ndarray], rows: int) -> None:
        done = 0
        while done < rows:
            at = self.count % self._length
            taken = min(self._length - at, rows - done)
            for name, block in self._block.items():
                block[at : at + taken] = values[name][done : done + taken]
            done, self.count = done + taken, self.count + taken
            if self.count % self._length == 0:
                self._write_block()
                self._empty_block()

    def _empty_block(self) -> None:
        for name, array in self._arrays.items():
            self._block[name] = np.full(array.chunks, _unset(array.dtype), array.dtype)

    def _write_block(self) -> None:
        """Write the chunk of every variable that holds the last row."""
        index = (self.count - 1) // self._length
        begin = index * self._length
        end = min(begin + self._length, self.total)
        for name, array in self._arrays.items():
            array[begin:end] = self._block[name][: end - begin]
            self._unsettled.add(chunk_file(self.folder, array, index))

    def _write_checkpoint(self, position: Position) -> None:
        header, arrays = disk.position_numbers(position)
        header |= {"identity": self.identity, "records": self.count, "monitors": list(self.ends)}
        header["attributes"] = {name: _plain(value) for name, value in self.attributes().items()}
        arrays |= {} if self.last is None else disk.state_numbers("record", self.last)
        for name, (first, last) in self.ends.items():
            arrays[f"first/{name}"], arrays[f"last/{name}"] = first, last
        disk.write(self.folder / CHECKPOINT, header, arrays)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        began = time.monotonic()
        try:
            yield
        except FileError:
            raise
        except OSError as error:
            raise FileError(
                f"The run stops, for {self.folder} could not be written: {error.strerror or error}; its first "
                f"{self._kept:,} records are kept there: mend this, then go on with co.resume or `coadjoint resume`."
            ) from error
        finally:
            self.seconds += time.monotonic() - began


def create(
    path: Path, system: System, plan: Plan, start: State, state: State, configuration: tuple[Mapping[str, Any], Any]
) -> Store:
    """A new folder for a run from `state`, complete with its first checkpoint; it appears in one move."""
    require_free(path)
    header, numbers = configuration
    made: Path | None = None
    try:
        made = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}."))
        made.chmod(0o777 & ~umask())
        store = Store(made, system, plan, start, header["identity"], Lock(made))
        store.lay_out(state)
        disk.write(made / CONFIGURATION, header, numbers)
        store._write_checkpoint(Position(state))
        made.replace(path)
    except OSError as error:
        if made is not None:
            shutil.rmtree(made, ignore_errors=True)
        raise FileError(f"The folder {path} cannot be made: {error.strerror or error}.") from error
    disk.settle(path.parent)
    store.folder = path
    store._arrays = opened_arrays(path, "r+")
    store._due = time.monotonic() + PERIOD
    return store


def require_free(path: Path) -> None:
    """Raise FileError unless a new run may be put at `path`."""
    try:
        held, other = (path / CONFIGURATION).exists(), path.exists() and (not path.is_dir() or any(path.iterdir()))
        home = path.parent.is_dir()
    except OSError as error:
        raise FileError(f"The folder {path} cannot be looked at: {error.strerror or error}.") from error
    if held:
        raise FileError(
            f"The folder {path} holds a run already: continue it with co.resume, or choose another folder for `store`."
        )
    if other:
        raise FileError(f"Argument `store` must name a new or empty folder, but {path} holds something else.")
    if not home:
        raise FileError(f"The folder {path.parent} does not exist: make it first.")


def _unset(dtype: Any) -> Any:
    """What stands in rows that are not written yet: it is never shown."""
    return np.nan if np.dtype(dtype).kind == "f" else -1


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
