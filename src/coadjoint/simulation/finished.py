"""What runs and ensembles have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import printable
from coadjoint.simulation.recording import Recording


def no_numbers(run: Any) -> Mapping[str, Any]:
    """None, as of an ensemble."""
    return {}


class Shown(NamedTuple):
    """How a run is told, by functions of it: its certificate as text and, of a single run, as plain numbers."""

    card: Callable[[Any], str]
    numbers: Callable[[Any], Mapping[str, Any]] = no_numbers


class Finished(Recording):
    """A run, or an ensemble, with what the driver left behind."""

    position: Any
    memory: Any
    shown: Shown

    @property
    def seconds(self) -> float:
        """The time spent in the kernel, s; compiling and set-up are in `set_up_seconds`."""
        return self.position.seconds

    @property
    def extrema(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """(minimum, maximum) of monitors and certificates over every step: one number each, or (members,)."""
        return self.position.extrema

    @property
    def count(self) -> int:
        """The number of saved nodes."""
        return sum(len(steps) for steps in self.memory.steps)

    @cached_property
    def steps_saved(self) -> np.ndarray:
        """The step index of every saved node, (nodes,)."""
        return np.concatenate([np.zeros(0, dtype=int), *self.memory.steps])

    def __str__(self) -> str:
        return printable(self.shown.card(self))
