"""The local error of single steps: one step of h against steps of parts of it, from the same row of numbers.

Knows NumPy only: a saved stepper is without JAX.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from coadjoint.simulation.accuracy.metric import Difference, Numbers, Ruler, differences, larger, relative, sizes_of

HALVES = (0.5, 0.5)
UNEVEN = (0.382, 0.618)
"""Parts in no simple ratio: what repeats at h and at h/2 alike, such as a sampled signal, does not repeat here."""


class StepTaker(Protocol):
    """What takes steps: to where they led, a row of numbers a state, the record of the first step, and 0 where all went
    well; members: whose parameters a row has."""

    def __call__(
        self, rows: np.ndarray, h: np.ndarray, steps: int = 1, members: Any = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...


class InternalPlaces(NamedTuple):
    """Where an internal state is in a row: whether its rule is due, None without one; what of it follows the motion or
    a command, at the node, on the mean of the step and at its end; what jumps at the node, there and at the end; and
    all means and ends."""

    due: int | None = None
    begin: Numbers = ()
    mean: Numbers = ()
    end: Numbers = ()
    jumping: Numbers = ()
    jumping_end: Numbers = ()
    over_step: Numbers = ()

    @property
    def following(self) -> list[int]:
        """All numbers that follow."""
        return [*self.begin, *self.mean, *self.end]


def recorded(rows: np.ndarray, after: np.ndarray, course: InternalPlaces) -> np.ndarray:
    """The rows with what the steps that led to `after` need of the internal state: its course, and what has jumped."""
    if course.due is None:
        return rows
    record = rows.copy()
    record[:, course.due] = 0.0
    record[:, [*course.over_step, *course.jumping]] = after[:, [*course.over_step, *course.jumping_end]]
    return record


class Errors(NamedTuple):
    """Local errors of steps, relative to the motion of the run over a step, a row each, and the part that is worst."""

    local: np.ndarray
    largest: np.ndarray
    """The larger of those by halves and by uneven parts."""
    part: list[str]
    good: np.ndarray


class PartsOfSteps:
    """Compares steps with parts of them: inputs, noise and sampled controllers stay as they are over a step.

    An actuator that follows a command moves on between the parts of a step, as the rule of the internal state says.
    probe: what takes the steps. order: of the method. memory: which numbers the method of variable steps remembers.
    """

    def __init__(self, probe: StepTaker, ruler: Ruler, course: InternalPlaces, order: int, memory: Sequence[int] = ()):
        self.probe, self.ruler, self.course, self.order = probe, ruler, course, order
        self._memory, self._following = list(memory), course.following

    def over(self, rows: np.ndarray, h: np.ndarray, parts: Sequence[float], members: Any = None):
        """The rows after steps of the parts of h one after another, and whether all of them were solved."""
        due, memory = self.course.due, self._memory
        if due is None and not memory and len(set(parts)) == 1:
            after, _, code = self.probe(rows, h * parts[0], len(parts), members)
            return after, code == 0
        good, begun = np.ones(len(rows), bool), rows
        for number, part in enumerate(parts):
            if number:
                rows = np.array(rows)
                rows[:, memory] = begun[:, memory]
            if due is not None and part != 1.0:
                rows = self._followed(rows, h * part, members)
            rows, _, code = self.probe(rows, h * part, 1, members)
            good &= code == 0
        return rows, good

    def _followed(self, rows: np.ndarray, h: np.ndarray, members: Any) -> np.ndarray:
        """The rows as records of steps of h, with the rule applied to what follows the motion or a command."""
        due, kept = self.course.due, np.array(rows)
        if self._following:
            kept[:, due] = 1.0
            _, found, _ = self.probe(kept, h, 1, members)
            kept[:, self._following] = found[:, self._following]
        kept[:, due] = 0.0
        return kept

    def errors(
        self, rows: np.ndarray, h: np.ndarray, members: Any = None, sizes: Any = None, at_least: bool = False
    ) -> tuple[Errors, dict[str, float]]:
        """Local errors of the steps of h (rows,) from every row, and what they are relative to.

        These are `sizes`, by default those of these steps; `at_least`: or those of these steps, where larger.
        """
        whole, good = self.over(rows, h, (1.0,), members)
        by_halves, good_halves = self.over(rows, h, HALVES, members)
        by_uneven, good_uneven = self.over(rows, h, UNEVEN, members)
        good = good & good_halves & good_uneven
        if not good.any():
            return Errors(np.zeros(0), np.zeros(0), [], good), {}
        begun, one, parts = ((rows, rows), (whole, whole), (by_halves, by_uneven))
        found = self.compare(*(np.concatenate([x[good], y[good]]) for x, y in (begun, one, parts)))
        own = sizes_of(found) if sizes is None or at_least else {}
        sizes = own if sizes is None else larger(sizes, own) if at_least else sizes
        apart, parts = relative(found, sizes)
        count = len(apart) // 2
        local, other = apart[:count] / self.shrinks(HALVES), apart[count:] / self.shrinks(UNEVEN)
        part = [parts[i] if local[i] >= other[i] else parts[count + i] for i in range(count)]
        return Errors(local, np.maximum(local, other), part, good), sizes

    def compare(self, begun: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[Difference]:
        """What separates rows."""
        return differences(self.ruler, begun, other, one)

    def shrinks(self, parts: Sequence[float]) -> float:
        """1 − Σ part^{p+1}: what the difference to steps of the parts is of the local error, of order p + 1."""
        order = min(self.order, 2) if self._following else self.order
        return 1.0 - sum(part ** (order + 1) for part in parts)
