"""The multipliers of constraints at a node: the reactions that keep the velocities on them."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array
from coadjoint.mechanics.rates import rates
from coadjoint.mechanics.reactions import count, node_rate, reaction, rows_of, site, solved
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


def multipliers(system: System, state: State, projector: Array | None) -> Array:
    """λ (m,) of φ̈ = 0, or d/dt A·(ξ, ν) = ḃ, at a node with its own velocities; of redundant rows the least λ."""
    change, nothing, how = acceleration(system, state), jnp.zeros(count(system)), rows_of(system)
    if how is not None:
        return how.jacobian_solve(change, nothing, -change(nothing))
    matrix, right = jax.jacfwd(change)(nothing), -change(nothing)
    if projector is None:
        return solved(matrix, right, None)
    return matrix @ solved(matrix @ matrix, right, projector)


def acceleration(system: System, state: State) -> Callable[[Array], Array]:
    """λ ↦ d/dt of `rate` along the motion that forces and reactions λ (m,) give, at (ξ, ν) of the state."""
    at = site(state)
    phase, moving = rates(system, state)

    def of_phase(mu, n, pi, a, t):
        place = state.replace(mu=mu, n=n, pi=system.additional.project(system.group, n, pi), a=a, t=t)
        return node_rate(system, place)

    def change(strength: Array) -> Array:
        torque, force = reaction(system, at, strength)
        along = moving.mu + torque, moving.n, moving.pi + force, moving.a, jnp.ones_like(at.t)
        return jax.jvp(of_phase, (phase.mu, phase.n, phase.pi, phase.a, at.t), along)[1]

    return change
