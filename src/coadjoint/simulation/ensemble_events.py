"""The loop of an ensemble with events: those of every member are located on its own dense output."""

from __future__ import annotations

import time
from dataclasses import replace

import jax
import numpy as np

from coadjoint.kernels.chunk import EnsembleChunk
from coadjoint.mechanics.state import State
from coadjoint.methods.program import EVENTS
from coadjoint.simulation.driver import PATIENCE
from coadjoint.simulation.ensemble_driver import EnsembleDriver, nodes_first
from coadjoint.simulation.event_driver import Found, found_in, up_to
from coadjoint.simulation.plan import MembersPosition, Plan, Sink
from coadjoint.simulation.root_finding import AHEAD, from_zero

Crossed = dict[str, list[list[State]]]


class EnsembleEvents(EnsembleDriver):
    """Runs all members, each until its first event ends it, if one may; collects the records at all others.

    A member that has ended keeps its place in the arrays: its records are NaN from there on, its state at the event is
    in `ended`, its time in the position.
    """

    def __init__(
        self, plan: Plan, sink: Sink, progress: bool | None, title: str, crossed: Crossed,
        ended: dict[int, State],
    ):  # fmt: skip
        super().__init__(plan, sink, progress, title)
        self.crossed, self.ended = crossed, ended

    def drive(self, position: MembersPosition) -> None:
        self.times = position.event = np.full(len(position.codes), np.nan)
        super().drive(position)

    def _goes_on(self, position: MembersPosition) -> bool:
        return super()._goes_on(position) and len(self.ended) < len(position.codes)

    def _stretch(self, position: MembersPosition, speed: float) -> None:
        """Run for about PATIENCE seconds, node by node; no further than the end of the last member."""
        wished = max(int(speed * PATIENCE), 1)
        length = min(wished, self.plan.steps - position.steps, self._capacity)
        began = time.perf_counter()
        chunk = self._watched(position, self._run(position.state, length, 1))
        position.seconds += time.perf_counter() - began
        if len(self.ended) == len(position.codes):  # how far a chunk goes beyond that depends on the clock
            length = max(int(chunk.steps.max()) + 1, 1)
        self.taking = True
        self._take(position, chunk, length)
        self.taking = False

    def _last(self, position: MembersPosition) -> EnsembleChunk:
        return self._without(super()._last(position), dict.fromkeys(self.ended, 0))

    def undo(self, position: MembersPosition) -> None:
        for index, here in enumerate(position.state.t):
            for states in self.crossed.values():
                states[index] = up_to(states[index], float(here), self.plan)
            if index in self.ended and not up_to([self.ended[index]], float(here), self.plan):
                self.times[index] = np.nan
                del self.ended[index]

    def _watched(self, position: MembersPosition, chunk: EnsembleChunk) -> EnsembleChunk:
        """The chunk up to the events that end members, which are taken up with all others."""
        ahead = self._run(chunk.final, AHEAD, 1)
        rows_kept: dict[int, int] = dict.fromkeys(self.ended, 0)
        for index in np.flatnonzero((position.codes == 0) & np.isnan(self.times)):
            rows = chunk.monitors[EVENTS][index, : chunk.rows[index]]
            if not chunk.code[index]:
                rows = np.concatenate([rows, ahead.monitors[EVENTS][index, : ahead.rows[index]]])
            if not position.steps:
                rows = np.stack([from_zero(v) for v in rows.T], axis=1)
            if (end := self._look(int(index), chunk, rows)) is not None:
                rows_kept[int(index)], self.ended[int(index)] = end.interval + 1, end.state
                self.times[index] = end.state.t
        return self._without(chunk, rows_kept)

    def _look(self, index: int, chunk: EnsembleChunk, values: np.ndarray) -> Found | None:
        """Take up the events of a member; the one that ends it."""
        plan = replace(self.plan, constants=self.plan.constants_of(index))
        records = jax.tree.map(lambda leaf: leaf[index, : chunk.rows[index]], chunk.records)
        end = next(found_in(plan, records, values, 0), None) if plan.until else None
        for k, (name, _) in enumerate(plan.events):
            if k == 0 and plan.until:
                continue
            for found in found_in(plan, records, values, k):
                if end is not None and (found.interval, found.theta) > (end.interval, end.theta):
                    break
                self.crossed[name][index].append(found.state)
        return end

    def _without(self, chunk: EnsembleChunk, rows_kept: dict[int, int]) -> EnsembleChunk:
        """The chunk without values of events, and of members that have ended with so many rows alone.

        The extrema of such a member are those of its records; residuals are those of the whole chunk.
        """
        records, monitors = jax.tree.map(np.array, (chunk.records, dict(chunk.monitors)))
        monitors.pop(EVENTS)
        extrema = {name: limits for name, limits in chunk.extrema.items() if self.plan.monitors and name != EVENTS}
        extrema = jax.tree.map(np.array, extrema)
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

    def _take(self, position: MembersPosition, chunk: EnsembleChunk, length: int) -> None:
        """Append those records of a chunk that are to be saved, and move to its end."""
        kept = np.flatnonzero((position.steps + np.arange(length)) % self.plan.save_every == 0)
        if len(kept):
            rows = jax.tree.map(lambda leaf: leaf[kept], nodes_first(chunk))
            self.sink.append(position.steps + kept, *rows)
        position.advance(chunk, length)
        self.sink.checkpoint(position)
