"""Which steps of a run are judged: its first ones, some spread over it, and those where the motion changes most."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.mechanics.state import State
from coadjoint.simulation.driver import Sink

FIRST, SPREAD = 3, 16
"""How many records of the start are kept, and how many are spread evenly over the whole run; those after 4, 8, 16, …
saved nodes are kept too, for a run may end early."""

BLOCK = 1024
"""Chunks of fewer records wait for others."""

CHANGING = ("xi", "nu", "mu", "pi")
"""Of these the record is kept from which to the next one the change is largest."""


class Kept(NamedTuple):
    """Records with a leading axis, and their steps."""

    steps: np.ndarray
    records: State


def joined(parts: list[Kept]) -> Kept:
    """One after another."""
    if len(parts) == 1:
        return parts[0]
    records = jax.tree.map(lambda *leaves: np.concatenate(leaves), *(part.records for part in parts))
    return Kept(np.concatenate([part.steps for part in parts]), records)


class Largest(NamedTuple):
    """The largest change of a field from a record to the next: how large, and from which step."""

    change: float
    step: int


class Sampler:
    """A sink that keeps a few records on their way to another one.

    steps, save_every: those of the run, of which `done` are done already: what came then is not in the sample of a run
    that goes on. members: of an ensemble, which of them are kept.
    """

    def __init__(self, sink: Sink, steps: int, save_every: int, done: int = 0, members: np.ndarray | None = None):
        self.sink, self.members = sink, members
        nodes = -(-steps // save_every)
        powers = 2 ** np.arange(2, max(nodes, 4).bit_length())
        even = np.linspace(0, nodes, SPREAD + 1).astype(int)
        self._wanted = np.unique(np.concatenate([np.arange(FIRST), powers, even]))
        self._kept: list[Kept] = []
        self._first: list[int] = []
        self._spread: list[int] = []
        self._largest: dict[str, Largest] = {}
        self._seen = -(-done // save_every)
        self._before: Kept | None = None
        self._waiting: list[Kept] = []

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        given = Kept(np.asarray(steps), records)
        if self.members is None and sum(len(kept.steps) for kept in (*self._waiting, given)) < BLOCK:
            self._waiting.append(given)
        else:
            self._flush()
            self._take(given)
        self.sink.append(steps, records, monitors)

    def _flush(self) -> None:
        """Take the short chunks that wait."""
        if self._waiting:
            self._take(joined(self._waiting))
            self._waiting = []

    def _take(self, given: Kept) -> None:
        """Keep what belongs to the sample, which does not depend on how the run comes in chunks."""
        low, high = np.searchsorted(self._wanted, [self._seen, self._seen + len(given.steps)])
        nodes = self._wanted[low:high]
        for node, step in zip(nodes, given.steps[nodes - self._seen], strict=True):
            (self._first if node < FIRST else self._spread).append(int(step))
        index = {int(node) for node in nodes - self._seen}
        for field in CHANGING:
            index |= self._changing(field, given)
        inside = sorted(index - {-1})
        self._kept += [self._at(given, inside)] if inside else []
        self._kept += [self._at(self._before, [-1])] if -1 in index and self._before is not None else []
        self._before, self._seen = given, self._seen + len(given.steps)

    def _changing(self, field: str, given: Kept) -> set[int]:
        """The record, if any, after which a field changes more than anywhere before; −1 is the last one before."""
        values, found = self._values(given, field), set()
        if not values.size:
            return found
        pairs = [(0, values[1:], values[:-1])]
        if self._before is not None:
            pairs.insert(0, (-1, values[:1], self._values(self._before, field)[-1:]))
        for start, later, earlier in pairs:
            size = np.abs(later - earlier).ravel()
            i = int(size.argmax()) if size.size else 0
            if size.size and not np.isfinite(size[i]):
                i = int((size := np.nan_to_num(size)).argmax())
            if size.size and (field not in self._largest or size[i] > self._largest[field].change):
                at = start + i // values[0].size
                step = (given if at >= 0 or self._before is None else self._before).steps[at]
                self._largest[field] = Largest(float(size[i]), int(step))
                found = {at}
        return found

    def _values(self, given: Kept, field: str) -> np.ndarray:
        values = np.asarray(getattr(given.records, field))
        return values if self.members is None else values[:, self.members]

    def _at(self, given: Kept, index: list[int]) -> Kept:
        rows: Any = index if self.members is None else (np.array(index)[:, None], self.members)
        return Kept(given.steps[index], jax.tree.map(lambda leaf: np.asarray(leaf)[rows], given.records))

    def chosen(self, limit: int) -> Kept | None:
        """About `limit` of the kept records: the first ones, the most changing, the others evenly; None of none."""
        self._flush()
        if not self._kept:
            return None
        steps, records = joined(self._kept)
        row = {int(step): i for i, step in enumerate(steps)}
        found = {*self._first, *(largest.step for largest in self._largest.values())}
        others = [step for step in self._spread if step not in found]
        room = min(max(limit - len(found), 0), len(others))
        found |= {others[i] for i in np.linspace(0, len(others) - 1, room).astype(int)} if room else set()
        index = [row[step] for step in sorted(found)]
        return Kept(steps[index], jax.tree.map(lambda leaf: leaf[index], records))

    # What else a sink does is done by the other one.

    @property
    def seconds(self) -> float:
        return self.sink.seconds

    @property
    def length(self) -> int:
        return self.sink.length

    def checkpoint(self, position: Any) -> None:
        self.sink.checkpoint(position)

    def finish(self, position: Any) -> None:
        self.sink.finish(position)

    def release(self) -> None:
        self.sink.release()
