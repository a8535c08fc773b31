"""Toda's lattice: particles on a line with exponential repulsion, as a Lax equation on triangular matrices."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.checks import array
from coadjoint.groups import MatrixGroup
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

__all__ = ["lattice", "lax_matrix", "start"]

LARGEST = 12
"""Particles; their group has n(n + 1)/2 dimensions."""


def lattice(*, particles: Any) -> System:
    """The open lattice of n particles, H = ½ Σ p_i² + Σ e^{q_i − q_{i+1}}, unit masses, free ends.

    In Flaschka's variables, L symmetric and tridiagonal with L_ii = −p_i/2, L_{i,i+1} = ½ e^{(q_i − q_{i+1})/2}, it is
    dL/dt = [B, L] with B skew, of the entries of L next to the diagonal, and that is the Lie–Poisson equation on the
    group of lower triangular matrices: ⟨μ, ξ⟩ = 4 tr(L ξ̂) and ℋ = 2 tr L² = H. The trace of L is a Casimir function,
    kept to round-off, and each eigenvalue stays in a band; as t → ∞ L becomes diagonal with the eigenvalues in order.

    particles: n, an integer from 2 to 12. Raises ArgumentError for other values.
    Source: Flaschka, The Toda lattice II, Prog. Theor. Phys. 51 (1974); Moser (1975).
    """
    number = isinstance(particles, (int, float, np.integer)) and not isinstance(particles, bool)
    fits = number and 2 <= particles <= LARGEST and (particles == int(particles))
    checks.expect(fits, particles, "particles", f"a whole number from 2 to {LARGEST}")
    n = int(particles)
    watched = {f"trace_{power}": partial(trace, power=power) for power in range(3, n + 1)}
    units = dict.fromkeys(("g", "xi", "xi_spatial", "mu", "energy", "discrete_energy", *watched), "1")
    return System(_triangular(n), hamiltonian=energy, quantities=watched, units=units, name=f"Toda lattice of {n}")


def energy(mu):
    """ℋ = 2 tr L² = ½ Σ p_i² + Σ e^{q_i − q_{i+1}}."""
    return 2 * jnp.sum(lax_matrix(mu) ** 2)


def lax_matrix(mu: Array) -> Array:
    """L(μ), (…, n, n), symmetric, of momenta (…, n(n + 1)/2): `lax_matrix(run.dataset.mu.values)`."""
    return 0.25 * mu[..., _index(round((np.sqrt(8 * mu.shape[-1] + 1) - 1) / 2))]


def trace(state, *, power: int):
    """tr Lᵏ, the sum of the k-th powers of the eigenvalues."""
    L = found = lax_matrix(state.mu)
    for _ in range(power - 1):
        found = found @ L
    return jnp.trace(found)


def start(toda: System, *, positions: Quantity, momenta: Quantity) -> State:
    """The state of particles at q_i with momenta p_i, (n,) each; raises ArgumentError for other shapes."""
    n = toda.group.matrix_size
    q, p = np.asarray(array(positions, "positions", (n,))), np.asarray(array(momenta, "momenta", (n,)))
    off = 0.5 * np.exp(0.5 * (q[:-1] - q[1:]))
    L = np.diag(-0.5 * p) + np.diag(off, 1) + np.diag(off, -1)
    return toda.state(mu=[4 * L[i, j] for i, j in _places(n)])


def _places(n: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(n) for j in range(i + 1)]


def _index(n: int) -> np.ndarray:
    """Where the entries of L are among the momenta."""
    places = {place: k for k, place in enumerate(_places(n))}
    return np.array([[places[max(i, j), min(i, j)] for j in range(n)] for i in range(n)])


@lru_cache(maxsize=16)
def _triangular(n: int) -> MatrixGroup:
    basis = np.zeros((n * (n + 1) // 2, n, n))
    for k, (i, j) in enumerate(_places(n)):
        basis[k, i, j] = 1.0
    return MatrixGroup(basis, name=f"lower triangular ({n})")
