"""A finished run: its records, its certificate, its dataset and plots."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import Origin, State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants
from coadjoint.simulation.accuracy.judgement import Accuracy
from coadjoint.simulation.derived import derivation, one_at_node
from coadjoint.simulation.driver import Memory, Plan, Position
from coadjoint.simulation.finished import Finished, Shown

if TYPE_CHECKING:
    import xarray


@dataclass(repr=False, eq=False)
class Run(Finished):
    """What `co.simulate` returns; `print` it for the certificate.

    records: the saved states, with a leading axis of nodes in every leaf; ξ and ν are those of the step that starts at
    the node. final: the last of them, with ξ and ν at the node itself, as in the dataset. monitors: name →
    (nodes,) or (nodes, k). extrema: name → (minimum, maximum) of every monitored scalar over all steps, saved or not.
    accuracy: how well the steps that were judged resolve the motion. dataset: the same as an xarray.Dataset with names
    and units. plot: figures. `save(path)` writes the dataset, `at(times)` gives the motion between the nodes.
    """

    system: System
    method: Method
    start: State
    plan: Plan
    position: Position
    memory: Memory
    warnings: list[str]
    shown: Shown
    set_up_seconds: float = 0.0
    crossed: dict[str, list[State]] = field(default_factory=dict)
    accuracy: Accuracy | None = None

    @property
    def title(self) -> str:
        """The system and the method in words."""
        return f"{self.system.name}, {self.method.title}"

    @property
    def one(self) -> tuple[Constants, State]:
        """What the equations are traced for: the constants, and the state at which the run stands."""
        return self.plan.constants, self.position.state

    @property
    def dt(self) -> float:
        """The step size h, s."""
        return self.plan.h

    @property
    def steps(self) -> int:
        """The number of steps requested; `good_steps` were done."""
        return self.plan.steps

    @property
    def good_steps(self) -> int:
        """The number of steps done."""
        return self.position.steps

    @property
    def event(self) -> float | None:
        """When `until` crossed zero and ended the run, s; None where it did not."""
        return self.position.event

    @cached_property
    def events(self) -> dict[str, State]:
        """The records at the events, in order, by the names given in `events`: States with a leading axis."""
        one = self.position.state
        return {name: self._of_this(stacked_records(states, one)) for name, states in self.crossed.items()}

    def at(self, times: Any) -> State:
        """The records at times between the nodes (k,), s: a State with a leading axis.

        The method's own steps lead from the saved node before: Φ_{θh} ∘ Φ_h ∘ … ∘ Φ_h, so that momenta are as exact as
        at the nodes and the order is the method's. Raises ArgumentError for times outside the run.
        """
        from coadjoint.simulation.dense import at_times

        return self._of_this(at_times(self.plan, self.records, times))

    @cached_property
    def records(self) -> State:
        """The saved states, every leaf with a leading axis."""
        if not self.memory.records:
            raise ArgumentError("This run holds no records: its first step failed.")
        return self._of_this(jax.tree.map(lambda *parts: np.concatenate(parts), *self.memory.records))

    def _of_this(self, records: State) -> State:
        """Records that know of which system's run they are."""
        return records.replace(origin=Origin(self.system))

    @cached_property
    def monitors(self) -> dict[str, np.ndarray]:
        """Every monitored scalar, one row a record: (nodes, …) each."""
        rows = self.memory.monitors
        return {name: np.concatenate([part[name] for part in rows]) for name in (rows[0] if rows else {})}

    @property
    def ends(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Every monitored scalar at the first and at the last record, of the shape of one row of `monitors`."""
        return {name: (rows[0], rows[-1]) for name, rows in self.monitors.items()}

    @cached_property
    def final(self) -> State:
        """The last record, with the velocities at the node in place of those of the step that starts there."""
        return one_at_node(derivation(self), self.system, self.last_record)

    @property
    def last_record(self) -> State:
        """The last record as a row of `records`."""
        return jax.tree.map(lambda rows: rows[-1], self.records)

    @property
    def newton_iterations_mean(self) -> float:
        """Newton iterations a step."""
        return self.position.iterations / max(self.good_steps, 1)

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset."""
        from coadjoint.simulation.dataset import dataset

        return dataset(self)

    def _last_record(self) -> dict[str, Any]:
        from coadjoint.simulation.last_record import written

        return written(self)

    def size(self, name: str) -> float:
        """|X₀| of a monitored X, to which its changes are relative; 0 where it is round-off of what X becomes."""
        return float(sizes(*(np.ravel(x) for x in (self.ends[name][0], *self.extrema[name]))))

    def relative_change(self, name: str) -> float:
        """max_k |X_k − X₀| / |X₀| over every step, for a monitored X; absolute where `size` is 0."""
        low, high = self.extrema[name]
        first = self.ends[name][0]
        change = float(np.linalg.norm(np.maximum(np.abs(high - first), np.abs(first - low))))
        return change / (self.size(name) or 1.0)

    def largest(self, name: str) -> float:
        """The largest value of a monitored scalar over every step."""
        return float(np.max(self.extrema[name][1]))

    def summary(self) -> dict[str, Any]:
        """The certificate as plain numbers."""
        return dict(self.shown.numbers(self))

    def __repr__(self) -> str:
        return f"<Run of {self.title}: {self.good_steps} of {self.steps} steps; print it for the certificate>"


def sizes(first: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """|X₀| along the last axis, (…,), of X₀ and of the bounds of X; 0 where it is round-off of what X becomes."""
    size = np.linalg.norm(first, axis=-1)
    return np.where(size > 1e-9 * np.linalg.norm(np.maximum(np.abs(low), np.abs(high)), axis=-1), size, 0.0)


def stacked_records(states: list[State], like: State) -> State:
    """Records as one State with a leading axis, of length 0 where there are none."""
    if not states:
        return jax.tree.map(lambda leaf: np.zeros((0, *np.shape(leaf))), like)
    return jax.tree.map(lambda *leaves: np.stack(leaves), *states)
