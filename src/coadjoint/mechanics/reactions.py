"""The reactions of a system's constraints: what the multipliers λ do, and which λ the constraints demand."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.constraints import Bound, Site, place_rates, place_reactions
from coadjoint.mechanics.coupling import rows_of_links
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import State
from coadjoint.mechanics.traced_once import traced_once

Rows = tuple[int, ...] | None
"""Where rows follow from others, the places of those that are kept; None where none does."""

Independent = Rows | Array
"""The same, or, of a trace, 1 at each row that is kept and 0 at others, (m,)."""

TRIPS = 6
"""Newton's iterations for the multipliers of a node where the velocities are not affine in the momenta."""


def site(state: State) -> Site:
    """Where the constraints of a state are evaluated."""
    return Site(state.n, state.a, jnp.asarray(state.t, dtype=float), state.inputs)


def count(system: ReducedFunctions) -> int:
    """The number of rows of all constraints, and of multipliers."""
    return sum(one.size for one in system.constraints)


def parts(system: ReducedFunctions) -> Iterator[tuple[Bound, slice]]:
    """The constraints with their places among the rows of all."""
    first = 0
    for one in system.constraints:
        yield one, slice(first, first + one.size)
        first += one.size


@traced_once
def rate(system: ReducedFunctions, at: Site, xi: Array, nu: Array) -> Array:
    """φ̇ and A·(ξ, ν) − b of all constraints, (m,). xi: (dim G,). nu: (ambient,)."""
    places = [one for one in system.constraints if one.holonomic]
    found = iter(place_rates(system, places, at, xi, nu) if places else ())
    return jnp.concatenate(
        [next(found) if one.holonomic else one.rate(system, at, xi, nu) for one in system.constraints]
    )


@traced_once
def reaction(system: ReducedFunctions, at: Site, strength: Array) -> tuple[Array, Array]:
    """The torque (dim G,) and the force (ambient,) of multipliers λ (m,): Aᵀλ."""
    places = [(one, strength[part]) for one, part in parts(system) if one.holonomic]
    found = [one.reaction(system, at, strength[part]) for one, part in parts(system) if not one.holonomic]
    if places:  # together: ⋄ and the views of n and a cost more than the derivatives of one joint
        bounds, strengths = zip(*places, strict=True)
        found.append(place_reactions(system, bounds, at, list(strengths)))
    torques, forces = zip(*found, strict=True)
    return reduce(add, torques), reduce(add, forces)


def source(system: ReducedFunctions, at: Site, strength: Array) -> Array:
    """By which the reaction changes m = μ − π⋄n, (dim G,): its torque less f⋄n."""
    torque, force = reaction(system, at, strength)
    return torque - system.additional.diamond(system.group, force, at.n)


def powers(system: ReducedFunctions, at: Site, strength: Array) -> Array:
    """The power of every reaction that has a line in the energy budget, (lines,)."""
    lines = [one.power(system, at, strength[part]) for one, part in parts(system) if one.moving]
    return jnp.stack(lines) if lines else jnp.zeros(0)


def kicked(system: ReducedFunctions, state: State, impulse: Array) -> State:
    """The state after the impulse Aᵀλ of multipliers λ (m,) of momentum."""
    torque, force = reaction(system, site(state), impulse)
    return state.replace(mu=state.mu + torque, pi=state.pi + force)


class NodeRates(NamedTuple):
    """The velocities of a node and the rates of its constraints.

    rate: `rate` at (ξ, ν), (m,). mobility: A M⁻¹Aᵀ, (m, m), by which an impulse of the multipliers changes it.
    velocities: those that belong to (μ, π).
    """

    rate: Array
    mobility: Array
    velocities: inverse_legendre.Velocities


def node_rate(system: ReducedFunctions, state: State) -> Array:
    """`rate` at the velocities that belong to (μ, π), (m,)."""
    found = inverse_legendre.velocities(system, state)
    return rate(system, site(state), found.xi, found.nu)


def node_rates(system: ReducedFunctions, state: State, impulse: Array | None = None) -> NodeRates:
    """The rates of a node after the multipliers `impulse` (m,), by default none, and how they change with it."""
    return _node_rates(system, state.at_place, impulse)


