"""The multipliers of constraints at a node: the reactions that keep the velocities on them."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.rates import rates
from coadjoint.mechanics.reactions import (
    Independent,
    count,
    node_rate,
    node_rates,
    parts,
    reaction,
    rows_of,
    site,
    solved,
)
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


def multipliers(system: System, state: State, independent: Independent) -> Array:
    """λ (m,) of φ̈ = 0, or d/dt A·(ξ, ν) = ḃ, at a node with its own velocities; of redundant rows the least λ."""
    change, nothing, how = acceleration(system, state), jnp.zeros(count(system)), rows_of(system)
    if how is not None:
        return how.jacobian_solve(change, nothing, -change(nothing))
    matrix, right = jax.jacfwd(change)(nothing), -change(nothing)
    return _spread(matrix, solved(matrix, right, independent), independent)


def reactions_at(system: System, state: State) -> dict[str, Array]:
    """The multipliers λ of every constraint at a node, name → (m,), those of φ̈ = 0 or d/dt A·(ξ, ν) = ḃ.

        lift_off = lambda state: co.mechanics.reactions_at(system, state)["floor"][0]
        run = co.simulate(system, start, dt=0.01, duration=10.0, until=lift_off)

    The same numbers as `reaction_NAME` of a dataset, as a pure function for events, quantities and outputs.
    system: with constraints and the parameters of this motion. state: one state, with the velocities of its momenta, as
    functions of states get it. Units are those of ℓ over those of φ; of A·(ξ, ν), those of the momenta over A and s.
    Raises ArgumentError for a system without constraints.
    """
    if not system.constraints:
        raise ArgumentError("This system has no constraints that could have reactions.")
    strength = multipliers(system, state, getattr(state.memory, "rows", None))
    return {one.name: strength[part] for one, part in parts(system)}


def least(system: System, state: State, strength: Array, independent: Independent) -> Array:
    """The least multipliers (m,) with the reaction of these, of which those of redundant rows are zero."""
    return strength if independent is None else _spread(node_rates(system, state).mobility, strength, independent)


def _spread(matrix: Array, strength: Array, independent: Independent) -> Array:
    """The least λ (m,) with the reaction of `strength`, whose entries at redundant rows are zero.

    With A_R = C A_S of redundant rows R and independent rows S it is λ_R = (1 + CCᵀ)⁻¹Cλ_S, λ_S − Cᵀλ_R. matrix:
    A M⁻¹Aᵀ (m, m).
    """
    if independent is None:
        return strength
    if not isinstance(independent, tuple):
        held = independent > 0.5
        both = held[:, None] & held
        C = jnp.linalg.solve(jnp.where(both, matrix, jnp.eye(len(strength))).T, matrix.T).T
        C = jnp.where(~held[:, None] & held, C, 0.0)
        of_left = jnp.linalg.solve(jnp.eye(len(strength)) + C @ C.T, C @ strength)
        return jnp.where(held, strength - C.T @ of_left, of_left)
    kept = np.array(independent)
    left = np.setdiff1d(np.arange(len(strength)), kept)
    C = jnp.linalg.solve(matrix[kept][:, kept].T, matrix[left][:, kept].T).T
    of_left = jnp.linalg.solve(jnp.eye(len(left)) + C @ C.T, C @ strength[kept])
    return jnp.zeros_like(strength).at[kept].set(strength[kept] - C.T @ of_left).at[left].set(of_left)


def acceleration(system: System, state: State) -> Callable[[Array], Array]:
    """λ ↦ d/dt of `rate` along the motion that forces and reactions λ (m,) give, at (ξ, ν) of the state."""
    at = site(state)
    phase, moving = rates(system, state)

    def of_phase(mu: Array, n: Array, pi: Array, a: Array, t: Scalar) -> Array:
        place = state.replace(mu=mu, n=n, pi=system.additional.project(system.group, n, pi), a=a, t=t)
        return node_rate(system, place)

    def change(strength: Array) -> Array:
        torque, force = reaction(system, at, strength)
        along = moving.mu + torque, moving.n, moving.pi + force, moving.a, jnp.ones_like(at.t)
        return jax.jvp(of_phase, (phase.mu, phase.n, phase.pi, phase.a, at.t), along)[1]

    return change
