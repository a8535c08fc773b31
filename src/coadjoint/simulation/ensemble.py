"""Many runs at once: one set of parameters and one start for each member."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.kernels import backend as kernels
from coadjoint.kernels import xla
from coadjoint.kernels.chunk import EnsembleChunk
from coadjoint.kernels.evaluate import evaluate
from coadjoint.kernels.program import Code
from coadjoint.mechanics.each import count_members, member_of, stacked
from coadjoint.mechanics.noether import isotropy_algebras
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System, replace_parameters
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.card import ensemble_card
from coadjoint.simulation.driver import PATIENCE, Extrema, Plan
from coadjoint.simulation.monitors import kelvin_noether
from coadjoint.simulation.progress import Progress
from coadjoint.simulation.recording import Recording

if TYPE_CHECKING:
    import xarray

MEMORY_LIMIT = 8e9
"""Bytes of records beyond which an ensemble is refused: save fewer nodes."""


def count_of(system: System, start: State) -> int | None:
    """How many members a simulation has; None for a single one. Raises ArgumentError for counts that differ."""
    varied, begun = count_members(system.parameters), len(start.t) if np.ndim(start.t) else None
    if varied is not None and begun is not None and varied != begun:
        raise ArgumentError(f"Parameters and start must have equally many members, but have {varied} and {begun}.")
    return begun if varied is None else varied


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


def begin_members(system: System, start: State, method: Method, h: float, count: int) -> Members:
    """Every member's state as the method begins it."""
    parameters, axes = stacked(system.parameters)
    start_axis = 0 if np.ndim(start.t) else None

    def begin(parameters, state):
        return method.begin(replace_parameters(system, parameters), state, h)

    if all(axis is None for axis in jax.tree.leaves(axes, is_leaf=lambda x: x is None)) and start_axis is None:
        raise ArgumentError("An ensemble needs co.each on a parameter or on the start.")
    states = evaluate(jax.vmap(begin, in_axes=(axes, start_axis)), parameters, start)
    return Members(parameters, axes, states, count)


def with_own_directions(
    program: StepProgram, constants: Constants, members: Members, warnings: list[str]
) -> tuple[StepProgram, Constants, Constants]:
    """Constants with the parameters of all members, and with directions c₀ of their own where a₀ differs; with axes.

    Without directions in equal number for all members, Kelvin–Noether quantities are left out, with a warning.
    """
    flags = jax.tree.map(lambda axis: axis == 0, members.axes, is_leaf=lambda x: x is None)
    c0 = constants.monitors.get("c0")
    if c0 is None:
        return program, Constants(members.parameters, constants.monitors), Constants(flags, False)
    places = members.states.places
    a0 = members.states.each(lambda s: places.advected.act(places.group, s.g, s.a))
    if np.max(np.abs(a0 - a0[0]), initial=0.0) <= 1e-12 * np.max(np.abs(a0), initial=0.0):
        return program, Constants(members.parameters, constants.monitors), Constants(flags, False)
    own = isotropy_algebras(program.skeleton, members.states)
    if len({len(rows) for rows in own}) == 1:
        return program, Constants(members.parameters, {"c0": np.stack(own)}), Constants(flags, True)
    warnings.append("The members conserve different numbers of momenta, so that none are watched.")
    observed = tuple(monitor for monitor in program.observed if monitor is not kelvin_noether)
    return replace(program, observed=observed), Constants(members.parameters, {}), Constants(flags, False)


def member_constants(constants: Constants, axes: Constants) -> Constants:
    """The constants of the first member."""
    flags = jax.tree.map(lambda flag, part: jax.tree.map(lambda _: flag, part), axes.system, constants.system)
    system = jax.tree.map(lambda leaf, flag: leaf[0] if flag else leaf, constants.system, flags)
    monitors = jax.tree.map(lambda leaf: leaf[0] if axes.monitors else leaf, constants.monitors)
    return Constants(system, monitors)


