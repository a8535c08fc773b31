"""Quantities derived from records: the velocities at the nodes, q and q̇, and vectors in the other frame."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache, partial
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.groups import Power
from coadjoint.kernels.trace.evaluate import Tabulated, tabulate, traced
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.members import Each, member_of
from coadjoint.mechanics.multipliers import least, multipliers
from coadjoint.mechanics.state import Origin, State, with_velocities
from coadjoint.mechanics.system import System
from coadjoint.methods.program import StepProgram
from coadjoint.methods.rattle import kept
from coadjoint.simulation.deferred import are_deferred, blank, together
from coadjoint.texts import Table

BATCH = 1024
"""The number of records evaluated together. It is constant, so that no value depends on the other records."""
MOST_NUMBERS = 1 << 21
"""The most numbers in the matrices of their Legendre transforms; fewer records are evaluated if they exceed it."""

LONG = 400
"""Links from which XLA's compiling takes less time than sweeps over them by NumPy."""


class Derivation:
    """Functions of records of a system, traced once for each shape of them.

    skeleton: the system without parameters. most: the most records evaluated together.
    """

    def __init__(self, skeleton: System, most: int = BATCH):
        self.skeleton, self.most = skeleton, most

    @cached_property
    def _made(self) -> dict[Any, Tabulated]:
        return {}

    def __call__(self, parameters: PyTree, records: State, members: np.ndarray | None = None) -> Table:
        """`place` and `motion` of every record.

        parameters: those of the system; of an ensemble with `co.each`, of which `members` says the member of each
        record, by default the first. Nothing of records without g. Of deferred records the result is deferred.
        """
        given = parameters, records, members
        return {**self._of_rows(_place, *given), **self.motion(*given)}

    def motion(self, parameters: PyTree, records: State, members: np.ndarray | None = None) -> Table:
        """ξ and ν at the node, Ad_g ξ, q̇ = g·ν, and multipliers, if any, of every record."""
        return self._of_rows(_motion, parameters, records, members)

    def _of_rows(
        self, function: Callable[[System, State], Table], parameters: PyTree, records: State, members: Any
    ) -> Table:
        if records.g is None:
            return {}
        shared, own = _split(parameters, members)
        rest, size = (records.replace(memory=kept(records), ledger=None, origin=Origin()), own), self._rows
        made = self._function(partial(self._of_each, function), function.__name__, (shared,), rest, size)
        if not are_deferred(rest):
            return made.of_rows(shared, rest, size)
        count = jax.tree.leaves(rest)[0].shape[0]
        shapes = jax.tree.map(lambda one: jax.ShapeDtypeStruct((count, *one.shape[1:]), one.dtype), made.shapes)
        return together(shapes, lambda: made.of_rows(shared, jax.tree.map(np.asarray, rest), size))

    def velocities(self, parameters: PyTree, state: State) -> tuple[Array, Array]:
        """(ξ, ν) at the node, (dim G,) and (ambient,), of one state; of many, if state and parameters have an axis
        (k, …)."""
        plain = state.replace(memory=None, ledger=None, origin=Origin())
        return self._function(self._velocities, "velocities", (parameters, plain))(parameters, plain)

    def _velocities(self, parameters: PyTree, state: State) -> tuple[Array, Array]:
        def one(parameters: PyTree, state: State) -> tuple[Array, Array]:
            node = at_node(replace_parameters(self.skeleton, parameters), state)
            return node.xi, node.nu

        return (jax.vmap(one) if np.ndim(state.t) else one)(parameters, state)

    @property
    def _rows(self) -> int:
        group, Q, _ = self.skeleton.places
        wide = group.dim * 3 * group.factor.dim if isinstance(group, Power) else (group.dim + Q.dim(group)) ** 2
        return max(1, min(self.most, MOST_NUMBERS // max(wide, 1)))

    def _function(
        self, function: Callable[..., PyTree], name: str, first: PyTree, rest: PyTree = (), size: int = 0
    ) -> Tabulated:
        """The function of `first` and of `size` rows of `rest`, traced once for their shapes."""
        given, rows = jax.tree.flatten(first), jax.tree.flatten(rest)
        key = name, given[1], rows[1], size, *map(np.shape, given[0]), *(leaf.shape[1:] for leaf in rows[0])
        if key not in self._made:
            group = self.skeleton.group
            some = rows[1].unflatten([blank((size, *leaf.shape[1:]), leaf.dtype) for leaf in rows[0]])
            long = isinstance(group, Power) and group.count > LONG
            self._made[key] = tabulate(function, *first, *some, long=long)
        return self._made[key]

    def _of_each(
        self, function: Callable[[System, State], Table], shared: object, records: State, own: dict[int, object]
    ) -> Table:
        leaves, structure = jax.tree.flatten(shared, is_leaf=_is_missing)

        def one(state: State, own: dict[int, object]) -> Table:
            whole = [own.get(i, leaf) for i, leaf in enumerate(leaves)]
            return function(replace_parameters(self.skeleton, jax.tree.unflatten(structure, whole)), state)

        return jax.vmap(one)(records, own)


def derivation(program: StepProgram) -> Derivation:
    """The derivation for a program's system; its traces are kept for further runs of the same functions."""
    return _kept(program.skeleton, program.version)


@lru_cache(maxsize=32)
def _kept(skeleton: System, version: str) -> Derivation:
    return Derivation(skeleton)


def at_nodes(derive: Derivation, system: System, records: State, members: np.ndarray | None = None) -> State:
    """The records with the velocities (ξ, ν) at the nodes in place of those of the steps that start there.

    Their origin keeps the latter as Newton's first guess for a run that continues from one of them. members: as for
    `derive`.
    """
    found = derive.motion(system.parameters, records, members)
    origin = Origin(records.origin.system, (records.xi, records.nu))
    return records.replace(**{name: found[name] for name in ("xi", "nu") if name in found}, origin=origin)


def one_at_node(derive: Derivation, system: System, record: State, unknowns: tuple[Array, Array]) -> State:
    """`at_nodes` of one record; `unknowns`: Newton's guess (ξ, ν) of a run that continues from it."""
    rows = at_nodes(derive, system, jax.tree.map(lambda leaf: np.asarray(leaf)[None], record))
    return jax.tree.map(lambda leaf: leaf[0], rows).replace(origin=Origin(record.origin.system, unknowns))


def after_step(program: StepProgram, parameters: PyTree, state: State, record: State | None = None) -> State:
    """A state after a step as a user reads it: with the velocities (ξ, ν) of its momenta in place of the last unknowns.

    They are computed where they are read first, of many states with parameters of one axis; inside grad, jit and vmap
    at once. Where ℓ is linear in the velocities, or without ℓ and ℋ, the state stays. record: the same node with the
    inputs and the internal state that ℓ reads there; by default the state itself.
    """
    skeleton = program.skeleton
    linear = skeleton.lagrangian is not None and not program.method.regular
    if linear or not known_at_nodes(skeleton, state):
        return state
    place = state if record is None else record
    if traced(parameters, place):
        node = at_node(replace_parameters(skeleton, parameters), place)
        return state.replace(xi=node.xi, nu=node.nu)
    return with_velocities(state, lambda: derivation(program).velocities(parameters, place))


def known_at_nodes(system: System, records: State) -> bool:
    """Whether the velocities at nodes are known: those of the momenta, where there is an ℓ or ℋ, and g."""
    return system.continuous and records.g is not None and records.mu is not None


def _place(system: System, state: State) -> Table:
    """q = g·n and the rotation in g."""
    group, Q, _ = state.places
    return {"q": Q.act(group, state.g, state.n), "rotation": group.rotation(state.g)}


def _motion(system: System, state: State) -> Table:
    """ξ and ν at the node, Ad_g ξ, q̇ = g·ν, and multipliers, if any."""
    (group, Q, _), node = state.places, at_node(system, state)
    found = {
        "xi": node.xi,
        "nu": node.nu,
        "xi_there": group.Ad(state.g, node.xi),
        "qdot": Q.push(group, state.g, state.n, node.nu),
    }
    if system.constraints:
        memory = state.memory
        found["reactions"] = multipliers(system, node, None if memory is None else memory.independent)
        if memory is not None and memory.independent is not None:
            found["step_reactions"] = least(system, node, memory.step, memory.independent)
    return found


def _split(parameters: PyTree, members: np.ndarray | None) -> tuple[Any, dict[int, Any]]:
    """The parameters that all records share, with None for the others, and the others by place, one row per record."""
    if members is None:
        return member_of(parameters, 0), {}
    leaves, structure = jax.tree.flatten(parameters)
    own = {
        i: jax.tree.map(lambda leaf: np.asarray(leaf)[members], leaf.values)
        for i, leaf in enumerate(leaves)
        if isinstance(leaf, Each)
    }
    return jax.tree.unflatten(structure, [None if i in own else leaf for i, leaf in enumerate(leaves)]), own


def _is_missing(leaf: object) -> bool:
    return leaf is None


def times(program: StepProgram, start: State, h: float, steps: np.ndarray, records: State) -> np.ndarray:
    """The times of records, s: those of the grid, or where a variable method or an event has led to."""
    if np.ndim(records.t) == 1 and (program.method.variable or program.events):
        return np.asarray(records.t)
    return np.ravel(start.t)[0] + h * steps
