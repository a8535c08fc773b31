"""The loop on the host: chunk after chunk, sized for the updates of a progress bar, into a sink of records."""

from __future__ import annotations

import time

import numpy as np

from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.run import backend as kernels
from coadjoint.mechanics.state import State
from coadjoint.simulation.plan import Plan, Position, Sink
from coadjoint.simulation.progress import Progress, compiling

PATIENCE = 0.25
"""Seconds between two updates of progress: what chunks are sized for."""


class Driver:
    """Runs a plan from a position to its end, or to the first step that fails."""

    def __init__(self, plan: Plan, sink: Sink, progress: bool | None, title: str):
        self.plan, self.sink, self.progress, self.title = plan, sink, progress, title
        self.taking = False
        """Whether a sink is taking up records: an interrupt then finds it between the one and the other."""

    def _run(self, state: State, records: int, every: int) -> Chunk:
        plan = self.plan
        return kernels.run(plan.backend, plan.program, plan.constants, state, plan.h, records, every, plan.watches)

    def drive(self, position: Position) -> None:
        """Move `position` to the end of the plan; its `code` says whether a step failed."""
        # Compiling is set-up: the first call, of one step, is not counted, and its result is not kept.
        with compiling(self.title, self.plan.solution, self.progress):
            self._run(position.state, 1, 1)
        speed = 0.0
        with Progress(self.plan.steps, self.progress, self.title) as bar:
            bar.advance(position.steps, 0.0)
            while position.steps < self.plan.steps and not position.code and position.event is None:
                before = position.steps, position.seconds
                self._stretch(position, speed)
                done, spent = position.steps - before[0], position.seconds - before[1]
                speed = min(done / max(spent, 1e-6), 8 * speed or np.inf)
                bar.advance(done, position.seconds)
        if not position.code:
            self._close(position)

    def _stretch(self, position: Position, speed: float) -> None:
        """Run for about PATIENCE seconds: whole blocks of save_every steps, or a part of one where blocks are long."""
        every, phase = self.plan.save_every, position.steps % self.plan.save_every
        left = self.plan.steps - position.steps
        wished = max(int(speed * PATIENCE), 1)
        if phase == 0 and min(wished, left) >= every:
            records, length = min(wished // every, left // every, self.plan.capacity(position.state)), every
        else:
            records, length = 1, min(wished, left, every - phase)
        began = time.perf_counter()
        chunk = self._run(position.state, records, length)
        position.seconds += time.perf_counter() - began
        self.taking = True
        if phase == 0 and chunk.steps:
            rows = -(-chunk.steps // length)
            self.sink.append(position.steps + length * np.arange(rows), chunk.records, chunk.monitors)
        position.advance(chunk)
        self.sink.checkpoint(position)
        self.taking = False

    def _close(self, position: Position) -> None:
        """One solve more gives the last node the velocities of the step that starts there."""
        chunk = self._last(position)
        self.taking = True
        position.code = chunk.code
        if not chunk.code:
            self.append_last(position, chunk)
            position.complete = True
        self.sink.checkpoint(position)
        self.taking = False

    def append_last(self, position: Position, chunk: Chunk | None = None) -> None:
        """Append the node where a run stands, with the velocities of the step that would start there."""
        chunk = self._last(position) if chunk is None else chunk
        if not chunk.code:
            self.sink.append(np.array([position.steps]), chunk.records, chunk.monitors)
            position.watch(chunk)

    def undo(self, position: Position) -> None:
        """Forget what was found beyond the position."""

    def _last(self, position: Position) -> Chunk:
        return self._run(position.state, 1, 1)
