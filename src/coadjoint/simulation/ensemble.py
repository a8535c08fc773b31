"""Many runs at once: one set of parameters and one start for each member."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.kernels.program import Code
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.members import count_members, member_of, stacked
from coadjoint.mechanics.noether import isotropy_algebras
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import with_ledger
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.accuracy.judgement import Accuracy
from coadjoint.simulation.derived import at_nodes, derivation
from coadjoint.simulation.driver import Extrema, Memory, Plan
from coadjoint.simulation.ensemble_driver import MembersPosition
from coadjoint.simulation.finished import Finished, Shown
from coadjoint.simulation.monitors import kelvin_noether
from coadjoint.simulation.run import sizes, stacked_records

if TYPE_CHECKING:
    import xarray

    from coadjoint.simulation.run import Run

MEMORY_LIMIT = 8e9
"""Bytes of records beyond which an ensemble must stream to disk, or save fewer nodes."""


ROUND_OFF = 1e-14
"""By how much, relative, times of members may differ that are the same but for how they were added up."""


def count_of(system: System, start: State) -> int | None:
    """How many members a simulation has; None for a single one. Raises ArgumentError for counts that differ."""
    varied, begun = count_members(system.parameters), len(start.t) if np.ndim(start.t) else None
    if varied is not None and begun is not None and varied != begun:
        raise ArgumentError(f"Parameters and start must have equally many members, but have {varied} and {begun}.")
    return begun if varied is None else varied


def require_one_time(start: State) -> None:
    """Raise ArgumentError where what should be states of members are records at several times, as those of one run."""
    t = np.asarray(start.t)
    known = t[np.isfinite(t)]
    if t.ndim and known.size and np.ptp(known) > ROUND_OFF * np.max(np.abs(known)):
        raise ArgumentError(
            f"Argument `start` must be one state, or one for each member at one time, but holds {known.size} records "
            f"from t = {known.min():.6g} s to {known.max():.6g} s: of one run take `run.final`, or its record k, "
            "jax.tree.map(lambda rows: rows[k], run.records); members that ended at several times get one time by "
            f"start.replace(t=np.zeros({t.size}))."
        )


def first_member(system: System, start: State) -> tuple[System, State]:
    """The system and the start of the first member."""
    system = replace_parameters(system, member_of(system.parameters, 0))
    return system, jax.tree.map(lambda leaf: leaf[0], start) if np.ndim(start.t) else start


@dataclass(frozen=True)
class Members:
    """An ensemble ready to run: parameters, and states with a leading axis of members."""

    parameters: Any
    axes: Any
    """Like `parameters`: 0 where a leaf has a member axis, None elsewhere."""
    states: State
    count: int


def begin_members(system: System, start: State, method: Method, h: float, count: int, monitors: bool) -> Members:
    """Every member's state as the method begins it."""
    parameters, axes = stacked(system.parameters)
    start_axis = 0 if np.ndim(start.t) else None

    def begin(parameters, state):
        here = replace_parameters(system, parameters)
        return with_ledger(here, method.begin(here, state, h), monitors)

    if all(axis is None for axis in jax.tree.leaves(axes, is_leaf=lambda x: x is None)) and start_axis is None:
        raise ArgumentError("An ensemble needs co.each on a parameter or on the start.")
    states = evaluate(jax.vmap(begin, in_axes=(axes, start_axis)), parameters, start)
    for step in dict.fromkeys(step for step, _ in method.stages):
        step.require_members(system, parameters, axes, states)
    return Members(parameters, axes, states, count)


def with_own_directions(
    program: StepProgram, constants: Constants, members: Members, warnings: list[str]
) -> tuple[StepProgram, Constants, Constants]:
    """Constants with the parameters of all members, and with directions c₀ of their own where a₀ differs; with axes.

    Without directions in equal number for all members, Kelvin–Noether quantities are left out, with a warning.
    """
    flags = jax.tree.map(lambda axis: axis == 0, members.axes, is_leaf=lambda x: x is None)
    renewal = constants.renewal

    def of_members(monitors: Any, own: bool) -> tuple[Constants, Constants]:
        axis = None if renewal is None else False
        return Constants(members.parameters, monitors, renewal), Constants(flags, own, axis)

    c0 = constants.monitors.get("c0")
    if c0 is None or members.states.g is None:
        return program, *of_members(constants.monitors, False)
    places = members.states.places
    a0 = members.states.each(lambda s: places.advected.act(places.group, s.g, s.a))
    if np.max(np.abs(a0 - a0[0]), initial=0.0) <= 1e-12 * np.max(np.abs(a0), initial=0.0):
        return program, *of_members(constants.monitors, False)
    own = isotropy_algebras(program.skeleton, members.states)
    if len({len(rows) for rows in own}) == 1:
        return program, *of_members({"c0": np.stack(own)}, True)
    warnings.append("The members conserve different numbers of momenta, so that none are watched.")
    observed = tuple(monitor for monitor in program.observed if monitor is not kelvin_noether)
    return replace(program, observed=observed), *of_members({}, False)


def member_constants(constants: Constants, axes: Constants, index: int = 0) -> Constants:
    """The constants of one member."""
    flags = jax.tree.map(lambda flag, part: jax.tree.map(lambda _: flag, part), axes.system, constants.system)
    system = jax.tree.map(lambda leaf, flag: leaf[index] if flag else leaf, constants.system, flags)
    monitors = jax.tree.map(lambda leaf: leaf[index] if axes.monitors else leaf, constants.monitors)
    return Constants(system, monitors, constants.renewal)


