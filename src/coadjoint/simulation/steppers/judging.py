"""The warnings of a stepper while it steps: a dt that does not resolve the motion, and clipped commands."""

from __future__ import annotations

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import must_give, warn
from coadjoint.kernels.lanes import of_lanes
from coadjoint.kernels.program import Code, StatusFlag
from coadjoint.kernels.run.interruptible import FIRST
from coadjoint.simulation.accuracy.local_error import InternalPlaces, PartsOfSteps, Ruler, recorded
from coadjoint.simulation.accuracy.verdict import AHEAD, MEMBERS, SampledSteps
from coadjoint.simulation.steppers.interface import Buffers, Engine, NativeEngine, StepperInterface

AHEAD_BY_XLA = (4,)
"""How many steps ahead the judgement looks, by XLA, to find how far a step moves."""


class EngineSteps:
    """Steps of a stepper's engine from rows of numbers (rows, size); parameters (members or 1, size).

    The records hold the internal state of a step: its course, and the values that jump at the node.
    """

    def __init__(self, engine: Engine, face: StepperInterface, course: InternalPlaces, parameters: np.ndarray):
        self._engine, self._face, self._parameters = engine, face, parameters
        self._commanded, self._course = list(face.commanded), course

    def __call__(
        self, rows: np.ndarray, h: np.ndarray, steps: int = 1, members: PyTree = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `StepTaker`; all h are the same. XLA takes as many rows together as it was compiled for."""
        engine, face, count = self._engine, self._face, len(rows)
        p = self._parameters if members is None or len(self._parameters) == 1 else self._parameters[members]
        if not isinstance(engine, NativeEngine):
            index = np.resize(np.arange(count), face.count)
            rows, p = rows[index], p if len(p) == 1 else p[index]
        memory = Buffers.filled(p, float(h[0]), rows, (face.commands.size, face.observations.size), engine.lanes)
        memory.commands[:] = rows[np.minimum(np.arange(len(memory.commands)), len(rows) - 1)][:, self._commanded]
        context = memory.context()
        engine.advance(memory, context.ctypes.data, len(memory.state), steps, 1)
        after, code = of_lanes(memory.state)[:count], of_lanes(memory.status[:, [1]])[:count, 0]
        return after, recorded(rows[:count], after, self._course), code


def sample_of(engine: Engine, parts: PartsOfSteps) -> SampledSteps:
    """A new sample of steps; parts: their comparison."""
    return SampledSteps(parts, AHEAD if isinstance(engine, NativeEngine) else AHEAD_BY_XLA)


def judged_steps(sample: SampledSteps, face: StepperInterface, memory: Buffers) -> str | None:
    """The warning about the next step, from up to `MEMBERS` members that have not ended; None if dt resolves it."""
    members = np.unique(np.linspace(0, face.count - 1, MEMBERS).astype(int))
    members = members[of_lanes(memory.status[:, [1]])[members, 0] == Code.CONVERGED]
    if not len(members):
        return None
    rows = of_lanes(memory.state)[members]
    rows[:, list(face.commanded)] = memory.commands[members]
    return sample.judge(rows, float(memory.h[0]), members)


class StepperWarnings:
    """The sample of steps that are judged for their accuracy, and the limits of commands.

    While the first steps are sampled, each takes one call of the engine. After that, the engine reports when a step is
    due, and which calls clip a command, so that neither costs anything in Python.
    """

    face: StepperInterface
    _engine: Engine
    _buffers: Buffers

    _parts: PartsOfSteps | None = None
    _sample: SampledSteps | None = None
    """The sample of the first steps while it lasts."""
    _later: SampledSteps | None = None
    """The sample of later steps; None when no step is judged any more."""
    _straight: int = FIRST
    """The most steps that are taken by one call of the engine."""

    # The accuracy of its steps.

    def _begin_sample(self, parts: PartsOfSteps, depth: int = 4) -> None:
        """Judge the step from here, and some of those that will be taken, and warn once.

        parts: their comparison. depth: how many calls below the user's this one is.
        """
        self._parts, self._sample, self._straight = parts, sample_of(self._engine, parts), 0
        if sentence := self._judgement(self._sample):
            self._end_sample()
            warn(sentence, stacklevel=depth)

    def _end_sample(self, later: SampledSteps | None = None) -> None:
        """End the sample of the first steps, and judge the steps after them by `later`."""
        self._sample, self._straight, self._later = None, FIRST, later

    @property
    def judging(self) -> bool:
        """Whether the sample of the first steps that are judged for their accuracy still lasts."""
        return self._sample is not None

    def _plain_ruler(self) -> Ruler | None:
        """The ruler of the judged steps, with functions that a file can hold; None if no step is judged."""
        return None if self._parts is None else self._parts.ruler

    def _parameter_rows(self) -> np.ndarray:
        must_give(self, "_parameter_rows")

    def _steps(self, course: InternalPlaces) -> EngineSteps:
        """Single steps with the parameters as they are now."""
        return EngineSteps(self._engine, self.face, course, self._parameter_rows())

    def _judgement(self, sample: SampledSteps) -> str | None:
        sample.parts.probe = self._steps(sample.parts.course)
        return judged_steps(sample, self.face, self._buffers)

    # The reports of the engine on a call.

    def _heed(self, flags: int, n: int) -> None:
        """Warn about the reports of the engine, `StatusFlag`, on a call of n steps."""
        if flags & StatusFlag.CLIPPED:
            for sentence in self._clipped(n):
                warn(sentence, stacklevel=4)
        if flags & StatusFlag.DUE and (sample := self._later) is not None and (sentence := self._judgement(sample)):
            self._later = None
            warn(sentence, stacklevel=4)

    def _clipped(self, n: int) -> list[str]:
        """A warning for each command that has just exceeded its limits for the first time; n: steps taken."""
        face, buffers, found = self.face, self._buffers, []
        commands, (low, high) = buffers.commands[: face.count], buffers.limits[..., 0].copy()
        codes, times = of_lanes(buffers.status[:, [1]])[:, 0], of_lanes(buffers.state[:, [face.time]])[:, 0]
        for name, _, place in face.commands.places():
            beyond = (commands[:, place] < low[place]) | (commands[:, place] > high[place])
            if not beyond.any():
                continue
            member, number = np.argwhere(beyond)[0].tolist()
            at = place.start + number
            begun = times[member] - (n * face.dt if codes[member] == Code.CONVERGED else 0.0)
            whose = "" if face.members is None else f" of member {member}"
            silent = commands[member, at] == 0 < low[at]
            fate = "is beyond" if silent else "is clipped to"
            found.append(
                f"Command `{name}`{whose} {fate} its limits, {low[at]:g} to {high[at]:g}: it is "
                f"{commands[member, at]:g} at t = {round(float(begun), 9):g} s, the first time beyond them"
                f"{'; where pulses command it, none stops it' if silent else ''}."
            )
            buffers.limits[0, place], buffers.limits[1, place] = -np.inf, np.inf
        return found
