"""The size of momenta before they cancel, and the round-off of that size in a residual."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import State


class Sizes(NamedTuple):
    """|∂_ξℓ|∞ and |∂_νℓ|∞, one number each."""

    mu: Array
    pi: Array


def alone(system: ReducedFunctions, state: State, xi: Array, nu: Array) -> tuple[Sizes, Sizes]:
    """The sizes of (μ, π), one number each, that ξ alone, at (ξ, 0), and ν alone, at (0, ν), would give at this place.

    μ = ∂_ξℓ may be small where the contributions of ξ and ν cancel. 0 where ℓ is not differentiable there. With ℋ the
    momenta are solved from μ alone and from π alone, by as many iterations as native code unrolls; 0 where these do not
    converge, so that a residual is relative to μ and π themselves.
    """
    at_rest, still = jnp.zeros_like(xi), jnp.zeros_like(nu)
    by_xi = _momenta(system, state, (xi, still), (state.mu, jnp.zeros_like(state.pi)))
    return by_xi, _momenta(system, state, (at_rest, nu), (jnp.zeros_like(state.mu), state.pi))


def _momenta(
    system: ReducedFunctions, state: State, velocities: tuple[Array, Array], near: tuple[Array, Array]
) -> Sizes:
    xi, nu = velocities
    found = legendre(system, xi, state.n, nu, state.a, state.t, state.inputs, state.internal, near)
    sizes = [largest(part) for part in found]
    return Sizes(*(jnp.where(jnp.isfinite(size), size, 0.0) for size in sizes))


def above(error: Array, size: Array, terms: Array, least: Array | float = 0.0) -> Array:
    """error/size, of any shape; at most 16 ε for round-off of the terms or of the least momentum."""
    roundoff = 16 * np.finfo(float).eps
    beyond = jnp.maximum(error - roundoff * terms - least, 0.0)
    scale = jnp.where(size > 0, size, terms)
    return jnp.where(beyond > 0, relative(beyond, scale), jnp.minimum(relative(error, scale), roundoff))


def largest(*arrays: Array) -> Array:
    """The largest entry in size of arrays of any shape, one number; 0 of nothing."""
    return jnp.max(jnp.abs(jnp.concatenate([jnp.ravel(array) for array in arrays])), initial=0.0)


def relative(error: Array, scale: Array) -> Array:
    """error/scale, of any shape, and the error itself at scale 0."""
    return jnp.where(scale > 0, error / jnp.where(scale > 0, scale, 1.0), error)
