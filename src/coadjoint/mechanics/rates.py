"""The rates of change of (μ, n, π, a) along the continuous motion (P20–P22)."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from coadjoint.mechanics.discrete import Point, node
from coadjoint.mechanics.poisson import Phase
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


def rates(system: System, state: State) -> tuple[Phase, Phase]:
    """(μ, n, π, a) and its rate of change, at (ξ, ν) of the state on a flat Q, with μ = ∂_ξℓ, π = ∂_νℓ (P20–P22)."""
    group, Q, V = system.places
    xi, n, nu, a = state.xi, state.n, state.nu, state.a
    at = node(system, state.holding(state.internal), Point(xi, n, nu, a, state.t))
    carried = jax.vjp(lambda w: Q.lifted(group, xi, n, w), jnp.zeros_like(n))[1](at.pi)[0]
    moving = Phase(
        mu=group.ad_dual(xi, at.mu) + at.torque,
        n=nu - Q.infinitesimal(group, xi, n),
        pi=at.force + carried,
        a=-V.infinitesimal(group, xi, a),
    )
    return Phase(at.mu, n, at.pi, a), moving