@dataclass(repr=False, eq=False)
class Ensemble(Finished):
    """What `co.simulate` returns for many members; `print` it for the certificate.

    `records` have axes (member, node, …); members that failed are NaN from there on, with `steps_done` and `codes`
    saying where and why. `extrema` are (minimum, maximum) over every step, one row a member.
    """

    system: System
    method: Method
    start: State
    plan: Plan
    members: Members
    axes: Constants
    """Like the constants of the plan: True where a leaf has a member axis."""
    position: MembersPosition
    memory: Memory
    warnings: list[str]
    shown: Shown
    set_up_seconds: float = 0.0
    crossed: dict[str, list[list[State]]] = field(default_factory=dict)
    ended: dict[int, State] = field(default_factory=dict)
    """The records at the events that ended members, by their index."""
    accuracy: Accuracy | None = None

    @property
    def title(self) -> str:
        """The system and the method in words."""
        return f"{self.members.count:,} × {self.system.name}, {self.method.title}"

    @property
    def one(self) -> tuple[Constants, State]:
        """What the equations are traced for: the constants of the first member, and its state."""
        state = jax.tree.map(lambda leaf: leaf[0], self.position.state)
        return member_constants(self.plan.constants, self.axes), state

    @property
    def steps_done(self) -> np.ndarray:
        """How many good steps each member did, (members,)."""
        return self.position.steps_done

    @property
    def codes(self) -> np.ndarray:
        """How the last step of each member ended, (members,), 0 where it was good."""
        return self.position.codes

    @property
    def iterations(self) -> np.ndarray:
        """Newton's, over all good steps of each member, (members,)."""
        return self.position.iterations

    @property
    def failures(self) -> dict[int, str]:
        """What happened to the members that failed, by their index."""
        failed = np.flatnonzero(self.codes)
        words = {int(code): code.name.lower().replace("_", " ") for code in Code}
        return {int(i): f"{words[int(self.codes[i])]} at step {self.steps_done[i]}" for i in failed}

    @cached_property
    def records(self) -> State:
        """The saved states, axes (member, node, …)."""
        return jax.tree.map(_members_first, *self.memory.records)

    @cached_property
    def monitors(self) -> dict[str, np.ndarray]:
        """Every monitored scalar, of shape (members, nodes, …)."""
        return jax.tree.map(_members_first, *map(dict, self.memory.monitors))

    @property
    def ends(self) -> Extrema:
        """Every monitored scalar at the first and at the last node, one row a member."""
        return {name: (rows[:, 0], rows[:, -1]) for name, rows in self.monitors.items()}

    @property
    def final(self) -> State:
        """The records of all members at the last node, or at the event that ended them, with ξ and ν at the node."""
        last = jax.tree.map(lambda rows: np.array(rows[:, -1]), self.records)
        for index, state in self.ended.items():
            jax.tree.map(lambda rows, leaf, index=index: rows.__setitem__(index, leaf), last, state)
        return at_nodes(derivation(self), self.system, last, np.arange(len(self.codes)))

    @property
    def event(self) -> np.ndarray | None:
        """When `until` crossed zero and ended each member, s, (members,), NaN where it did not; None without it."""
        return self.position.event if self.plan.until else None

    @cached_property
    def events(self) -> dict[str, tuple[State, ...]]:
        """The records at the events, in order, by the names given in `events`: for each member a State."""
        one = self.one[1]
        return {name: tuple(stacked_records(rows, one) for rows in found) for name, found in self.crossed.items()}

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset with dimensions (member, time, …)."""
        from coadjoint.simulation.dataset import ensemble_dataset

        return ensemble_dataset(self)

    def statistics(
        self, variables: str | Sequence[str] | None = None, quantiles: Sequence[float] = (0.05, 0.5, 0.95)
    ) -> xarray.Dataset:
        """Mean, standard deviation, extremes and quantiles over the members, at every saved node.

            fleet.statistics(["q", "euler_angles"]).q.sel(statistic="95%")

        Arguments, labels and errors as in `simulation.statistics`; all variables by default.
        """
        from coadjoint.simulation.statistics import statistics

        return statistics(self.dataset, variables, quantiles)

    def sizes(self, name: str) -> np.ndarray:
        """|X₀| of each member, (members,), to which changes are relative; 0 where it is round-off of what X becomes."""
        low, high, first = (x.reshape(self.members.count, -1) for x in (*self.extrema[name], self.ends[name][0]))
        return sizes(first, low, high)

    def relative_changes(self, name: str) -> np.ndarray:
        """max_k |X_k − X₀| / |X₀| of each member over every good step, (members,); absolute where `sizes` are 0."""
        low, high, first = (x.reshape(self.members.count, -1) for x in (*self.extrema[name], self.ends[name][0]))
        change = np.linalg.norm(np.maximum(np.abs(high - first), np.abs(first - low)), axis=1)
        size = self.sizes(name)
        return change / np.where(size > 0, size, 1.0)

    def __repr__(self) -> str:
        return f"<Ensemble of {self.title}: {len(self.failures)} failed; print it for the certificate>"


def _members_first(*parts: np.ndarray) -> np.ndarray:
    """Stretches with axes (node, member, …) as one array with axes (member, node, …)."""
    return np.concatenate([np.swapaxes(part, 0, 1) for part in parts], axis=1)


def require_room(run: Run | Ensemble) -> None:
    """Raise ArgumentError where the records would not fit in memory."""
    plan = run.plan
    nodes = -(-plan.steps // plan.save_every) + 1
    states = run.members.states if isinstance(run, Ensemble) else run.position.state
    size = sum(np.asarray(leaf).nbytes for leaf in jax.tree.leaves(states)) * nodes
    if size > MEMORY_LIMIT:
        raise ArgumentError(
            f"The records would take {size / 1e9:.3g} GB of memory: stream them to a new folder with `store=`, "
            f"or raise save_every from {plan.save_every} to {int(plan.save_every * size / MEMORY_LIMIT) + 1} or more."
        )
