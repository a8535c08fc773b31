"""Sinks, which take the records of a run, and the cadence at which each of them takes some."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.mechanics.state import State
from coadjoint.simulation.plan import AnyPosition


class Sink(Protocol):
    """Where records go; `seconds` is the time that this took, `length` the most nodes of an ensemble in one call."""

    @property
    def seconds(self) -> float: ...

    @property
    def length(self) -> int: ...

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        """Take the records at these step indices, with one row of every monitor each."""
        ...

    def checkpoint(self, position: AnyPosition) -> None:
        """All records up to `position` have been appended: make sure that a run can continue from there."""
        ...

    def finish(self, position: AnyPosition, complete: bool = True) -> None:
        """Make sure of all records up to `position`; `complete` where the run has ended and is judged."""
        ...

    def release(self) -> None:
        """End the use of the sink; no records follow."""
        ...


class RecordSink(Sink, Protocol):
    """A sink that keeps the records, in memory or on disk, and a sample of them from which the run can be continued.

    `sample` gives the sample so far, `sampled` is the sample that was read, and `last` is the last record.
    """

    sample: Callable[[], Mapping[str, np.ndarray]]
    sampled: Mapping[str, np.ndarray]
    last: State | None


@dataclass(frozen=True)
class Scheduled:
    """A sink, and the cadence at which it takes records: every `every`-th node from the start on, and the last one."""

    sink: Sink
    every: int


class Calls(Protocol):
    """A function that is called at a cadence with `values` of the nodes after step `seen`, and may end the run."""

    every: int
    seen: int
    values: Callable[[State, Mapping[str, np.ndarray]], PyTree]

    def __call__(self, step: int, time: float, value: PyTree) -> bool: ...


class Outputs:
    """The outputs of a run. `every`: the common cadence at which the run makes records for them."""

    def __init__(self, outputs: Sequence[Scheduled], calls: Sequence[Calls] = ()):
        self.outputs, self.calls = tuple(outputs), tuple(calls)
        self.every = math.gcd(*(one.every for one in (*self.outputs, *self.calls)))
        self._sinks = [one.sink for one in self.outputs]

    @property
    def seconds(self) -> float:
        """The time that the sinks took."""
        return sum(sink.seconds for sink in self._sinks)

    @property
    def length(self) -> int:
        """The most nodes of an ensemble that all of them take in one call."""
        return min(sink.length for sink in self._sinks)

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray], last: bool = False) -> None:
        """Give each sink those of the records at these steps that are due at its cadence; all of them the last one."""
        for one in self.outputs:
            due = np.flatnonzero(steps % one.every == 0)
            if len(steps) and (last or len(due) == len(steps)):
                one.sink.append(steps, records, monitors)
            elif len(due):
                rows = jax.tree.map(lambda leaf, due=due: leaf[due], (records, dict(monitors)))
                one.sink.append(steps[due], *rows)

    def end(
        self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray], last: bool = False
    ) -> int | None:
        """Call the functions that are due at these nodes, in order, up to the node at which one ends the run: its row.

        None if none does. `last`: all of them are due.
        """
        ready: dict[int, list[tuple[Calls, PyTree]]] = {}
        for one in self.calls:
            rows = np.flatnonzero((steps > one.seen) & (last | (steps % one.every == 0)))
            if len(rows):
                values = one.values(*jax.tree.map(lambda leaf, rows=rows: leaf[rows], (records, dict(monitors))))
                for index, row in enumerate(rows):
                    value = jax.tree.map(lambda leaf, index=index: leaf[index], values)
                    ready.setdefault(int(row), []).append((one, value))
        for row in sorted(ready):
            time = float(np.nanmax(records.t[row]))
            ends = [one(int(steps[row]), time, value) for one, value in ready[row]]  # all are called
            if any(ends):
                return row
        return None

    def cut(self, step: int) -> None:
        """Discard what sinks in memory hold from a step on."""
        for sink in self._sinks:
            if isinstance(sink, Memory):
                sink.cut(step)

    def checkpoint(self, position: AnyPosition) -> None:
        """All records up to `position` have been given."""
        for sink in self._sinks:
            sink.checkpoint(position)

    def finish(self, position: AnyPosition, complete: bool = True) -> None:
        """Make sure of all records up to `position`; `complete` where the run has ended and is judged."""
        for sink in self._sinks:
            sink.finish(position, complete)

    def release(self) -> None:
        """End the use of all sinks."""
        for sink in self._sinks:
            sink.release()


class Memory:
    """A sink that keeps everything."""

    seconds = 0.0
    length = sys.maxsize
    complete = False
    sampled: Mapping[str, np.ndarray] = MappingProxyType({})
    last: State | None = None

    def __init__(self) -> None:
        self.sample: Callable[[], Mapping[str, np.ndarray]] = dict
        self.steps: list[np.ndarray] = []
        self.records: list[State] = []
        self.monitors: list[Mapping[str, np.ndarray]] = []

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        self.steps.append(steps)
        self.records.append(records)
        self.monitors.append(monitors)

    def cut(self, step: int) -> None:
        """Discard the records from a step on, and incomplete records left by an interrupt."""
        good = min(len(self.steps), len(self.records), len(self.monitors))
        good = sum(bool(steps[0] < step) for steps in self.steps[:good])
        for rows in (self.steps, self.records, self.monitors):
            del rows[good:]

    def checkpoint(self, position: AnyPosition) -> None:
        pass

    def finish(self, position: AnyPosition, complete: bool = True) -> None:
        pass

    def release(self) -> None:
        pass
