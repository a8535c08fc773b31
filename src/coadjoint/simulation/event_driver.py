"""The loop of a run with events: they are evaluated at every node, and crossings are located between nodes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.kernels.chunk import Chunk
from coadjoint.mechanics.state import State
from coadjoint.methods.program import EVENTS
from coadjoint.simulation.dense import DenseStep, part_of_step
from coadjoint.simulation.driver import PATIENCE, Driver
from coadjoint.simulation.events import Event
from coadjoint.simulation.plan import Plan, Position
from coadjoint.simulation.root_finding import AHEAD, candidates, crossings, from_zero


class Found(NamedTuple):
    """An event in the step from a node, after the part θ of it; `state` is the record there."""

    interval: int
    theta: float
    state: State


class EventDriver(Driver):
    """Runs a plan until its first event ends it, if one may, and collects the records at all others in `crossed`."""

    def __init__(self, plan: Plan, sink: Any, progress: bool | None, title: str, crossed: dict[str, list[State]]):
        super().__init__(plan, sink, progress, title)
        self.crossed = crossed

    def _stretch(self, position: Position, speed: float) -> None:
        """Run for about PATIENCE seconds, node by node, up to the first event that ends the run."""
        length = min(
            max(int(speed * PATIENCE), 1), self.plan.steps - position.steps, self.plan.capacity(position.state)
        )
        began = time.perf_counter()
        chunk = self._run(position.state, length, 1)
        values = self._values(position, chunk)
        end = self._first(chunk, values)
        self._collect(chunk, values, end)
        if end is not None:
            chunk = self._run(position.state, end.interval, 1) if end.interval else None
        position.seconds += time.perf_counter() - began
        self.taking = True
        if chunk is not None:
            self._take(position, chunk)
        if end is not None:
            self._end(position, end.theta)
        self.sink.checkpoint(position)
        self.taking = False

    def _values(self, position: Position, chunk: Chunk) -> np.ndarray:
        """The events at the nodes of a chunk and some ahead, (nodes, events): of those ahead, a few steps are tried."""
        rows = [chunk.monitors[EVENTS]]
        if not chunk.code:
            rows.append(self._run(chunk.final, AHEAD, 1).monitors[EVENTS])
        values = np.concatenate(rows)
        return values if position.steps else np.stack([from_zero(v) for v in values.T], axis=1)

    def _first(self, chunk: Chunk, values: np.ndarray) -> Found | None:
        """The event that ends the run; None where it does not happen in this chunk."""
        return next(found_in(self.plan, chunk.records, values, 0), None) if self.plan.until else None

    def _collect(self, chunk: Chunk, values: np.ndarray, end: Found | None) -> None:
        """Take up all other events before the end."""
        for index, (name, _) in enumerate(self.plan.events):
            if index == 0 and self.plan.until:
                continue
            for found in found_in(self.plan, chunk.records, values, index):
                if end is not None and (found.interval, found.theta) > (end.interval, end.theta):
                    break
                self.crossed[name].append(found.state)

    def _take(self, position: Position, chunk: Chunk) -> None:
        """Append those records of a chunk that are to be saved, and move to its end."""
        kept = np.flatnonzero((position.steps + np.arange(chunk.steps)) % self.plan.save_every == 0)
        chunk = unwatched(chunk, self.plan)
        if len(kept):
            rows = jax.tree.map(lambda leaf: leaf[kept], (chunk.records, dict(chunk.monitors)))
            self.sink.append(position.steps + kept, *rows)
        position.advance(chunk)

    def _end(self, position: Position, theta: float) -> None:
        """Take the part of a step that leads to the event."""
        chunk = unwatched(part_of_step(self.plan, position.state, theta, monitors=True), self.plan)
        if position.steps % self.plan.save_every == 0 and chunk.steps:
            self.sink.append(np.array([position.steps]), chunk.records, chunk.monitors)
        position.advance(chunk)
        position.event = float(position.state.t)

    def undo(self, position: Position) -> None:
        for name, states in self.crossed.items():
            self.crossed[name] = up_to(states, float(position.state.t), self.plan)

    def _last(self, position: Position) -> Chunk:
        return unwatched(super()._last(position), self.plan)


def found_in(plan: Plan, records: State, values: np.ndarray, index: int) -> Iterator[Found]:
    """The crossings of one event between the nodes of records, in order. values: (nodes and some ahead, events)."""
    event: Event = plan.events[index][1]
    v = values[:, index]
    for interval in candidates(v, min(len(records.t), len(v) - 1)):
        step = DenseStep(plan, jax.tree.map(lambda leaf, i=interval: leaf[i], records))
        for theta, rises in crossings(v, int(interval), lambda theta, step=step: float(step(theta)[1][index])):
            if event.counts(rises):
                yield Found(int(interval), theta, step(theta)[0])


def up_to(states: list[State], time: float, plan: Plan) -> list[State]:
    """Those of the records that a run has come to at a time."""
    return [state for state in states if (float(state.t) - time) * np.sign(plan.h) <= 0]


def unwatched(chunk: Chunk, plan: Plan) -> Chunk:
    """The chunk without the values of events, and without certificates where monitors are off."""
    names = [name for name in chunk.monitors if name != EVENTS]
    extrema = {name: limits for name, limits in chunk.extrema.items() if plan.monitors and name != EVENTS}
    return replace(chunk, monitors={name: chunk.monitors[name] for name in names}, extrema=extrema)
