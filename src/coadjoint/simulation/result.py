"""The result of a run, of one system or of the members of an ensemble, after the driver has finished."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants
from coadjoint.simulation.accuracy.accuracy import Accuracy
from coadjoint.simulation.plan import Extrema, Plan
from coadjoint.simulation.recording import Recording


@dataclass(repr=False, eq=False)
class Result(Recording):
    """A run, or an ensemble, whose arrays have a first axis of members.

    ended: the records at the events that ended members, by their index.
    """

    system: System
    method: Method
    start: State
    plan: Plan
    position: Any
    memory: Any
    warnings: list[str]
    set_up_seconds: float = 0.0
    crossed: dict[str, list[Any]] = field(default_factory=dict)
    accuracy: Accuracy | None = None
    ended: dict[int, State] = field(default_factory=dict)

    @abstractmethod
    def summary(self) -> dict[str, Any]:
        """The certificate as plain numbers."""

    @property
    def members(self) -> int | None:
        """How many members an ensemble has; None of a single run."""
        return self.plan.members

    @property
    def title(self) -> str:
        """The system and the method as text."""
        many = "" if self.members is None else f"{self.members:,} × "
        return f"{many}{self.system.name}, {self.method.title}"

    @property
    def one(self) -> tuple[Constants, State]:
        """The constants of the first member and its state, for which the equations are traced."""
        state = self.position.state
        return self.plan.constants_of(), state if self.members is None else jax.tree.map(lambda leaf: leaf[0], state)

    @property
    def seconds(self) -> float:
        """The time spent in the kernel, s; compiling and set-up are in `set_up_seconds`."""
        return self.position.seconds

    @property
    def good_steps(self) -> int:
        """The number of steps done, by all members together."""
        return int(np.sum(self.position.steps if self.members is None else self.position.steps_done))

    @property
    def event(self) -> Any:
        """When `until` crossed zero and ended the run, s; None if it did not, or NaN of a member, (members,)."""
        return self.position.event if self.plan.until else None

    @property
    def count(self) -> int:
        """The number of saved nodes."""
        return sum(len(steps) for steps in self.memory.steps)

    @cached_property
    def steps_saved(self) -> np.ndarray:
        """The step index of every saved node, (nodes,)."""
        return np.concatenate([np.zeros(0, dtype=int), *self.memory.steps])

    @cached_property
    def records(self) -> State:
        """The saved states, every leaf with axes ([member,] node, …)."""
        if not self.memory.records:
            raise ArgumentError("This run holds no records: its first step failed.")
        return jax.tree.map(self._joined, *self.memory.records)

    @cached_property
    def monitors(self) -> dict[str, np.ndarray]:
        """Every monitored scalar, ([members,] nodes, …) each."""
        rows: list[Mapping[str, np.ndarray]] = self.memory.monitors
        return {name: self._joined(*(part[name] for part in rows)) for name in (rows[0] if rows else {})}

    def rows_of(self, names: Sequence[str], members: slice = slice(None)) -> dict[str, np.ndarray]:
        """Some monitors at the saved nodes, ([members,] nodes, …) each, of some members; none is kept in memory."""
        return {name: self.monitors[name][members] for name in names}

    def node_times(self) -> np.ndarray:
        """The times of the saved nodes, s, (nodes,); for a single run the times of its records."""
        if self.members is None:
            return np.asarray(self.records.t)
        return self.plan.h * self.steps_saved + np.ravel(self.start.t)[0]

    def _joined(self, *parts: np.ndarray) -> np.ndarray:
        """Stretches with axes (node, [member,] …) as one array with axes ([member,] node, …)."""
        if self.members is None:
            return np.concatenate(parts)
        return np.concatenate([np.swapaxes(part, 0, 1) for part in parts], axis=1)

    @property
    def extrema(self) -> Extrema:
        """(minimum, maximum) of monitors and certificates over every step, of the shape of a row of `monitors`."""
        return self.position.extrema

    @property
    def ends(self) -> Extrema:
        """Every monitored scalar at the first and at the last record, of the shape of a row of `monitors`."""
        lead = () if self.members is None else (slice(None),)
        return {name: (rows[(*lead, 0)], rows[(*lead, -1)]) for name, rows in self.monitors.items()}

    def sizes(self, name: str) -> np.ndarray:
        """|X₀| of a monitored X, ([members]), to which changes are relative; 0 if it is round-off of later X."""
        low, high, first = self._bounds(name)
        size = np.linalg.norm(first, axis=-1)
        return np.where(size > 1e-9 * np.linalg.norm(np.maximum(np.abs(low), np.abs(high)), axis=-1), size, 0.0)

    def relative_changes(self, name: str) -> np.ndarray:
        """max_k |X_k − X₀| / |X₀| over every good step, ([members]), of a monitored X; absolute where its size is 0."""
        low, high, first = self._bounds(name)
        widest = np.maximum(np.abs(high - first), np.abs(first - low))
        change, size = np.linalg.norm(widest, axis=None if self.members is None else 1), self.sizes(name)
        return change / np.where(size > 0, size, 1.0)

    def _bounds(self, name: str) -> list[np.ndarray]:
        """The least, the largest and the first value of a monitored X, ([members,] components)."""
        lead = () if self.members is None else (self.members,)
        return [np.reshape(x, (*lead, -1)) for x in (*self.extrema[name], self.ends[name][0])]
