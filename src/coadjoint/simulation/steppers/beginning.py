"""States that a stepper can take: packed in rows, begun by a method, and carried over a change of parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels import packing
from coadjoint.kernels.packing import Layout, layout
from coadjoint.kernels.run.ensemble import members_of
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics import inverse_legendre, phase_space
from coadjoint.mechanics.constrained_start import require_on, surveyed
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.restart_checks import going_on
from coadjoint.mechanics.start import legendre, with_own_momenta
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants
from coadjoint.methods.rattle import kept
from coadjoint.methods.step import in_records
from coadjoint.simulation.arguments import require_places

Shapes = dict[str, tuple[int, ...]]


def shapes_of(tree: PyTree) -> Shapes:
    """Name → shape of every leaf, in their order: `internal.rudder`, `g[0]`, …"""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {jax.tree_util.keystr(path).lstrip("."): np.shape(leaf) for path, leaf in leaves}


def rows_where(tree: PyTree, axes: PyTree) -> np.ndarray:
    """Numbers (members, size) of a tree whose leaves have an axis of members where `axes` is 0; (1, size) of none."""
    return members_of(tree, jax.tree.map(lambda axis: axis == 0, axes, is_leaf=lambda axis: axis is None))[1]


def spread(tree: PyTree, lead: tuple[int, ...]) -> PyTree:
    """A tree of one member for each member."""
    return jax.tree.map(lambda leaf: np.broadcast_to(leaf, (*lead, *np.shape(leaf))).copy(), tree)


class Beginning:
    """States of `members` (None: of a single one) that `method` begins with steps of h, as rows (members, size).

    like: a state that was begun, and constants, of one member: their layouts. by_xla: whether XLA takes the steps.
    """

    def __init__(
        self,
        skeleton: System,
        method: Method,
        h: float,
        members: int | None,
        like: State,
        constants: Constants,
        by_xla: bool = False,
    ):
        self.skeleton, self.method, self.h, self.members, self.by_xla = skeleton, method, h, members, by_xla
        self.state, self.constants, self.held = layout(like), layout(constants), like.inputs
        self.independent = None if kept(like) is None else like.memory.independent
        self._tabulated: dict[Layout, Callable[..., PyTree]] = {}

    def rows(self, state: State, parameters: np.ndarray) -> np.ndarray:
        """States of all members from one, or from all, that system.state(…), a stepper or a run has given.

        Raises ArgumentError for a state of another system.
        """
        require_places(state, self.skeleton.places, "state")
        count, many = (1 if self.members is None else self.members), np.ndim(state.t) > 0
        if many and (self.members is None or len(state.t) != count):
            raise ArgumentError(f"Argument `state` must be of {count} members, but is of {len(state.t)}.")
        state = going_on(state)
        whole = state if many else spread(state, (count,))
        if state.from_velocities:
            # The inputs held at the start are those of the stepper.
            held = None if self.held is None else spread(self.held, (count,))
            return self.begun(whole, parameters, held)
        whole = evaluate(jax.vmap(self.carrying), whole.replace(ledger=None))
        self._require_like(whole)
        return packing.rows(whole, count)

    def begun(self, starts: State, parameters: np.ndarray, held: PyTree) -> np.ndarray:
        """The states (members, size) that the method begins at starts with an axis of members, under held inputs."""
        count = len(starts.t)
        constants = self.constants.unpack(np.broadcast_to(parameters, (count, parameters.shape[1])))

        def begin(constants: Constants, state: State, held: PyTree) -> State:
            system = replace_parameters(self.skeleton, constants.system)
            if self.method.start != "velocity":
                state = with_own_momenta(system.driven(None), state)
            begun = self.method.begin(system, state.replace(inputs=held), self.h)
            if self.independent is not None:  # found by numbers, which a trace does not have
                begun = begun.replace(memory=replace(begun.memory, independent=self.independent))
            return self.carrying(begun)

        given = constants, starts, held
        form = layout(given)
        if form not in self._tabulated:
            self._tabulated[form] = tabulate(jax.vmap(begin), *given)
        states = self._tabulated[form](*given)
        self._require_like(states)
        return packing.rows(states, count)

    @property
    def linear(self) -> bool:
        """Whether momenta are those of the place, because ℓ is linear in the velocities."""
        return self.skeleton.lagrangian is not None and not self.method.regular

    def require_place(self, states: np.ndarray, parameters: np.ndarray, whose: str) -> None:
        """Raise ArgumentError for a state (k, size) that is off a constraint with parameters (k or 1, size), or whose
        momenta are not those of its place where they have to be.
        """
        if not self.skeleton.constraints and not self.linear:
            return
        rows = np.broadcast_to(parameters, (len(states), parameters.shape[1]))
        given = self.constants.unpack(rows), self.state.unpack(states)

        def survey(constants: Constants, state: State) -> PyTree:
            system = replace_parameters(self.skeleton, constants.system)
            return phase_space.velocities(system, state) if self.linear else surveyed(system, state)

        form = layout(given)
        if form not in self._tabulated:
            self._tabulated[form] = tabulate(jax.vmap(survey), *given)
        found = self._tabulated[form](*given)
        if self.linear:
            phase_space.require_momenta(found, whose)
        else:
            require_on(self.skeleton, found, whose)

    def fitting(self, constants: Constants, state: State) -> Constants:
        """The constants; raises ArgumentError where momenta of one state have to be those of its place, but are not."""
        if self.linear and not traced(constants, state):
            system = replace_parameters(self.skeleton, constants.system)
            found = evaluate(lambda state: phase_space.velocities(system, state), state)
            phase_space.require_momenta(found, "the state under these parameters")
        return constants

    def of_momenta(self) -> tuple[int, ...]:
        """The places of the parameters that the momenta of a place depend on, where ℓ is linear in the velocities."""
        if not self.linear:
            return ()

        def momenta(constants: Constants, state: State) -> tuple[PyTree, PyTree]:
            system = replace_parameters(self.skeleton, constants.system)
            return legendre(system, state.xi, state.n, state.nu, state.a, state.t, state.inputs, state.internal)

        given = (form.unpack(np.zeros(form.size)) for form in (self.constants, self.state))
        sizes = [math.prod(shape) for shape in self.constants.shapes]
        return tuple(np.flatnonzero(np.repeat(depends(momenta, *given)[: len(sizes)], sizes)).tolist())

    def carrying(self, state: State) -> State:
        """A state of a run or stepper with the values that XLA steps carry over, or without them for machine code."""
        return self.method.begin_by_xla(self.skeleton, state) if self.by_xla else in_records(state)

    def _require_like(self, states: State) -> None:
        single = jax.tree.map(lambda leaf: leaf[0], states)
        if layout(single) != self.state:
            raise ArgumentError(
                "Argument `state` must hold what the states of this stepper hold: make it by system.state(…) with all "
                "that its start has, or take it from `stepper.state`."
            )


ROUND_OFF = 1e-12
"""The smallest eigenvalue, relative to the largest, whose sign counts."""


def carried(beginning: Beginning, states: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """States (k, size) after a change of parameters (k, size) at which the velocities of the node are continuous.

    (ξ, ν) solves ∂ℓ(ξ, ν; before) = (μ, π), and (μ, π) jumps by ∂ℓ(ξ, ν; after) − ∂ℓ(ξ, ν; before): a dropped
    mass takes its own momentum away, and a parameter that does not enter ℓ changes nothing.
    Raises ArgumentError if an eigenvalue of ∂²ℓ/∂(ξ, ν)² changes its sign, as with a negative mass.
    """
    if not beginning.skeleton.continuous:
        raise ArgumentError(
            'A system with only a discrete Lagrangian has no velocity at a node that could stay: pass keep="momentum".'
        )

    weighed = beginning.skeleton.lagrangian is not None

    def carry(before: Constants, after: Constants, state: State) -> tuple[State, Any, Any]:
        old, new = (replace_parameters(beginning.skeleton, constants.system) for constants in (before, after))
        xi, nu, residual = inverse_legendre.velocities(old, state)
        place = (xi, state.n, nu, state.a, state.t, state.inputs, state.internal)
        (mu, pi), (mu_new, pi_new) = legendre(old, *place), legendre(new, *place)
        moved = state.replace(mu=state.mu + (mu_new - mu), pi=state.pi + (pi_new - pi))
        masses = [_mass_matrix(system, place) for system in (old, new)] if weighed else []
        return moved, jnp.zeros(()) if residual is None else residual, masses

    given = beginning.constants.unpack(before), beginning.constants.unpack(after), beginning.state.unpack(states)
    found, residuals, masses = evaluate(jax.vmap(carry), *given)
    if not np.all(residuals <= inverse_legendre.SOLVED):
        raise StepError('The velocities of the node could not be found from its momenta: pass keep="momentum".')
    rows = packing.rows(found, len(states))
    if not np.all(np.isfinite(rows)):
        raise ArgumentError("With these parameters the momenta are not finite: look for a mass or an inertia of zero.")
    if masses and np.any(_negative(masses[0]) != _negative(masses[1])):
        raise ArgumentError(
            "With these parameters an eigenvalue of ∂²ℓ/∂(ξ, ν)² has another sign than before: look for a mass or an "
            "inertia that is negative, or too small beside the others."
        )
    return rows


def _mass_matrix(system: System, place: tuple[PyTree, ...]) -> Array:
    """∂²ℓ/∂(ξ, ν)², a square matrix."""
    xi, n, nu, *rest = place

    def momenta(velocities: PyTree) -> PyTree:
        return jnp.concatenate(legendre(system, velocities[: xi.size], n, velocities[xi.size :], *rest))

    return jax.jacfwd(momenta)(jnp.concatenate([xi, nu]))


def _negative(matrices: object) -> np.ndarray:
    """How many eigenvalues are negative beyond round-off, of each of some matrices."""
    found = np.linalg.eigvalsh(np.asarray(matrices))
    scale = np.max(np.abs(found), axis=-1, keepdims=True, initial=0.0)
    return np.sum(found < -ROUND_OFF * scale, axis=-1)