@traced_once
def _node_rates(system: ReducedFunctions, state: State, impulse: Array | None) -> NodeRates:
    def left(impulse: Array) -> tuple[Array, Any]:
        after = kicked(system, state, impulse)
        found = inverse_legendre.velocities(system, after)
        now = rate(system, site(after), found.xi, found.nu)
        return now, (now, found)

    at = jnp.zeros(count(system)) if impulse is None else impulse
    matrix, (now, found) = jax.jacfwd(left, has_aux=True)(at)
    return NodeRates(now, matrix, found)


def closing(system: ReducedFunctions, state: State, independent: Independent) -> Array:
    """The impulse λ (m,) after which the velocities of the node satisfy all constraints.

    One linear solve where these are affine in the momenta, of many links by blocks; else Newton's iteration from the
    velocities of the state. independent: the rows that are kept where some are redundant; λ of the others is zero.
    """
    how = rows_of(system)
    if inverse_legendre.velocities(system, state).residual is not None:
        return _closing_together(system, state, independent)

    def left(impulse: Array) -> Array:
        return node_rate(system, kicked(system, state, impulse))

    def improved(impulse: Array | None) -> Array:
        at = jnp.zeros(count(system)) if impulse is None else impulse
        if how is not None:
            return at - how.jacobian_solve(left, at, left(at))
        found = node_rates(system, state, impulse)
        return at - solved(found.mobility, found.rate, independent)

    impulse = improved(None)
    for _ in range(TRIPS - 1 if _curved(system, state) else 0):
        impulse = improved(impulse)
    return impulse


def _closing_together(system: ReducedFunctions, state: State, independent: Independent) -> Array:
    """`closing` by Newton's iteration for (ξ, y, λ): ∂ℓ = (μ, π) + Aᵀλ and A·(ξ, ν) = b."""
    (group, Q, _), dim, size = system.places, system.group.dim, count(system)
    at = site(state)

    def left(z: Array) -> Array:
        xi, nu, impulse = z[:dim], Q.tangent(group, state.n, z[dim:-size]), z[-size:]
        mu, pi = legendre(system, xi, state.n, nu, state.a, state.t, state.inputs, state.internal)
        torque, force = reaction(system, at, impulse)
        held = chosen(rate(system, at, xi, nu), impulse, independent)
        rest = Q.coordinates(group, state.n, pi - state.pi - force)
        return jnp.concatenate([mu - state.mu - torque, rest, held])

    z = jnp.concatenate([state.xi, Q.coordinates(group, state.n, state.nu), jnp.zeros(size)])
    return jax.lax.fori_loop(0, TRIPS, lambda _, z: z - jnp.linalg.solve(jax.jacfwd(left)(z), left(z)), z)[-size:]


def rows_of(system: ReducedFunctions) -> Coupled | None:
    """The structure of the rows of the constraints of many links; None where they are solved as a dense matrix."""
    return rows_of_links(system.group, tuple(one.size for one in system.constraints))


def _curved(system: ReducedFunctions, state: State) -> bool:
    """Whether ℋ is given and its velocities are not affine in the momenta."""
    if system.hamiltonian is None:
        return False
    return any(depends(lambda impulse: node_rates(system, state, impulse).mobility, jnp.zeros(count(system))))


def chosen(held: Array, strength: Array, independent: Independent) -> Array:
    """The equations (m,) of independent rows, and λ = 0 of the others."""
    if independent is None:
        return held
    kept = np.isin(np.arange(len(held)), independent) if isinstance(independent, tuple) else independent > 0.5
    return jnp.where(kept, held, strength)


def solved(matrix: Array, right: Array, independent: Independent) -> Array:
    """x (m,) with matrix x = right; where rows are redundant that of the independent ones, and zeros."""
    if independent is None:
        return jnp.linalg.solve(matrix, right)
    if not isinstance(independent, tuple):
        kept = independent > 0.5
        both = kept[:, None] & kept
        return jnp.linalg.solve(jnp.where(both, matrix, jnp.eye(len(right))), jnp.where(kept, right, 0.0))
    rows = np.array(independent)
    return jnp.zeros_like(right).at[rows].set(jnp.linalg.solve(matrix[rows][:, rows], right[rows]))