@dataclass(repr=False, eq=False)
class Ensemble(Recording):
    """What `co.simulate` returns for many members; `print` it for the certificate.

    `records` have axes (member, node, …); members that failed are NaN from there on, with `steps_done` and `codes`
    telling where and why. `extrema` are (minimum, maximum) over every step, one row a member.
    """

    system: System
    method: Method
    start: State
    plan: Plan
    members: Members
    warnings: list[str]
    steps_done: np.ndarray = field(init=False)
    codes: np.ndarray = field(init=False)
    iterations: np.ndarray = field(init=False)
    iterations_max: np.ndarray = field(init=False)
    extrema: Extrema = field(default_factory=dict, init=False)
    seconds: float = field(default=0.0, init=False)
    set_up_seconds: float = field(default=0.0, init=False)
    steps_saved: np.ndarray = field(init=False)

    def __post_init__(self):
        zeros = np.zeros(self.members.count, dtype=int)
        self.steps_done, self.codes, self.iterations, self.iterations_max = (zeros.copy() for _ in range(4))
        self._chunks: list[EnsembleChunk] = []

    @property
    def title(self) -> str:
        """The system and the method in words."""
        return f"{self.members.count:,} × {self.system.name}, {self.method.title}"

    @property
    def failures(self) -> dict[int, str]:
        """What happened to the members that failed, by their index."""
        failed = np.flatnonzero(self.codes)
        words = {int(code): code.name.lower().replace("_", " ") for code in Code}
        return {int(i): f"{words[int(self.codes[i])]} at step {self.steps_done[i]}" for i in failed}

    @cached_property
    def records(self) -> State:
        """The saved states, axes (member, node, …)."""
        return jax.tree.map(lambda *parts: np.concatenate(parts, axis=1), *[c.records for c in self._chunks])

    @cached_property
    def monitors(self) -> dict[str, np.ndarray]:
        """Every monitored scalar, axes (member, node, …)."""
        names = self._chunks[0].monitors
        return {name: np.concatenate([c.monitors[name] for c in self._chunks], axis=1) for name in names}

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset with dimensions (member, time, …)."""
        from coadjoint.simulation.dataset import ensemble_dataset

        return ensemble_dataset(self)

    def relative_changes(self, name: str) -> np.ndarray:
        """max_k |X_k − X₀| / |X₀| of each member over every good step; absolute where X₀ = 0."""
        low, high = (x.reshape(self.members.count, -1) for x in self.extrema[name])
        first = self.monitors[name][:, 0].reshape(self.members.count, -1)
        size = np.linalg.norm(first, axis=1)
        change = np.linalg.norm(np.maximum(np.abs(high - first), np.abs(first - low)), axis=1)
        return change / np.where(size > 0, size, 1.0)

    def add(self, chunk: EnsembleChunk, keep: bool) -> None:
        """Append a stretch."""
        if keep:
            self._chunks.append(chunk)
        for name, (low, high) in chunk.extrema.items():
            before = self.extrema.get(name, (low, high))
            self.extrema[name] = np.minimum(before[0], low), np.maximum(before[1], high)

    def count_steps(self, chunk: EnsembleChunk) -> None:
        """Take over how far the members came; a member that failed stays where it was."""
        self.steps_done += np.where(self.codes == 0, chunk.steps, 0)
        self.iterations += np.where(self.codes == 0, chunk.iterations, 0)
        self.iterations_max = np.maximum(self.iterations_max, chunk.iterations_max)
        self.codes = np.where(self.codes == 0, chunk.code, self.codes)

    def __str__(self) -> str:
        return ensemble_card(self)

    def __repr__(self) -> str:
        return f"<Ensemble of {self.title}: {len(self.failures)} failed; print it for the certificate>"


def drive(ensemble: Ensemble, axes: Any, progress: bool | None) -> None:
    """Run all members to the end, each to its own first bad step."""
    plan, members = ensemble.plan, ensemble.members
    nodes = plan.steps // plan.save_every + (plan.steps % plan.save_every > 0) + 1
    size = sum(leaf[0].nbytes for leaf in jax.tree.leaves(members.states)) * members.count * nodes
    if size > MEMORY_LIMIT:
        raise ArgumentError(
            f"The records of this ensemble would take {size / 1e9:.1f} GB: raise save_every from {plan.save_every} to "
            f"{int(plan.save_every * size / MEMORY_LIMIT) + 1} or more."
        )

    def run(state: State, records: int, every: int) -> EnsembleChunk:
        arguments = (plan.program, plan.constants, state, plan.h, records, every, plan.monitors)
        return kernels.run_ensemble(plan.backend, *arguments, axes=(axes, True))

    state, done, records, saved = members.states, 0, 1, []
    run(state, 1, 1)  # compiling is set-up
    with Progress(plan.steps, progress, ensemble.title) as bar:
        while done < plan.steps:
            every = min(plan.save_every, plan.steps - done)
            records = min(records, (plan.steps - done) // every)
            began = time.perf_counter()
            chunk = run(state, records, every)
            spent = time.perf_counter() - began
            ensemble.add(chunk, keep=True)
            ensemble.count_steps(chunk)
            ensemble.seconds += spent
            saved.append(done + every * np.arange(records))
            state, done = chunk.final, done + records * every
            bar.advance(records * every, ensemble.seconds)
            records = int(np.clip(records * min(PATIENCE / max(spent, 1e-6), 8.0), 1, xla.ENSEMBLE_CAPACITY))
    last = run(state, 1, 1)
    ensemble.add(last, keep=True)
    ensemble.codes = np.where(ensemble.codes == 0, last.code, ensemble.codes)
    ensemble.steps_saved = np.concatenate([*saved, [plan.steps]])
