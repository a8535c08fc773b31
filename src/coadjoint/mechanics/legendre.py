"""The reduced Lagrangian of a reduced Hamiltonian: the Legendre transform, solved for the momenta (P6–P9)."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.groups import LieGroup
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.spaces import Space

NEAR_TRIPS, FAR_TRIPS = 6, 100
"""Newton's iterations from momenta that are near, as those of the node where a step starts, and from zero."""

SOLVED = 1e-9
"""Up to which relative error ∂ℋ = (ξ, ν) counts as solved: the next iteration would meet round-off."""


class WithHamiltonian(Protocol):
    """A system with a reduced Hamiltonian."""

    @property
    def group(self) -> LieGroup: ...
    @property
    def additional(self) -> Space: ...
    def reduced_hamiltonian(
        self, mu: Array, n: Array, pi: Array, a: Array, t: Scalar, inputs: PyTree, internal: PyTree
    ) -> Array:
        """ℋ(μ, n, π, a), one number."""
        ...


class Place(NamedTuple):
    """Where the transform is taken: z = (ξ, ν), n, a, t, inputs, internal.

    z: (dim G + ambient,). n: (ambient,). a: (dim V*,). t: one number, s.
    """

    system: WithHamiltonian
    z: Array
    n: Array
    a: Array
    t: Scalar
    inputs: PyTree
    internal: PyTree


@jax.custom_jvp
def lagrangian(place: Place, near: Array | None) -> Array:
    """ℓ(ξ, n, ν, a) = ⟨μ, ξ⟩ + ⟨π, ν⟩ − ℋ(μ, π, n, a), one number, where ∂_μℋ = ξ, ∂_πℋ = ν (P8).

    near: (μ, π) to begin with, (dim G + ambient,), or None. Differentiated by the theorem of the envelope:
    dℓ = ⟨μ, dξ⟩ + ⟨π, dν⟩ − ∂_nℋ dn − ∂_aℋ da (P9).
    """
    p = momenta(place, near)
    return p @ place.z - hamiltonian(p, place)


@lagrangian.defjvp
def _lagrangian_slope(primals: tuple[Place, Array | None], tangents: tuple[Place, Array | None]) -> tuple[Array, Array]:
    (place, near), (along, _) = primals, tangents
    p = momenta(place, near)
    value, slope = jax.jvp(lambda place: p @ place.z - hamiltonian(p, place), (place,), (along,))
    return value, slope


@jax.custom_jvp
def momenta(place: Place, near: Array | None) -> Array:
    """p = (μ, π), (dim G + ambient,), with ∂_pℋ(p) = z, from `near` or from zero; NaN where no solution was found.

    One linear solve where ℋ is quadratic in p, else Newton's iteration. NaN, so that no computation continues with
    wrong momenta.
    """
    start = jnp.zeros_like(place.z) if near is None else near
    if quadratic(place):
        return improved(place, jnp.zeros_like(place.z))
    if near is None:
        p, *_ = jax.lax.while_loop(_unsolved, lambda c: _improve(place, c), _improve(place, (start, 0.0, 0)))
    else:
        p = jax.lax.fori_loop(0, NEAR_TRIPS, lambda _, p: improved(place, p), start)
    error = jnp.max(jnp.abs(velocities(p, place) - place.z), initial=0.0)
    return jnp.where(error <= SOLVED * (1 + jnp.max(jnp.abs(place.z), initial=0.0)), p, jnp.nan)


@momenta.defjvp
def _momenta_slope(primals: tuple[Place, Array | None], tangents: tuple[Place, Array | None]) -> tuple[Array, Array]:
    """ṗ = (∂²ℋ/∂p²)⁻¹(ż − ∂_pnℋ ṅ − …)."""
    (place, near), (along, _) = primals, tangents
    p = momenta(place, near)
    behind = jax.jvp(lambda place: place.z - velocities(p, place), (place,), (along,))[1]
    return p, jnp.linalg.solve(curvature(p, place), behind)


def hamiltonian(p: Array, place: Place) -> Array:
    """ℋ(μ, P_nπ, n, a) + ½|π − P_nπ|², one number, of p = (μ, π), (dim G + ambient,).

    On a curved Q this extends ℋ to all π, so that normal and tangential parts do not mix.
    """
    system, _, n, a, t, inputs, internal = place
    mu, pi = p[: system.group.dim], p[system.group.dim :]
    tangential = system.additional.project(system.group, n, pi)
    normal = 0.0 if system.additional.flat else 0.5 * (pi - tangential) @ (pi - tangential)
    return system.reduced_hamiltonian(mu, n, tangential, a, t, inputs, internal) + normal


def velocities(p: Array, place: Place) -> Array:
    """(ξ, ν) = (∂_μℋ, ∂_πℋ) at p = (μ, π), both of shape (dim G + ambient,)."""
    return jax.grad(hamiltonian)(p, place)


def curvature(p: Array, place: Place) -> Array:
    """∂²ℋ/∂(μ, π)² at p = (μ, π): a matrix of as many rows and columns as p has numbers."""
    return jax.jacfwd(velocities)(p, place)


def quadratic(place: Place) -> bool:
    """Whether ∂²ℋ/∂p², as traced, is independent of p."""
    return not any(depends(lambda p: curvature(p, place), np.zeros(np.shape(place.z))))


def improved(place: Place, p: Array) -> Array:
    """One of Newton's iterations for ∂_pℋ(p) = z from p, shape (dim G + ambient,) as the result."""
    return p + jnp.linalg.solve(curvature(p, place), place.z - velocities(p, place))


def _improve(place: Place, carry: PyTree) -> tuple[Array, Array, Array]:
    """One more iteration: p, the size of its change, and the count."""
    p, _, trips = carry
    better = improved(place, p)
    return better, jnp.max(jnp.abs(better - p)) / (1e-300 + jnp.max(jnp.abs(better))), trips + 1


def _unsolved(carry: PyTree) -> Array:
    _, change, trips = carry
    return (change > 1e-12) & (trips < FAR_TRIPS)
