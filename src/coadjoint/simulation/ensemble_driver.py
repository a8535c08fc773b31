"""The loop on the host for many members: all of them step together, into a sink of records."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import jax
import numpy as np

from coadjoint.kernels.chunk import EnsembleChunk
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run import xla
from coadjoint.mechanics.state import State
from coadjoint.simulation.driver import PATIENCE, Extrema, Plan, Sink
from coadjoint.simulation.progress import Progress


@dataclass
class MembersPosition:
    """Where an ensemble stands: as `Position`, with an axis of members in all but `steps`, the grid's.

    A member that failed keeps the state before its bad step, with how far it came in `steps_done` and why it stopped
    in `codes`. `steps` is always a saved node.
    """

    state: State
    steps_done: np.ndarray
    codes: np.ndarray
    iterations: np.ndarray
    iterations_max: np.ndarray
    steps: int = 0
    seconds: float = 0.0
    extrema: Extrema = field(default_factory=dict)
    complete: bool = False
    event: np.ndarray | None = None
    """When an event ended each member, NaN where none has; None where none may."""

    @classmethod
    def at_start(cls, states: State, count: int) -> Self:
        """No step done."""
        nothing = np.zeros(count, dtype=int)
        return cls(states, nothing, nothing, nothing, nothing)

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""
        return self.complete

    def advance(self, chunk: EnsembleChunk, steps: int) -> None:
        """Move by `steps` steps to the end of a chunk; a member that failed stays where it was."""
        good = self.codes == 0
        self.steps_done = self.steps_done + np.where(good, chunk.steps, 0)
        self.iterations = self.iterations + np.where(good, chunk.iterations, 0)
        self.iterations_max = np.maximum(self.iterations_max, chunk.iterations_max)
        self.state, self.steps = chunk.final, self.steps + steps
        self.watch(chunk)

    def watch(self, chunk: EnsembleChunk) -> None:
        """Take over the failures of a chunk, and widen the extrema by its own."""
        self.codes = np.where(self.codes == 0, chunk.code, self.codes)
        for name, (low, high) in chunk.extrema.items():
            before = self.extrema.get(name, (low, high))
            self.extrema[name] = np.minimum(before[0], low), np.maximum(before[1], high)


def drive(plan: Plan, axes: Any, position: MembersPosition, sink: Sink, progress: bool | None, title: str) -> None:
    """Move all members to the end of the plan, each to its own first bad step."""

    def run(records: int, every: int) -> EnsembleChunk:
        arguments = (plan.program, plan.constants, position.state, plan.h, records, every, plan.monitors)
        return kernels.run_ensemble(plan.backend, *arguments, axes=(axes, True))

    records = 1
    run(1, 1)  # compiling is set-up
    with Progress(plan.steps, progress, title) as bar:
        bar.advance(position.steps, 0.0)
        while position.steps < plan.steps:
            every = min(plan.save_every, plan.steps - position.steps)
            records = min(records, (plan.steps - position.steps) // every)
            began = time.perf_counter()
            chunk = run(records, every)
            spent = time.perf_counter() - began
            position.seconds += spent
            sink.append(position.steps + every * np.arange(records), *nodes_first(chunk))
            position.advance(chunk, records * every)
            sink.checkpoint(position)
            bar.advance(records * every, position.seconds)
            wished = records * min(PATIENCE / max(spent, 1e-6), 8.0)
            records = int(np.clip(wished, 1, min(sink.length, xla.ENSEMBLE_CAPACITY)))
    # One solve more gives the last node the velocities of the step that starts there.
    last = run(1, 1)
    sink.append(np.array([plan.steps]), *nodes_first(last))
    position.watch(last)
    position.complete = True
    sink.checkpoint(position)


def nodes_first(chunk: EnsembleChunk) -> tuple[State, Mapping[str, np.ndarray]]:
    """Records and monitors with axes (node, member, …), as sinks take them."""
    return jax.tree.map(lambda rows: np.swapaxes(rows, 0, 1), (chunk.records, dict(chunk.monitors)))
