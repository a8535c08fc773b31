"""The loop on the host: chunk after chunk, sized for the updates of a progress bar, into the sinks of records."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run.ensemble import cores, lanes
from coadjoint.log import phase
from coadjoint.mechanics.state import State
from coadjoint.simulation.plan import AnyPosition, Plan
from coadjoint.simulation.progress import Progress, compiling
from coadjoint.simulation.sinks import Outputs

PATIENCE = 0.25
"""Seconds between two updates of progress, which determine the size of chunks."""

ASSUMED = 400.0
"""Steps per second of one trajectory by machine code before its speed is known: a hundred steps take milliseconds."""

LONGEST = 5.0
"""The most seconds for a part of a block of many members: the longest delay of an interrupt."""


class Driver:
    """Runs a plan from a position to its end, or to the first step that fails; in an ensemble, for each member."""

    def __init__(self, plan: Plan, outputs: Outputs, progress: bool | None, title: str):
        self.plan, self.outputs, self.progress, self.title = plan, outputs, progress, title
        self.taking = False
        """Whether a sink is taking records: an interrupt then finds it in an incomplete state."""

    def run(self, state: State, records: int, every: int) -> Any:
        """A chunk of `records` records, one every `every` steps: a `Chunk`, or for members an `EnsembleChunk`."""
        plan = self.plan
        given = plan.backend, plan.program, plan.constants, state, plan.h, records, every, plan.watches
        if plan.members is None:
            return kernels.run(*given, length=None if plan.events else plan.steps)  # events repeat single steps
        return kernels.run_ensemble(*given, axes=(plan.axes, True))

    def drive(self, position: AnyPosition) -> None:
        """Move `position` to the end of the plan; its `failed` shows whether a step failed."""
        alone = self.plan.backend == "native" and self.plan.members is None
        if not alone or self._observed_by_xla(position):
            phase("Compiling a step.")
            # Compiling is set-up: the first call, of one step, is not counted, and its result is not kept.
            with compiling(self.title, self.plan.solution, self.progress):
                self.run(position.state, 1, 1)
        speed, limit = ASSUMED if alone else 0.0, np.inf
        with Progress(self.plan.steps, self.progress, self.title) as bar:
            bar.advance(position.steps, 0.0)
            while position.steps < self.plan.steps and not position.stopped:
                before = position.steps, position.seconds
                self._stretch(position, speed)
                done, spent = position.steps - before[0], position.seconds - before[1]
                speed = min(done / max(spent, 1e-6), limit)
                limit = 8 * speed
                bar.advance(done, position.seconds)
        if not position.failed:
            self._close(position)

    def _observed_by_xla(self, position: AnyPosition) -> bool:
        plan = self.plan
        return kernels.observed_by_xla(plan.backend, plan.program, plan.constants, position.state, plan.watches)

    def _stretch(self, position: AnyPosition, speed: float) -> None:
        """Run for about PATIENCE seconds: complete blocks from a record to the next, or a part of one where they are
        long."""
        every, phase = self.outputs.every, position.steps % self.outputs.every
        left = self.plan.steps - position.steps
        wished = max(int(speed * PATIENCE), 1)
        if phase == 0 and min(wished, left) >= every:
            records, length = min(wished // every, left // every, self._capacity(position)), every
        else:
            records, length = 1, min(max(int(speed * self._patience), 1), left, every - phase)
        began = time.perf_counter()
        chunk = self.run(position.state, records, length)
        position.seconds += time.perf_counter() - began
        done = records * length if self.plan.members else chunk.steps
        rows = -(-done // length) if phase == 0 else 0
        steps = position.steps + length * np.arange(rows)
        if rows and (end := self.outputs.end(steps, *self._rows(chunk))) is not None:
            position.halted, rows, steps = True, end, steps[:end]
            if not end:
                return
            chunk, done = self.run(position.state, end, length), end * length
        self.taking = True
        if rows:
            self.outputs.append(steps, *self._rows(chunk))
        position.advance(chunk, done)
        self.outputs.checkpoint(position)
        self.taking = False

    def _rows(self, chunk: PyTree) -> tuple[State, Mapping[str, np.ndarray]]:
        """Records and monitors of a chunk with axes (node, [member,] …), as sinks take them."""
        if self.plan.members is None:
            return chunk.records, chunk.monitors
        return jax.tree.map(lambda rows: np.swapaxes(rows, 0, 1), (chunk.records, dict(chunk.monitors)))

    def _capacity(self, position: AnyPosition) -> int:
        """The most records of a chunk."""
        most = self.plan.capacity(position.state)
        return most if self.plan.members is None else min(self.outputs.length, most)

    @property
    def _patience(self) -> float:
        """Seconds for a part of a block: the cost of loading many members weighs less in longer parts.

        Machine code is interrupted between groups of lanes, so that only a single group has to be short.
        """
        if self.plan.members is None or self.plan.backend != "native":
            return PATIENCE
        return min(PATIENCE * max(self.plan.members // (lanes() * cores()), 1), LONGEST)

    def _close(self, position: AnyPosition) -> None:
        """Record the last node; one more solve gives it the velocities of the step that starts there."""
        chunk = self._last(position)
        self.taking = True
        if position.closed(chunk):
            self._append(position, chunk)
            position.complete = True
        self.outputs.checkpoint(position)
        self.taking = False

    def append_last(self, position: AnyPosition) -> None:
        """Append the node of a position, with the velocities of the step that would start there, if it has any."""
        chunk = self._last(position)
        if self.plan.members or not chunk.code:
            self._append(position, chunk)

    def _append(self, position: AnyPosition, chunk: PyTree) -> None:
        self.outputs.end(np.array([position.steps]), *self._rows(chunk), last=True)
        self.outputs.append(np.array([position.steps]), *self._rows(chunk), last=True)
        position.watch(chunk)

    def undo(self, position: AnyPosition) -> None:
        """Discard the results beyond the position."""

    def _last(self, position: AnyPosition) -> Any:
        return self.run(position.state, 1, 1)
