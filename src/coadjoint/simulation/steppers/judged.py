"""What of a stepper's steps is judged: single steps by its own engine, in memory of their own. Without JAX."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.kernels.program import Code
from coadjoint.simulation.accuracy.parts import InternalPlaces, PartsOfSteps, recorded
from coadjoint.simulation.accuracy.sampled_steps import AHEAD, MEMBERS, SampledSteps
from coadjoint.simulation.steppers.buffers import Buffers, by_member
from coadjoint.simulation.steppers.face import Engine, Face
from coadjoint.simulation.steppers.native import NativeEngine

AHEAD_BY_XLA = (4,)
"""How many steps ahead of one by XLA it is looked for how far a step moves."""


class EngineSteps:
    """Steps of a stepper's engine from rows of numbers (rows, size); parameters (members or 1, size).

    The records have what a step needs of its internal state: its course, and what jumps at the node.
    """

    def __init__(self, engine: Engine, face: Face, course: InternalPlaces, parameters: np.ndarray):
        self._engine, self._face, self._parameters = engine, face, parameters
        self._commanded, self._course = list(face.commanded), course

    def __call__(
        self, rows: np.ndarray, h: np.ndarray, steps: int = 1, members: Any = None
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
        after, code = by_member(memory.state)[:count], by_member(memory.status[:, [1]])[:count, 0]
        return after, recorded(rows[:count], after, self._course), code


def sample_of(engine: Engine, parts: PartsOfSteps) -> SampledSteps:
    """A sample of steps that begins; parts: what compares them."""
    return SampledSteps(parts, AHEAD if isinstance(engine, NativeEngine) else AHEAD_BY_XLA)


def judged(sample: SampledSteps, face: Face, memory: Buffers) -> str | None:
    """What is to be warned of the step that comes next, of up to `MEMBERS` members that have not ended."""
    members = np.unique(np.linspace(0, face.count - 1, MEMBERS).astype(int))
    members = members[by_member(memory.status[:, [1]])[members, 0] == Code.CONVERGED]
    if not len(members):
        return None
    rows = by_member(memory.state)[members]
    rows[:, list(face.commanded)] = memory.commands[members]
    return sample.judge(rows, float(memory.h[0]), members)
