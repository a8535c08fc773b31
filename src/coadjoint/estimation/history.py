"""The history of a filter: its last steps, so that a late measurement is processed at its time."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree, Scalar
from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.innovation import FilterMemory
from coadjoint.estimation.timetable import SAME


@dataclass
class PastStep:
    """A prediction: what was held before it, dt, its inputs, and the measurements after it."""

    t: float
    held: FilterMemory
    dt: float
    inputs: dict[str, PyTree]
    taken: list[tuple[str, np.ndarray]] = field(default_factory=list)


class Past:
    """The steps of the last `memory` seconds."""

    def __init__(self, memory: PyTree):
        self._memory, self._steps = checks.not_negative(memory, "memory"), deque[PastStep]()

    @property
    def kept(self) -> bool:
        """Whether any are."""
        return self._memory > 0

    def predicted(self, t: float, held: FilterMemory, dt: float, inputs: dict[str, object]) -> None:
        """Note a prediction from t."""
        self._steps.append(PastStep(t, held, dt, inputs))
        while self._steps[0].t + self._steps[0].dt <= t + dt - self._memory + SAME:
            self._steps.popleft()

    def took(self, name: str, value: np.ndarray) -> None:
        """Note a measurement at the end of the last step."""
        if self._steps:
            self._steps[-1].taken.append((name, value))

    def forget(self) -> None:
        """Forget all steps."""
        self._steps.clear()

    def copy(self) -> Past:
        """A copy of the steps, to restore."""
        found = Past(self._memory)
        found._steps = deque(replace(step, taken=list(step.taken)) for step in self._steps)
        return found

    def back(self, t: Scalar, now: float) -> list[PastStep]:
        """Remove and return the steps from that around t on; raises ArgumentError if none is kept."""
        first = self._steps[0].t if self._steps else now
        if checks.is_number(t) and t > now + SAME:
            raise ArgumentError(
                f"A measurement at t = {shown(t)} s is later than the filter, which is at {now:g} s: predict to that "
                "time first."
            )
        if not (checks.is_number(t) and first - SAME <= t <= now + SAME):
            raise ArgumentError(
                f"A measurement at t = {shown(t)} s cannot be processed: the filter is at {now:g} s and remembers its "
                f"steps from {first:g} s on; `memory` of the filter sets how far back."
            )
        steps: list[PastStep] = []
        while self._steps and self._steps[-1].t + self._steps[-1].dt > t + SAME:
            steps.insert(0, self._steps.pop())
        return steps
