"""The loop on the host for many members: all of them step together, into a sink of records."""

from __future__ import annotations

import time
from collections.abc import Mapping

import jax
import numpy as np

from coadjoint.kernels.chunk import EnsembleChunk
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run import xla
from coadjoint.kernels.run.ensemble import cores, lanes
from coadjoint.mechanics.state import State
from coadjoint.simulation.driver import PATIENCE
from coadjoint.simulation.plan import MembersPosition, Plan, Sink
from coadjoint.simulation.progress import Progress, compiling

LONGEST = 5.0
"""Seconds of a part of a block at most: what an interrupt may cost."""


class EnsembleDriver:
    """Runs all members from a position to the end of the plan, each to its own first bad step."""

    def __init__(self, plan: Plan, sink: Sink, progress: bool | None, title: str):
        self.plan, self.sink, self.progress, self.title = plan, sink, progress, title
        self.taking = False
        """Whether a sink is taking up records."""

    def _run(self, state: State, records: int, every: int) -> EnsembleChunk:
        arguments = (self.plan.program, self.plan.constants, state, self.plan.h, records, every, self.plan.watches)
        return kernels.run_ensemble(self.plan.backend, *arguments, axes=(self.plan.axes, True))

    def drive(self, position: MembersPosition) -> None:
        """Move all members to the end of the plan."""
        with compiling(self.title, self.plan.solution, self.progress):
            self._run(position.state, 1, 1)  # compiling is set-up
        speed = 0.0
        with Progress(self.plan.steps, self.progress, self.title) as bar:
            bar.advance(position.steps, 0.0)
            while self._goes_on(position):
                before = position.steps, position.seconds
                self._stretch(position, speed)
                done, spent = position.steps - before[0], position.seconds - before[1]
                speed = min(done / max(spent, 1e-6), 8 * speed or np.inf)
                bar.advance(done, position.seconds)
        chunk = self._last(position)
        self.taking = True
        self.append_last(position, chunk)
        position.complete = True
        self.sink.checkpoint(position)
        self.taking = False

    def _goes_on(self, position: MembersPosition) -> bool:
        return position.steps < self.plan.steps

    def _stretch(self, position: MembersPosition, speed: float) -> None:
        """Run for about PATIENCE seconds: whole blocks of save_every steps, or a part of a long one for some more."""
        every, phase = self.plan.save_every, position.steps % self.plan.save_every
        left = self.plan.steps - position.steps
        wished = max(int(speed * PATIENCE), 1)
        if phase == 0 and min(wished, left) >= every:
            records, length = min(wished // every, left // every, self._capacity), every
        else:
            records, length = 1, min(max(int(speed * self._patience(position)), 1), left, every - phase)
        began = time.perf_counter()
        chunk = self._run(position.state, records, length)
        position.seconds += time.perf_counter() - began
        self.taking = True
        if phase == 0:
            self.sink.append(position.steps + length * np.arange(records), *nodes_first(chunk))
        position.advance(chunk, records * length)
        self.sink.checkpoint(position)
        self.taking = False

    def _patience(self, position: MembersPosition) -> float:
        """Seconds for a part of a block: what it costs to take up many members counts less in longer ones.

        Machine code is interrupted between groups of lanes, so that one group alone has to be short.
        """
        if self.plan.backend != "native":
            return PATIENCE
        return min(PATIENCE * max(len(position.codes) // (lanes() * cores()), 1), LONGEST)

    @property
    def _capacity(self) -> int:
        """The most nodes of a chunk."""
        return min(self.sink.length, xla.ENSEMBLE_CAPACITY)

    def _last(self, position: MembersPosition) -> EnsembleChunk:
        """One solve more gives the last node the velocities of the step that starts there."""
        return self._run(position.state, 1, 1)

    def append_last(self, position: MembersPosition, chunk: EnsembleChunk | None = None) -> None:
        """Append the node where all members stand."""
        chunk = self._last(position) if chunk is None else chunk
        self.sink.append(np.array([position.steps]), *nodes_first(chunk))
        position.watch(chunk)

    def undo(self, position: MembersPosition) -> None:
        """Forget what was found beyond the position."""


def nodes_first(chunk: EnsembleChunk) -> tuple[State, Mapping[str, np.ndarray]]:
    """Records and monitors with axes (node, member, …), as sinks take them."""
    return jax.tree.map(lambda rows: np.swapaxes(rows, 0, 1), (chunk.records, dict(chunk.monitors)))
