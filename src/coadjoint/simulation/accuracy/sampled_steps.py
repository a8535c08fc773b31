"""Steps that are taken one after another, without an end that is known: a sample of them is judged. Knows NumPy only.

The first step is judged at set-up, the first three as they are taken, then those after 4, 8, 16, … steps up to LAST;
from there on nothing is. What a step moves is compared with what the steps ahead of it move under the same commands:
a start at rest moves next to nothing in its first step.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from coadjoint.simulation.accuracy.metric import larger, sizes_of
from coadjoint.simulation.accuracy.parts import PartsOfSteps
from coadjoint.simulation.accuracy.verdict import sentence, verdict

FIRST, LAST = 3, 4096
"""How many steps are judged as they come, and after how many none is any more."""

AHEAD = (4, 32)
"""How many steps ahead it is looked for how far a step moves."""

MEMBERS = 8
"""How many members are judged, evenly among all."""


class SampledSteps:
    """What is known of steps that are judged one by one; `count` of them have been taken.

    ahead: by how many steps it is looked ahead, by default `AHEAD`.
    """

    def __init__(self, parts: PartsOfSteps, ahead: tuple[int, ...] = AHEAD):
        self.parts, self._ahead = parts, ahead
        self.count, self.next = 0, 0
        self._sizes: dict[str, float] = {}

    def copy(self) -> SampledSteps:
        """The same knowledge for a clone."""
        made = SampledSteps(copy.copy(self.parts), self._ahead)
        made.count, made.next, made._sizes = self.count, self.next, dict(self._sizes)
        return made

    @property
    def over(self) -> bool:
        """Whether the sample is complete."""
        return self.next > LAST

    def due(self) -> bool:
        """Whether the step that comes next belongs to the sample, which it then has been asked for."""
        if self.count < self.next:
            return False
        self.next = self.count + 1 if self.count + 1 < FIRST else 1 << max(self.count, 2).bit_length()
        return True

    def judge(self, rows: np.ndarray, h: float, members: Any = None) -> str | None:
        """What is to be warned of the steps of h from rows (k, size); None where nothing is."""
        length = np.full(len(rows), float(h))
        with np.errstate(all="ignore"):
            self._look_ahead(rows, length, members)
            errors, sizes = self.parts.errors(self.records(rows, length, members), length, members, self._sizes, True)
            if not errors.good.any() or not np.all(np.isfinite(errors.largest)):
                return None
            self._sizes = larger(self._sizes, sizes)
            found = verdict(self.parts, rows, length, members, errors, sizes, h, turns=False)
        if not found.reasons:
            return None
        return sentence(h, found.reasons, min(found.fine))

    def records(self, rows: np.ndarray, h: np.ndarray, members: Any = None) -> np.ndarray:
        """The rows with the course of the internal state over the step that starts at them."""
        if self.parts.course.due is None:
            return rows
        _, record, code = self.parts.probe(rows, h, 1, members)
        return np.where((code == 0)[:, None], record, rows)

    def _look_ahead(self, rows: np.ndarray, h: np.ndarray, members: Any) -> None:
        """Learn how far steps move that come later under the same commands."""
        place, taken, begun, ended = rows, 0, [rows[:0]], [rows[:0]]
        for steps in self._ahead:
            place, _, code = self.parts.probe(place, h, steps - taken, members)
            later, _, last = self.parts.probe(place, h, 1, members)
            taken, good = steps, (code == 0) & (last == 0) & np.isfinite(later).all(axis=1)
            begun.append(place[good])
            ended.append(later[good])
        begun, ended = np.concatenate(begun), np.concatenate(ended)
        if len(begun):
            self._sizes = larger(self._sizes, sizes_of(self.parts.compare(begun, ended, ended)))
