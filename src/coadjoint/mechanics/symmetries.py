"""Motions of space that change neither ℓ nor the constraints, and the momenta that they conserve."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.constraints import Site, place_slopes
from coadjoint.mechanics.coupling import large
from coadjoint.mechanics.noether import echelon, spatial_momentum
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

SMALL = 1e-10
"""The singular value, relative to the largest, that counts as zero."""


def symmetries(system: System, state: State) -> np.ndarray:
    """Motions δg = ηg, δq = η·q + u of space that leave ℓ, or ℋ, and all φ unchanged: rows (η, u).

    Those with u = 0 are left out: c₀·a₀ = 0 makes them Kelvin–Noether quantities. A pin at c leaves the turn about the
    vertical through it, η = e_z, u = −e_z × c. Found at random places, (k, dim G + ambient); none with forces, rows on
    velocities, a curved space of additional dynamics or many links.
    """
    group, Q, _ = system.places
    dim, wide = group.dim, Q.ambient(group)
    nothing = np.zeros((0, dim + wide))
    if large(group) or system.forces or not wide or not Q.flat or not all(one.holonomic for one in system.constraints):
        return nothing
    random = np.random.default_rng(1918)
    count = dim + wide + 2
    places = random.normal(scale=0.7, size=(count, dim)), random.normal(size=(count, dim + 2 * wide + 1))
    slopes = tabulate(lambda s, eta, y: _slopes(system, s, eta, y), state, places[0][0], places[1][0])
    rows = np.concatenate([slopes(state, *place) for place in zip(*places, strict=True)])
    if not np.all(np.isfinite(rows)):
        return nothing
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    rows = rows / np.where(sizes > 0, sizes, 1.0)
    _, singular, basis = np.linalg.svd(rows, full_matrices=True)
    rank = int(np.sum(singular > SMALL * singular.max(initial=0.0)))
    found = echelon(np.roll(basis[rank:], wide, axis=1))  # u first: rows without it come last
    moving = np.abs(found[:, :wide]).max(axis=1, initial=0.0) > SMALL
    found = np.roll(found[moving], -wide, axis=1)
    largest = np.take_along_axis(found, np.argmax(np.abs(found), axis=1)[:, None], axis=1)
    return found / (largest if len(found) else 1.0)


def _slopes(system: System, state: State, eta: Array, y: Array) -> Array:
    """The derivatives of ℓ, or ℋ, and of all φ along every (η, u) at a place and velocity, (1 + m, dim G + ambient)."""
    group, Q, V = system.places
    dim, wide = group.dim, Q.ambient(group)
    g = group.exp(eta)
    back, a0 = group.inverse(g), V.act(group, state.g, state.a)
    xi, n, nu, t = y[:dim], y[dim : dim + wide], y[dim + wide : -1], state.t + y[-1]
    a = V.act(group, back, a0)

    own = system.reduced_lagrangian if system.hamiltonian is None else system.reduced_hamiltonian
    by_n, by_a = jax.grad(own, (1, 3))(xi, n, nu, a, t, state.inputs, state.internal)
    held = place_slopes(system, Site(n, a, t, state.inputs))
    along_n = jnp.concatenate([by_n[None], *(one.by_n for one in held)])
    along_a = jnp.concatenate([by_a[None], *(one.by_a for one in held)])

    def along(motion: Array) -> Array:
        turned = V.infinitesimal(group, motion[:dim], a0)
        moved = Q.push(group, back, Q.act(group, g, n), motion[dim:])
        return along_n @ moved - along_a @ V.push(group, back, a0, turned)

    return jax.vmap(along, out_axes=1)(jnp.eye(dim + wide))


def symmetry_momentum(system: System, state: State, motions: Array) -> Array:
    """⟨Ad*_{g⁻¹}m, η⟩ + ⟨π, g⁻¹u⟩ of each row (η, u) of `symmetries`, (k,)."""
    group, Q, _ = system.places
    carried = jax.vmap(lambda u: Q.push(group, group.inverse(state.g), Q.act(group, state.g, state.n), u))(
        motions[:, group.dim :]
    )
    return motions[:, : group.dim] @ spatial_momentum(system, state) + carried @ state.pi
