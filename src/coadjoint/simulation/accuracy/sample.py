"""The judged steps of a run: its first ones, some spread over it, and those where the motion changes most."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.mechanics.state import State
from coadjoint.simulation.accuracy.ruler import steps_of
from coadjoint.simulation.plan import AnyPosition, Plan
from coadjoint.simulation.sinks import RecordSink

FIRST, SPREAD = 3, 16
"""The number of records kept from the start, and the number spread evenly over the run. The records after 4, 8, 16, …
saved nodes are also kept, because a run may end early."""


CHANGING = ("xi", "nu", "mu", "pi")
"""For each of these, the sample keeps the record from which the change to the next one is largest."""


MOMENTA = ("mu", "pi")
"""For each of these, the sample keeps the record where it is largest: local errors are relative to its size there, and
to displacements over a step, which are large where it is."""


KINDS = (*CHANGING, *(f"largest {field}" for field in MOMENTA))
"""The extrema that the sample follows."""


BLOCK = 4096
"""Chunks of fewer records, those of all members counted, wait for others."""

ROOM = 1 << 18
"""The numbers of the records that are compared together, some megabytes."""


PARTS = 64
"""The number of times that records are kept before unneeded ones are dropped."""


class Kept(NamedTuple):
    """Records as rows of numbers, (k, size) or (k, members, size), and their steps (k,)."""

    steps: np.ndarray
    rows: np.ndarray


class Before(NamedTuple):
    """The last examined record, the last one of `records`, and its step."""

    step: int
    records: State


class Largest(NamedTuple):
    """The largest change of a field from a record to the next, or the largest size of a momentum, and its step."""

    size: float
    step: int


class Sampler:
    """A sink that keeps a few records; the choice does not depend on the chunks.

    kept: the sink whose checkpoints hold the sample. steps: those of the run. save_every: the cadence of its records.
    members: the kept members of an ensemble.
    """

    seconds, length = 0.0, sys.maxsize

    def __init__(self, kept: RecordSink, steps: int, save_every: int, members: np.ndarray | None = None):
        self.members = members
        nodes = -(-steps // save_every)
        powers = 2 ** np.arange(2, max(nodes, 4).bit_length())
        even = np.linspace(0, nodes, SPREAD + 1).astype(int)
        found = np.unique(np.concatenate([np.arange(FIRST), powers, even]))
        self._first, self._wanted = save_every * np.arange(FIRST), np.minimum(save_every * found, steps)
        self._kept: list[Kept] = []
        self._largest: dict[str, Largest] = {}
        self._before: Before | None = None
        self._waiting: list[tuple[np.ndarray, State]] = []
        kept.sample = self.numbers
        if kept.sampled and kept.last is not None:
            self._go_on(kept.sampled, kept.last)

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        if len(steps):
            self._waiting.append((np.asarray(steps), records))
            if sum(np.size(records.t) for _, records in self._waiting) >= BLOCK:
                self._flush()

    def _flush(self) -> None:
        """Examine the records since the last call; their places are counted over all waiting chunks."""
        chunks, self._waiting = self._waiting, []
        if not chunks:
            return
        steps = np.concatenate([steps for steps, _ in chunks])
        place = np.searchsorted(steps, self._wanted)
        inside = place < len(steps)
        place = place[inside]
        index = {*place[steps[place] == self._wanted[inside]].tolist()}
        index |= self._extreme(steps, [{field: self._values(x, field) for field in CHANGING} for _, x in chunks])
        if -1 in index and self._before is not None:
            self._keep(np.array([self._before.step]), self._before.records, np.array([-1]))
        here, start = np.array(sorted(index - {-1}), int), 0
        for given, records in chunks:
            low, high = np.searchsorted(here, [start, start + len(given)])
            if low < high:
                self._keep(given[here[low:high] - start], records, here[low:high] - start)
            start += len(given)
        self._before = Before(int(steps[-1]), chunks[-1][1])
        if len(self._kept) > PARTS:
            self._drop()

    def _extreme(self, steps: np.ndarray, parts: list[dict[str, np.ndarray]]) -> set[int]:
        """The records with the largest changes and momenta, if larger than any earlier; −1 is the last one before."""
        found: dict[str, Largest] = {}
        held = self._before
        last = None if held is None else np.concatenate([self._values(held.records, f)[-1].ravel() for f in CHANGING])
        shapes = {field: values.shape[1:] for field, values in parts[0].items()}
        ends = np.cumsum([0, *(math.prod(shape) for shape in shapes.values())])
        together = min(len(steps), max(ROOM // max(int(ends[-1]), 1), 1))
        room = np.empty((ends[-1], together))
        for first, seen, columns in _blocks(parts, last, together):
            change = room[:, : columns.shape[1] - 1]
            np.abs(np.subtract(columns[:, 1:], columns[:, :-1], out=change), out=change)
            for field, start, end in zip(CHANGING, ends, ends[1:], strict=False):
                _widen(found, field, change[start:end], first)
                if field in MOMENTA:
                    lengths = _lengths(columns[start:end, seen:], shapes[field])
                    _widen(found, f"largest {field}", lengths, first + seen)
        index = set()
        for kind, (size, place) in found.items():
            if kind not in self._largest or size > self._largest[kind].size:
                at = held.step if place < 0 and held is not None else steps[place]
                self._largest[kind] = Largest(size, int(at))
                index.add(place)
        return index

    def _values(self, records: State, field: str) -> np.ndarray:
        values = np.asarray(getattr(records, field))
        return values if self.members is None else values[:, self.members]

    def _keep(self, steps: np.ndarray, records: State, index: np.ndarray) -> None:
        """Keep some of the records as rows of numbers."""
        leaves = [np.asarray(leaf)[index] for leaf in jax.tree.leaves(records)]  # `take` would copy all rows
        if self.members is None:
            rows = [leaf.reshape(len(index), -1) for leaf in leaves]
        else:
            rows = [leaf[:, self.members].reshape(len(index), len(self.members), -1) for leaf in leaves]
        self._kept.append(Kept(steps, np.concatenate(rows, axis=-1, dtype=np.float64)))

    def _drop(self) -> None:
        """Keep each of the records that are wanted once, in their order, as one part."""
        steps = np.concatenate([kept.steps for kept in self._kept])
        rows = np.concatenate([kept.rows for kept in self._kept])
        wanted = {*self._wanted.tolist(), *self._extremes()}
        once, index = np.unique(steps, return_index=True)
        index = index[[step in wanted for step in once.tolist()]]
        self._kept = [Kept(steps[index], rows[index])]

    def chosen(self, limit: int) -> Kept | None:
        """About `limit` of the kept records: the first, the most changing and the largest, then others evenly."""
        self._flush()
        if not self._kept:
            return None
        self._drop()
        steps, rows = self._kept[0]
        first = {*self._first.tolist(), *self._extremes()}
        always = np.array([step in first for step in steps.tolist()], bool)
        others = np.flatnonzero(~always)
        room = min(max(limit - int(always.sum()), 0), len(others))
        some = others[np.linspace(0, len(others) - 1, room).astype(int)] if room else others[:0]
        index = np.sort(np.concatenate([np.flatnonzero(always), some]))
        return Kept(steps[index], rows[index])

    def _extremes(self) -> list[int]:
        """The steps of the records with the largest changes and momenta."""
        return [largest.step for largest in self._largest.values()]

    @property
    def changing(self) -> list[int]:
        """The distinct steps of the records after which the momenta, then the velocities, change most."""
        fields = [field for field in reversed(CHANGING) if field in self._largest]
        return list(dict.fromkeys(self._largest[field].step for field in fields))

    # An interrupted run continues with the sample in its checkpoint.

    def numbers(self) -> dict[str, np.ndarray]:
        """The sample so far, for a checkpoint."""
        self._flush()
        if not self._kept or self._before is None:
            return {}
        self._drop()
        largest = [self._largest.get(kind, (-1.0, -1)) for kind in KINDS]
        steps, rows = self._kept[0]
        return {"steps": steps, "rows": rows, "largest": np.array(largest), "before": np.array(self._before.step)}

    def _go_on(self, numbers: Mapping[str, np.ndarray], last: State) -> None:
        """Continue the sample of a checkpoint; `last` is the record before it."""
        self._kept = [Kept(numbers["steps"], numbers["rows"])]
        found = zip(KINDS, numbers["largest"], strict=False)  # earlier checkpoints hold changes alone
        self._largest = {kind: Largest(float(x), int(step)) for kind, (x, step) in found if step >= 0}
        self._before = Before(int(numbers["before"]), jax.tree.map(lambda leaf: np.asarray(leaf)[None], last))

    def checkpoint(self, position: AnyPosition) -> None:
        """Nothing: the sink of the records asks for the sample."""

    def finish(self, position: AnyPosition, complete: bool = True) -> None:
        """Nothing."""

    def release(self) -> None:
        """Nothing."""


def _blocks(
    parts: list[dict[str, np.ndarray]], last: np.ndarray | None, together: int
) -> Iterator[tuple[int, int, np.ndarray]]:
    """The fields of all records, `together` records at a time, a row a number: NumPy is slow along an axis of three.

    A block (numbers, k) begins with the last record of the one before, if any: the index of its first record, how many
    of its records were in an earlier one, and its numbers, until the next one. last: those of the record of index −1.
    """
    index, room = 0, np.empty((sum(math.prod(values.shape[1:]) for values in parts[0].values()), together + 1))
    for part in parts:
        sizes = [math.prod(values.shape[1:]) for values in part.values()]
        for start in range(0, len(part[CHANGING[0]]), together):
            fields = [values[start : start + together] for values in part.values()]
            count, seen = len(fields[0]), int(last is not None)
            columns = room[:, : seen + count]
            if last is not None:
                columns[:, 0] = last
            for end, size, values in zip(np.cumsum(sizes), sizes, fields, strict=True):
                columns[end - size : end, seen:] = values.reshape(count, size).T
            yield index - seen, seen, columns
            last = columns[:, -1].copy()
            index += count


def _lengths(columns: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The norms (…, k) of k vectors along the last axis of `shape`, of which `columns` has a row a number."""
    squares = (columns * columns).reshape(*shape, columns.shape[-1])
    if shape[-1] >= 8:  # in the order of NumPy for numbers in a row
        return np.sqrt(np.add.reduce(np.ascontiguousarray(np.swapaxes(squares, -1, -2)), axis=-1))
    return np.sqrt(np.add.reduce(squares, axis=-2))


