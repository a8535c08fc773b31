"""The discrete core in node form: what a quadrature rule needs from ℓ at one node (Theorem 6; mathematics: 5, 6)."""

from __future__ import annotations

from typing import NamedTuple

import jax

from coadjoint.groups.group import Array
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


class Point(NamedTuple):
    """Where ℓ is evaluated: (ξ, n, ν, a) at time t."""

    xi: Array
    n: Array
    nu: Array
    a: Array
    t: Array


class Node(NamedTuple):
    """What the discrete equations take from ℓ and the forces at a point.

    mu = ∂_ξℓ, pi = ∂_νℓ, torque = ∂_aℓ⋄a + ∂_nℓ⋄n + ∂_νℓ⋄ν + T (D/h), force = ∂_nℓ + f (κ/h),
    source = ∂_aℓ⋄a + T − f⋄n (Δ), energy = ⟨∂_ξℓ, ξ⟩ + ⟨∂_νℓ, ν⟩ − ℓ, lagrangian = ℓ.
    """

    mu: Array
    pi: Array
    torque: Array
    force: Array
    source: Array
    energy: Array
    lagrangian: Array


def node(system: System, state: State, point: Point) -> Node:
    """Evaluate ℓ, its gradients and the forces once at `point`; inputs and internal state are those of `state`."""
    group, Q, V = system.places
    xi, n, nu, a, t = point

    def lagrangian(xi, n, nu, a):
        return system.reduced_lagrangian(xi, n, nu, a, t, state.inputs)

    value, (mu, along_n, pi, along_a) = jax.value_and_grad(lagrangian, argnums=(0, 1, 2, 3))(xi, n, nu, a)
    torque, force = system.body_force(system.motion(xi, n, nu, a, t, state.inputs, state.internal))
    from_advected = V.diamond(group, along_a, a)
    return Node(
        mu=mu,
        pi=pi,
        torque=from_advected + Q.diamond(group, along_n, n) + Q.lifted_diamond(group, pi, n, nu) + torque,
        force=along_n + force,
        source=from_advected + torque - Q.diamond(group, force, n),
        energy=mu @ xi + pi @ nu - value,
        lagrangian=value,
    )
