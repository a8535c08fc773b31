"""The plan of a run, a program over a grid, and the position of the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

import jax
import numpy as np

from coadjoint.kernels.chunk import Chunk, EnsembleChunk
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import xla
from coadjoint.kernels.run.backend import Backend
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.events import Event

Extrema = dict[str, tuple[np.ndarray, np.ndarray]]


CAPACITY, WATCHED_CAPACITY = 65_536, 8192
"""The most records of a chunk by machine code, enough that the cost of a call is negligible; and where events are
looked for after each chunk, beyond which the steps are lost."""


@dataclass
class Position:
    """The position of a run: all values needed to continue from here, and the certificate so far.

    `state` is the state after `steps` good steps; `extrema` are (minimum, maximum) of the monitors and certificates
    over those steps, `iterations` Newton's; `code`: how the last step ended; `event`: when an event ended the run;
    `complete`: whether the last node has also been recorded.
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

    halted = False  # a function of an output has ended the run; not a field, as files do not hold it

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""
        return self.complete or self.failed

    @property
    def failed(self) -> bool:
        """Whether a step failed."""
        return self.code is not Code.CONVERGED

    @property
    def stopped(self) -> bool:
        """Whether a step failed, or an event or a function of an output has ended the run."""
        return self.failed or self.halted or self.event is not None

    def closed(self, chunk: Chunk) -> bool:
        """Whether the step that starts at the last node, the one of a chunk, was solved."""
        self.code = chunk.code
        return not self.failed

    def advance(self, chunk: Chunk, steps: int) -> None:
        """Move to the end of a chunk in one assignment: an interrupt finds it before the chunk or behind it.

        steps: those that were tried, of which the chunk has the good ones.
        """
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


@dataclass(frozen=True)
class Plan:
    """A program over a grid, for one system or the members of an ensemble, with the events that are monitored."""

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
    members: int | None = None
    """How many members an ensemble has; None of a single run."""
    axes: Constants | None = None
    """Like `constants`: True where a leaf has a member axis; None of a single run."""

    @property
    def solution(self) -> str:
        """A text on how XLA solves the equations of a step; empty for machine code, which uses Newton's method."""
        if self.backend == "native":
            return ""
        return "by XLA, " + "; ".join(dict.fromkeys(stage.structure.words for stage in self.program.stages))

    @property
    def nodes(self) -> int:
        """How many records a complete run has: those of every save_every-th node before the last, and of the last."""
        return -(-self.steps // self.save_every) + 1

    def capacity(self, state: State) -> int:
        """The most records of a chunk from such a state."""
        if self.members is None and self.backend == "native":
            return WATCHED_CAPACITY if self.events else CAPACITY
        return xla.capacity(state, together=self.members is not None)

    def constants_of(self, member: int = 0) -> Constants:
        """The constants of one member; those of a single run."""
        constants, axes = self.constants, self.axes
        if axes is None:
            return constants
        flags = jax.tree.map(lambda flag, part: jax.tree.map(lambda _: flag, part), axes.system, constants.system)
        system = jax.tree.map(lambda leaf, flag: leaf[member] if flag else leaf, constants.system, flags)
        monitors = jax.tree.map(lambda leaf: leaf[member] if axes.monitors else leaf, constants.monitors)
        return Constants(system, monitors, constants.renewal)

    @property
    def watches(self) -> bool:
        """Whether a kernel computes observations: monitors, or the values of events."""
        return self.monitors or bool(self.events)


@dataclass
class MembersPosition:
    """The position of an ensemble: as `Position`, with an axis of members in all fields but `steps`, the grid's.

    A member that failed keeps the state before its bad step, the number of its steps in `steps_done` and the reason in
    `codes`.
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
    """The time at which an event ended each member, NaN where none did; None without such an event."""

    halted = False  # as of `Position`

    @classmethod
    def at_start(cls, states: State, count: int) -> Self:
        """No step done."""
        nothing = np.zeros(count, dtype=int)
        return cls(states, nothing, nothing, nothing, nothing)

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""
        return self.complete

    @property
    def failed(self) -> bool:
        """False: members that fail are masked, and the others continue."""
        return False

    @property
    def stopped(self) -> bool:
        """Whether a function of an output, or events, have ended all members."""
        return self.halted or (self.event is not None and not np.any(np.isnan(self.event)))

    def closed(self, chunk: EnsembleChunk) -> bool:
        """True: members whose last step failed are masked."""
        return True

    def advance(self, chunk: EnsembleChunk, steps: int) -> None:
        """Move by `steps` steps to the end of a chunk; a member that failed stays where it was."""
        good = self.codes == 0
        vars(self).update(
            state=chunk.final,
            steps=self.steps + steps,
            steps_done=self.steps_done + np.where(good, chunk.steps, 0),
            iterations=self.iterations + np.where(good, chunk.iterations, 0),
            iterations_max=np.maximum(self.iterations_max, chunk.iterations_max),
            codes=np.where(good, chunk.code, self.codes),
            extrema=widened(self.extrema, chunk.extrema),
        )

    def watch(self, chunk: EnsembleChunk) -> None:
        """Take over the failures of a chunk, and widen the extrema by its own."""
        codes, extrema = np.where(self.codes == 0, chunk.code, self.codes), widened(self.extrema, chunk.extrema)
        vars(self).update(codes=codes, extrema=extrema)


AnyPosition = Position | MembersPosition