def _widen(found: dict[str, Largest], kind: str, sizes: np.ndarray, first: int) -> None:
    """Enter the largest of sizes (…, k) of records from the index `first` on, if larger than the one found."""
    if not sizes.size:
        return
    most = np.maximum.reduce(sizes.reshape(-1, sizes.shape[-1]), axis=0)
    if not math.isfinite(most[place := int(most.argmax())]):
        most = np.nan_to_num(sizes).reshape(-1, sizes.shape[-1]).max(axis=0)
        place = int(most.argmax())
    if kind not in found or most[place] > found[kind].size:
        found[kind] = Largest(float(most[place]), first + place)


SHARE = 0.05
"""The largest share of a run's steps that are run again."""


def with_steps_between(kept: Kept, largest: list[int], plan: Plan, state: State, members: PyTree = None) -> Kept:
    """The kept records, and from the stretches that start at the steps `largest` those after which a step changes most.

    state: one, for its layout. members: of an ensemble, those that were kept. By XLA, where
    each length of a stretch would be compiled, and where every step is saved, the kept records alone.
    """
    left = int(SHARE * plan.steps)
    if plan.save_every == 1 or plan.backend != "native" or min(left, len(largest)) < 1:
        return kept
    model = steps_of(plan, state)
    places = model.layout.places
    found = dict(zip(kept.steps.tolist(), kept.rows, strict=True))
    for step in largest:
        length = min(plan.save_every, plan.steps - step, left)
        if length < 2:
            continue
        left -= length
        rows = found[step]
        records = model.records(np.atleast_2d(rows), plan.h, length, members)
        change = np.nan_to_num(np.abs(np.diff(records, axis=1)).max(axis=0))
        for field in CHANGING:
            numbers = np.ravel(getattr(places, field))
            if numbers.size:
                place = int(change[:, numbers].max(axis=1).argmax())
                found[step + place] = records[:, place].reshape(rows.shape)
    steps = np.array(sorted(found))
    return Kept(steps, np.stack([found[step] for step in steps.tolist()]))
