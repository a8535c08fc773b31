"""What a stepper shows, and what an engine does for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from coadjoint.simulation.steppers.buffers import Buffers
from coadjoint.simulation.steppers.fields import Fields


@dataclass(frozen=True)
class Face:
    """What a stepper shows: names and shapes of all it holds, its step, and what to do about a step that fails.

    `members` is None for a single one. `commanded` are the places of the commands in a state, `time` that of t.
    """

    title: str
    dt: float
    members: int | None
    parameters: Fields
    state: Fields
    commands: Fields
    observations: Fields
    commanded: tuple[int, ...]
    time: int
    remedies: tuple[str, str]
    compiled_in: tuple[tuple[int, float], ...] = ()
    """Places and values of parameters that are 0 or 1 in the machine code itself."""

    def compiled_out(self, parameters: np.ndarray) -> list[int]:
        """The places where parameters (members, size) are not what is compiled in."""
        return [place for place, value in self.compiled_in if np.any(parameters[:, place] != value)]

    @property
    def count(self) -> int:
        """How many members there are."""
        return 1 if self.members is None else self.members


class Engine(Protocol):
    """What computes; one engine serves all clones of a stepper."""

    lanes: int

    def advance(self, buffers: Buffers, context: int, groups: int, steps: int, threads: int) -> int:
        """Commands in, `steps` steps of all groups, observations out; 0, or what is wrong (`StatusFlag`)."""
        ...
