"""The inverse Legendre transform: the velocities at a node of its momenta, and how well they were found."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics import phase_space
from coadjoint.mechanics.coupling import jacobian_solve, large
from coadjoint.mechanics.legendre import Place
from coadjoint.mechanics.legendre import velocities as slopes
from coadjoint.mechanics.momentum_sizes import Sizes, above, alone, largest, relative
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import Places, State
from coadjoint.mechanics.traced_once import traced_once

TRIPS = 192
"""Newton's iterations where ℓ is not quadratic in the velocities, divided by the square of their number, 2 to 12:
native code unrolls them. Each is damped where it does not help."""

FRACTIONS = (1.0, 0.25, 1 / 16, 1 / 64)
"""The parts of an increment that are tried: Newton's own overshoots by far where the inertia all but vanishes."""

NEAR, PLAIN_TRIPS = 1e-3, 2
"""Plain iterations from a residual that is near: convergence is quadratic, and the result has the derivatives of the
solution."""

SOLVED = 1e-9
"""Up to which relative residual of ∂ℓ = (μ, π) the velocities count as found."""


class Velocities(NamedTuple):
    """ξ, ν, and the residual of ∂_ξℓ = μ, ∂_νℓ = π; None where it is round-off.

    It is relative to |μ|∞ and |π|∞, or, where the contributions of ξ and ν cancel, to the size of either alone.

    xi: (dim G,). nu: (ambient,). residual: one number.
    """

    xi: Array
    nu: Array
    residual: Array | None


def velocities(system: ReducedFunctions, state: State) -> Velocities:
    """(ξ, ν) with ∂_ξℓ = μ, ∂_νℓ = π on T_nQ.

    Of a Hamiltonian they are (∂_μℋ, ∂_πℋ) (P6, P7). Where ℓ is quadratic in the velocities one linear solve gives
    them. Elsewhere Newton's iteration starts from the state's own (ξ, ν); of each increment that part is taken which
    leaves the smallest residual. Two plain iterations end it. They alone are differentiated: from the solution the
    first gives its first derivatives, and both together its first three.
    """
    return _velocities(system, state.at_place)


@traced_once
def _velocities(system: ReducedFunctions, state: State) -> Velocities:
    if system.hamiltonian is not None:
        return _by_hamiltonian(system, state)
    problem = _Problem(system, state)
    z = jnp.concatenate([state.xi, system.additional.coordinates(system.group, state.n, state.nu)])
    if _is_affine(system, problem.mismatch, z):
        if phase_space.linear(system, state):
            return Velocities(*phase_space.velocities(system, state))
        return Velocities(*problem.unpack(_newton(system.places, problem.mismatch, z)), None)
    values = _Problem(*jax.lax.stop_gradient((system, state)))
    begun = values.sizes(z := jax.lax.stop_gradient(z))
    trips = min(max(TRIPS // len(z) ** 2, 2), 12) if TRIPS else 0
    improve = partial(_improved, values)
    z = jax.lax.fori_loop(
        0, trips, lambda _, z: jax.lax.cond(values.residual(z, begun) > NEAR, improve, lambda z: z, z), z
    )
    left = values.residual(z, begun)
    z = jax.lax.fori_loop(
        0, PLAIN_TRIPS, lambda _, z: jnp.where(left <= NEAR, _newton(system.places, problem.mismatch, z), z), z
    )
    return Velocities(*problem.unpack(z), values.residual(jax.lax.stop_gradient(z), begun))


class _Problem(NamedTuple):
    """∂ℓ = (μ, π) at the place of a state, for z = (ξ, coordinates of ν), (dim G + dim Q,)."""

    system: ReducedFunctions
    state: State

    def unpack(self, z: Array) -> tuple[Array, Array]:
        group, Q, _ = self.system.places
        return z[: group.dim], Q.tangent(group, self.state.n, z[group.dim :])

    def mismatch(self, z: Array) -> Array:
        (group, Q, _), state, (xi, nu) = self.system.places, self.state, self.unpack(z)
        mu, pi = legendre(self.system, xi, state.n, nu, state.a, state.t, state.inputs, state.internal)
        return jnp.concatenate([mu - state.mu, Q.coordinates(group, state.n, pi - state.pi)])

    def sizes(self, z: Array) -> Sizes:
        """The size of μ and of π, or, where the contributions of ξ and ν cancel, the size of either alone."""
        by_xi, by_nu = alone(self.system, self.state, *self.unpack(z))
        mu, pi = jnp.maximum(by_xi.mu, by_nu.mu), jnp.maximum(by_xi.pi, by_nu.pi)
        return Sizes(jnp.maximum(largest(self.state.mu), mu), jnp.maximum(largest(self.state.pi), pi))

    def errors(self, z: Array) -> Sizes:
        rows, dim = self.mismatch(z), self.system.group.dim
        return Sizes(largest(rows[:dim]), largest(rows[dim:]))

    def residual(self, z: Array, begun: Sizes) -> Array:
        """The relative residual, at least the round-off of the first iterate, also at zero."""
        parts = zip(self.errors(z), self.sizes(z), begun, strict=True)
        return jnp.maximum(*(above(error, size, size + first) for error, size, first in parts))


def _newton(places: Places, mismatch: Callable[[Array], Array], z: Array) -> Array:
    return z - jacobian_solve(places, mismatch, z, mismatch(z))


def _improved(problem: _Problem, z: Array) -> Array:
    """The best of z − fδ over the fractions f of Newton's increment δ, or z where none is better.

    Errors are relative to the sizes at z: relative to their own, a distant point would look near.
    """
    scale = problem.sizes(z)

    def error(z: Array) -> Array:
        return jnp.maximum(*(relative(part, size) for part, size in zip(problem.errors(z), scale, strict=True)))

    increment = jacobian_solve(problem.system.places, problem.mismatch, z, problem.mismatch(z))
    best, least = z, error(z)
    for fraction in FRACTIONS:
        there = z - fraction * increment
        now = error(there)
        best, least = jnp.where(now < least, there, best), jnp.where(now < least, now, least)
    return best


def _is_affine(system: ReducedFunctions, function: Callable[[Array], Array], z: Array) -> bool:
    """`_affine`; of many links from the derivative along one direction, because that along all takes N² numbers."""
    if not large(system.group):
        return _affine(function, z)
    along = np.random.default_rng(1797).normal(size=np.shape(z))
    return not any(depends(lambda z: jax.jvp(function, (z,), (jnp.asarray(along),))[1], np.zeros(np.shape(z))))


def _affine(function: Callable[[Array], Array], z: Array) -> bool:
    """Whether the derivative of the function, as traced, is independent of z."""
    return not any(depends(jax.jacfwd(function), np.zeros(np.shape(z))))


def _by_hamiltonian(system: ReducedFunctions, state: State) -> Velocities:
    z = jnp.concatenate([state.xi, state.nu])
    place = Place(system, z, state.n, state.a, state.t, state.inputs, state.internal)
    found = slopes(jnp.concatenate([state.mu, state.pi]), place)
    return Velocities(found[: system.group.dim], found[system.group.dim :], None)
