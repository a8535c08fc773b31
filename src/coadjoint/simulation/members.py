"""The members of an ensemble: their number, and their states as a method begins them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.members import count_members, member_of, stacked
from coadjoint.mechanics.noether import isotropy_algebras
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import with_ledger
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.rattle import around
from coadjoint.simulation.energy_budget import LISTED
from coadjoint.simulation.monitors import kelvin_noether
from coadjoint.simulation.result import Result


@dataclass(frozen=True)
class Members:
    """An ensemble ready to run: parameters, and states with a leading axis of members."""

    parameters: PyTree
    axes: Any
    """Like `parameters`: 0 for a leaf with a member axis, None elsewhere."""
    states: State
    count: int


MEMORY_LIMIT = 8e9
"""Bytes of records beyond which an ensemble must stream to disk, or save fewer nodes."""


ROUND_OFF = 1e-14
"""The relative difference of times of members that counts as round-off of different sums."""


def count_of(system: System, start: State) -> int | None:
    """How many members a simulation has; None for a single one. Raises ArgumentError for counts that differ."""
    varied, begun = count_members(system.parameters), len(start.t) if np.ndim(start.t) else None
    if varied is not None and begun is not None and varied != begun:
        raise ArgumentError(f"Parameters and start must have equally many members, but have {varied} and {begun}.")
    return begun if varied is None else varied


def require_one_time(start: State) -> None:
    """Raise ArgumentError if the states given for members are records at several times, such as those of one run."""
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
    for step in dict.fromkeys(step for step, _ in around(system, method.stages)):
        found = step.require_members(system, parameters, axes, states, start)
        states = states if found is None else found
    return Members(parameters, axes, states, count)


def require_chart_of_members(system: System, method: Method, members: Members, h: float) -> None:
    """Raise if already the first step of a member leaves the chart of the difference map; names these members."""

    def reach(parameters: PyTree, state: State) -> Array:
        here = replace_parameters(system, parameters)
        return jnp.stack([jnp.asarray(step.chart(here, state, np.float64(h) * f), float) for step, f in method.stages])

    found = evaluate(jax.vmap(reach, in_axes=(members.axes, 0)), members.parameters, members.states).max(axis=1)
    beyond = np.flatnonzero(found >= 1)
    if len(beyond):
        which = ", ".join(map(str, beyond[:LISTED])) + (", …" if len(beyond) > LISTED else "")
        raise ArgumentError(
            f"Argument `dt` = {h:g} is too large: the first step of {len(beyond)} of {members.count} members "
            f"({which}) would leave the chart of {method.stages[0][0].difference_map!r} by a factor up to "
            f"{found.max():.3g}; take dt < {h / found.max():.3g}, or leave them out."
        )


def with_own_directions(
    program: StepProgram, constants: Constants, members: Members, warnings: list[str]
) -> tuple[StepProgram, Constants, Constants]:
    """Constants with the parameters of all members, and separate directions c₀ if a₀ differs; with axes.

    Without directions in equal number for all members, Kelvin–Noether quantities are left out, with a warning.
    """
    flags = jax.tree.map(lambda axis: axis == 0, members.axes, is_leaf=lambda x: x is None)
    renewal = constants.renewal

    def of_members(monitors: object, own: bool) -> tuple[Constants, Constants]:
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


def require_room(run: Result) -> None:
    """Raise ArgumentError if the records would not fit in memory."""
    plan = run.plan
    size = sum(np.asarray(leaf).nbytes for leaf in jax.tree.leaves(run.position.state)) * plan.nodes
    if size > MEMORY_LIMIT:
        raise ArgumentError(
            f"The records would take {size / 1e9:.3g} GB of memory: stream them to a new folder with `store=`, "
            f"or raise save_every from {plan.save_every} to {int(plan.save_every * size / MEMORY_LIMIT) + 1} or more."
        )


def require_room_for(state: State, blocks: tuple[int, int]) -> None:
    """Raise ArgumentError if the records of a trajectory, blocks = (records, save_every), would not fit in memory."""
    records, save_every = blocks
    size = sum(8.0 * np.size(leaf) for leaf in jax.tree.leaves(state)) * records
    if size > MEMORY_LIMIT:
        raise ArgumentError(
            f"The {records:,} records of this trajectory would take {size / 1e9:.3g} GB of memory: raise save_every "
            f"from {save_every} to {int(save_every * size / MEMORY_LIMIT) + 1} or more."
        )
