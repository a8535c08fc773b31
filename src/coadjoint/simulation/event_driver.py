"""The loop of a run with events: they are evaluated at every node, and crossings are located between nodes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.chunk import EnsembleChunk
from coadjoint.mechanics.state import State
from coadjoint.methods.program import EVENTS
from coadjoint.simulation import driver
from coadjoint.simulation.dense import DenseStep, part_of_step
from coadjoint.simulation.events import AHEAD, Event, candidates, crossings, from_zero
from coadjoint.simulation.plan import MembersPosition, Plan
from coadjoint.simulation.sinks import Outputs


class Found(NamedTuple):
    """An event in the step from a node, after the part θ of it; `state` is the record there."""

    interval: int
    theta: float
    state: State


class EventDriver(driver.Driver):
    """Runs a plan until its first event ends it, if one may, and collects the records at all others in `crossed`.

    crossed: name → states; of an ensemble, name → those of each member.
    """

    def __init__(
        self, plan: Plan, outputs: Outputs, progress: bool | None, title: str, crossed: dict[str, list[PyTree]]
    ):
        super().__init__(plan, outputs, progress, title)
        self.crossed = crossed

    def _stretch(self, position: PyTree, speed: float) -> None:
        """Run for about PATIENCE seconds, node by node, up to the first event that ends the run."""
        wished, left = max(int(speed * driver.PATIENCE), 1), self.plan.steps - position.steps
        length, began = min(wished, left, self._capacity(position)), time.perf_counter()
        self._advance(position, self.run(position.state, length, 1), length, began)

    def _advance(self, position: PyTree, chunk: PyTree, length: int, began: float) -> None:
        """Process a chunk up to the event that ends the run."""
        ahead = None if chunk.code else self.run(chunk.final, AHEAD, 1).monitors[EVENTS]
        end, crossed = look(self.plan, chunk.records, values(position, chunk.monitors[EVENTS], ahead))
        for name, states in crossed.items():
            self.crossed[name] += states
        if end is not None:
            chunk = self.run(position.state, end.interval, 1) if end.interval else None
        position.seconds += time.perf_counter() - began
        chunk = self._up_to_call(position, chunk)
        self.taking = True
        if chunk is not None:
            self._take(position, unwatched(chunk, self.plan), chunk.steps)
        if end is not None and not position.halted:
            part = unwatched(part_of_step(self.plan, position.state, end.theta, monitors=True), self.plan)
            self._take(position, part, part.steps)
            position.event = float(position.state.t)
        if position.halted:
            self.undo(position)
        self.outputs.checkpoint(position)
        self.taking = False

    def _up_to_call(self, position: PyTree, chunk: PyTree) -> PyTree:
        """The chunk up to the node at which a function of an output ends the run; None if it is the first one."""
        if chunk is None or not self.outputs.calls:
            return chunk
        seen = unwatched(chunk, self.plan)
        found = jax.tree.map(lambda leaf: leaf[: chunk.steps], self._rows(seen))
        end = self.outputs.end(position.steps + np.arange(chunk.steps), *found)
        position.halted = end is not None
        return chunk if end is None else self.run(position.state, end, 1) if end else None

    def _take(self, position: PyTree, chunk: PyTree, steps: int) -> None:
        """Append the records of a chunk, one at each node, and move to its end."""
        records, monitors = jax.tree.map(lambda leaf: leaf[:steps], self._rows(chunk))
        self.outputs.append(position.steps + np.arange(steps), records, monitors)
        position.advance(chunk, steps)

    def undo(self, position: PyTree) -> None:
        for name, states in self.crossed.items():
            self.crossed[name] = up_to(states, float(position.state.t), self.plan)

    def _last(self, position: PyTree) -> Any:
        return unwatched(super()._last(position), self.plan)


class MembersEvents(EventDriver):
    """Runs all members, each until its first event ends it, if one may; collects the records at all others.

    A member that has ended keeps its place in the arrays: its records are NaN from there on, its state at the event is
    in `ended`, its time in the position.
    """

    def __init__(
        self, plan: Plan, outputs: Outputs, progress: bool | None, title: str, crossed: dict[str, list[PyTree]],
        ended: dict[int, State],
    ):  # fmt: skip
        super().__init__(plan, outputs, progress, title, crossed)
        self.ended = ended

    def drive(self, position: PyTree) -> None:
        self.times = position.event = np.full(len(position.codes), np.nan)
        super().drive(position)

    def _advance(self, position: PyTree, chunk: EnsembleChunk, length: int, began: float) -> None:
        """Process a chunk up to the end of the last member."""
        rows_kept = self._members(position, chunk, self.run(chunk.final, AHEAD, 1))
        chunk = without_events(chunk, self.plan, rows_kept)
        position.seconds += time.perf_counter() - began
        if len(self.ended) == len(position.codes):  # how far a chunk goes beyond that depends on the clock
            length = max(int(chunk.steps.max()) + 1, 1)
        self.taking = True
        self._take(position, chunk, length)
        self.outputs.checkpoint(position)
        self.taking = False

    def _members(self, position: MembersPosition, chunk: EnsembleChunk, ahead: EnsembleChunk) -> dict[int, int]:
        """The number of records of the chunk kept for each ended member; collects all events up to its end."""
        kept: dict[int, int] = dict.fromkeys(self.ended, 0)
        for index in map(int, np.flatnonzero((position.codes == 0) & np.isnan(self.times))):
            here, there = (part.monitors[EVENTS][index, : part.rows[index]] for part in (chunk, ahead))
            seen = values(position, here, None if chunk.code[index] else there)
            records = jax.tree.map(lambda leaf, i=index: leaf[i, : chunk.rows[i]], chunk.records)
            end, crossed = look(replace(self.plan, constants=self.plan.constants_of(index)), records, seen)
            for name, states in crossed.items():
                self.crossed[name][index] += states
            if end is not None:
                kept[index], self.ended[index], self.times[index] = end.interval + 1, end.state, end.state.t
        return kept

    def _last(self, position: PyTree) -> EnsembleChunk:
        return without_events(self.run(position.state, 1, 1), self.plan, dict.fromkeys(self.ended, 0))

    def undo(self, position: PyTree) -> None:
        for index, here in enumerate(position.state.t):
            for states in self.crossed.values():
                states[index] = up_to(states[index], float(here), self.plan)
            if index in self.ended and not up_to([self.ended[index]], float(here), self.plan):
                self.times[index] = np.nan
                del self.ended[index]


def values(position: PyTree, here: np.ndarray, ahead: np.ndarray | None) -> np.ndarray:
    """The events at the nodes of a chunk and some ahead, (nodes, events); from zero where the run starts there."""
    found = here if ahead is None else np.concatenate([here, ahead])
    return found if position.steps else np.stack([from_zero(v) for v in found.T], axis=1)


def look(plan: Plan, records: State, seen: np.ndarray) -> tuple[Found | None, dict[str, list[State]]]:
    """The event that ends a run, None if it does not occur at these records, and the states at all events before it."""
    end = next(found_in(plan, records, seen, 0), None) if plan.until else None

    def before(found: Found) -> bool:
        return end is None or (found.interval, found.theta) <= (end.interval, end.theta)

    crossed = {
        name: [found.state for found in takewhile(before, found_in(plan, records, seen, index))]
        for index, (name, _) in enumerate(plan.events)
        if index or not plan.until
    }
    return end, crossed


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
    """The records that a run has reached by a time."""
    return [state for state in states if (float(state.t) - time) * np.sign(plan.h) <= 0]


def unwatched(chunk: PyTree, plan: Plan) -> Any:
    """The chunk without the values of events, and without certificates where monitors are off."""
    names = [name for name in chunk.monitors if name != EVENTS]
    extrema = {name: limits for name, limits in chunk.extrema.items() if plan.monitors and name != EVENTS}
    return replace(chunk, monitors={name: chunk.monitors[name] for name in names}, extrema=extrema)


def without_events(chunk: EnsembleChunk, plan: Plan, rows_kept: dict[int, int]) -> EnsembleChunk:
    """The chunk without values of events; members that have ended keep only the rows in `rows_kept`.

    The extrema of such a member are those of its records; residuals are those of the complete chunk.
    """
    chunk = unwatched(chunk, plan)
    records, monitors, extrema = jax.tree.map(np.array, (chunk.records, chunk.monitors, chunk.extrema))
    steps, code, iterations = chunk.steps.copy(), chunk.code.copy(), chunk.iterations.copy()
    for index, rows in rows_kept.items():
        for leaf in jax.tree.leaves((records, monitors)):
            leaf[index, rows:] = np.nan
        done = max(rows - 1, 0)
        iterations[index] = iterations[index] * done // max(steps[index], 1)
        steps[index], code[index] = done, 0
        for name, (low, high) in extrema.items():
            if not rows:
                low[index], high[index] = np.inf, -np.inf
            elif name in monitors:
                seen = monitors[name][index, :rows]
                low[index], high[index] = np.min(seen, axis=0), np.max(seen, axis=0)
    return replace(
        chunk, records=records, monitors=monitors, extrema=extrema, steps=steps, code=code, iterations=iterations
    )
