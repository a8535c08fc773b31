"""The judged steps of a run: its first ones, some spread over it, and those where the motion changes most."""

from __future__ import annotations

import sys
from collections.abc import Mapping
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
        for field in CHANGING:
            parts = [self._values(records, field) for _, records in chunks]
            index |= self._changing(field, steps, parts)
            if field in MOMENTA:
                index |= self._extreme(f"largest {field}", steps, _lengths(np.concatenate(parts)))
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

    def _changing(self, field: str, steps: np.ndarray, parts: list[np.ndarray]) -> set[int]:
        """The record, if any, after which a field changes more than anywhere before; −1 is the last one before."""
        before = 0 if self._before is None else 1
        if self._before is not None:
            parts = [self._values(self._before.records, field)[-1:], *parts]
        values = np.concatenate(parts)
        change = values[1:] - values[:-1]
        return self._extreme(field, steps, np.abs(change, out=change), before)

    def _extreme(self, kind: str, steps: np.ndarray, sizes: np.ndarray, before: int = 0) -> set[int]:
        """The record with the largest of `sizes` (k, …), if larger than any earlier; `before`: those before `steps`."""
        if not sizes.size:
            return set()
        flat = sizes.ravel()
        if not np.isfinite(flat[largest := int(flat.argmax())]):
            largest = int((flat := np.nan_to_num(flat)).argmax())
        if kind in self._largest and flat[largest] <= self._largest[kind].size:
            return set()
        index = largest // sizes[0].size - before
        at = self._before.step if index < 0 and self._before is not None else steps[index]
        self._largest[kind] = Largest(float(flat[largest]), int(at))
        return {index}

    def _values(self, records: State, field: str) -> np.ndarray:
        values = np.asarray(getattr(records, field))
        return values if self.members is None else values[:, self.members]

    def _keep(self, steps: np.ndarray, records: State, index: np.ndarray) -> None:
        """Keep some of the records as rows of numbers."""
        leaves = [np.asarray(leaf).take(index, axis=0) for leaf in jax.tree.leaves(records)]
        if self.members is None:
            rows = [leaf.reshape(len(index), -1) for leaf in leaves]
        else:
            rows = [leaf[:, self.members].reshape(len(index), len(self.members), -1) for leaf in leaves]
        self._kept.append(Kept(steps, np.concatenate(rows, axis=-1, dtype=np.float64)))

    def _drop(self) -> None:
        """Keep each of the records that are wanted once, in their order, as one part."""
        steps = np.concatenate([kept.steps for kept in self._kept])
        rows = np.concatenate([kept.rows for kept in self._kept])
        extreme = [largest.step for largest in self._largest.values()]
        once, index = np.unique(steps, return_index=True)
        index = index[np.isin(once, np.concatenate([self._wanted, extreme]))]
        self._kept = [Kept(steps[index], rows[index])]

    def chosen(self, limit: int) -> Kept | None:
        """About `limit` of the kept records: the first, the most changing and the largest, then others evenly."""
        self._flush()
        if not self._kept:
            return None
        self._drop()
        steps, rows = self._kept[0]
        extreme = [largest.step for largest in self._largest.values()]
        always = np.isin(steps, np.concatenate([self._first, extreme]))
        others = np.flatnonzero(~always)
        room = min(max(limit - int(always.sum()), 0), len(others))
        some = others[np.linspace(0, len(others) - 1, room).astype(int)] if room else others[:0]
        index = np.sort(np.concatenate([np.flatnonzero(always), some]))
        return Kept(steps[index], rows[index])

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


def _lengths(values: np.ndarray) -> np.ndarray:
    """The norms of vectors along the last axis."""
    return np.sqrt(np.sum(values**2, axis=-1))


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
