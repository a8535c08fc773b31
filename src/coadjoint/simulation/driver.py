"""The loop on the host: chunk after chunk, sized for the updates of a progress bar, into a sink of records."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run import xla
from coadjoint.kernels.run.backend import Backend
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.progress import Progress, compiling

if TYPE_CHECKING:
    from coadjoint.simulation.events import Event

Extrema = dict[str, tuple[np.ndarray, np.ndarray]]

PATIENCE = 0.25
"""Seconds between two updates of progress: what chunks are sized for."""

CAPACITY = 8192
"""The most records of a chunk by machine code, so that what a call costs is lost among them."""


@dataclass
class Position:
    """Where a run stands: all that going on from here needs, and the certificate so far.

    `state` is the state after `steps` good steps; `extrema` are (minimum, maximum) of the monitors and certificates
    over those steps, `iterations` Newton's; `code`: how the last step ended; `event` when an event ended the run;
    `complete` that the last node has been recorded too.
    """

    state: State
    steps: int = 0
    iterations: int = 0
    iterations_max: int = 0
    seconds: float = 0.0
    extrema: Extrema = field(default_factory=dict)
    code: Code = Code.CONVERGED
    event: float | None = None
    complete: bool = False

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""
        return self.complete or self.failed

    @property
    def failed(self) -> bool:
        """Whether a step failed."""
        return self.code is not Code.CONVERGED

    def advance(self, chunk: Chunk) -> None:
        """Move to the end of a chunk, at once: an interrupt finds it before the chunk or behind it."""
        vars(self).update(
            state=chunk.final,
            steps=self.steps + chunk.steps,
            code=chunk.code,
            iterations=self.iterations + chunk.iterations,
            iterations_max=max(self.iterations_max, chunk.iterations_max),
            extrema=self._widened(chunk),
        )

    def watch(self, chunk: Chunk) -> None:
        """Widen the extrema by those of a chunk."""
        self.extrema = self._widened(chunk)

    def _widened(self, chunk: Chunk) -> Extrema:
        return widened(self.extrema, chunk.extrema) if chunk.steps else self.extrema


def widened(before: Extrema, now: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Extrema:
    """Extrema over two stretches of a run."""
    both = {name: (before.get(name, limits), limits) for name, limits in now.items()}
    return {**before, **{name: (np.minimum(a[0], b[0]), np.maximum(a[1], b[1])) for name, (a, b) in both.items()}}


class Sink(Protocol):
    """Where records go; `seconds` is the time that this took."""

    @property
    def seconds(self) -> float: ...

    @property
    def length(self) -> int:
        """How many nodes of an ensemble it takes at once."""
        ...

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        """Take the records at these step indices, with one row of every monitor each."""
        ...

    def checkpoint(self, position: Any) -> None:
        """All records up to `position` have been appended: make sure that a run can go on from there."""
        ...

    def finish(self, position: Any, complete: bool = True) -> None:
        """Make sure of all records up to `position`; `complete` where the run has ended and is judged."""
        ...

    def release(self) -> None:
        """Nothing more will come."""
        ...


@dataclass(frozen=True)
class Plan:
    """What is run: a program from a start, over a grid."""

    backend: Backend
    program: StepProgram
    constants: Constants
    h: float
    steps: int
    save_every: int
    monitors: bool
    events: tuple[tuple[str, Event], ...] = ()
    """Names and events that are monitored; with `until` the first of them ends the run."""
    until: bool = False

    @property
    def solution(self) -> str:
        """How XLA solves the equations of a step, in words; empty for machine code, which is Newton's method."""
        if self.backend == "native":
            return ""
        return "by XLA, " + "; ".join(dict.fromkeys(stage.structure.words for stage in self.program.stages))

    def capacity(self, state: State) -> int:
        """The most records of a chunk from such a state."""
        return CAPACITY if self.backend == "native" else xla.capacity(state)

    @property
    def watches(self) -> bool:
        """Whether a kernel is to compute what is observed: monitors, or the values of events."""
        return self.monitors or bool(self.events)


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
        """Forget what came from a step on, and what an interrupt has left by halves."""
        good = min(len(self.steps), len(self.records), len(self.monitors))
        good = sum(bool(steps[0] < step) for steps in self.steps[:good])
        for rows in (self.steps, self.records, self.monitors):
            del rows[good:]

    def checkpoint(self, position: Any) -> None:
        pass

    def finish(self, position: Any, complete: bool = True) -> None:
        pass

    def release(self) -> None:
        pass
