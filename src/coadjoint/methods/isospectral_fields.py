"""The unknowns of isospectral steps: the momentum and the advected parameters that move as it does, side by side."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, shown
from coadjoint.mechanics.system import System
from coadjoint.methods.isospectral_algebra import algebra_of
from coadjoint.spaces import Adjoint, ByInverse, Coadjoint, Links, Several


def fields(system: System) -> int:
    """The number of advected parameters Θ; raises ArgumentError if one does not move as the momentum does."""
    V = system.advected
    spaces = V.factors if type(V) is Several else (V,) if V.ambient(system.group) else ()
    for space in spaces:
        plain = space
        while isinstance(plain, (ByInverse, Links)):
            plain = plain.space
        if not isinstance(plain, (Adjoint, Coadjoint)):
            raise ArgumentError(
                "co.IsospectralMidpoint takes advected parameters that move as the momentum does, "
                f"advected=co.Coadjoint(), but got {shown(space)}: use co.HamiltonianMidpoint()."
            )
    return len(spaces)


def rows_of(system: System) -> tuple[int, int]:
    """The number of fields in the unknowns, μ and every Θ, and the number of copies."""
    return 1 + fields(system), algebra_of(system.group).copies


def parts(system: System, a: Array) -> list[Array]:
    """The advected parameters one by one, (dim G,) each, of a (ambient V*,)."""
    dim = system.group.dim
    return [a[i * dim : (i + 1) * dim] for i in range(fields(system))]


def lifted(system: System, mu: Array, a: Array) -> Array:
    """The unknowns, (unknowns,), that μ (dim G,) and a (ambient V*,) are themselves."""
    algebra = algebra_of(system.group)
    return jnp.concatenate([algebra.lifted(part) for part in (mu, *parts(system, a))])


def momenta_of(system: System, z: Array) -> tuple[Array, Array]:
    """μ (dim G,) and a (ambient V*,) of the unknowns (unknowns,)."""
    algebra = algebra_of(system.group)
    mu, *thetas = (algebra.momentum(row) for row in z.reshape(-1, algebra.unknowns))
    return mu, jnp.concatenate(thetas) if thetas else jnp.zeros(0)


class Moves(NamedTuple):
    """The increments of the unknowns, (unknowns,) each: the total, and the part that is odd in ε."""

    whole: Array
    odd: Array


def moves(
    system: System, xi: Array, along_a: Array, z: Array, epsilon: Array | float, precision: Any = np.float64
) -> Moves:
    """`moved` and `brackets`, from one conversion to a precision.

    precision: the type of the multiplied numbers.
    """
    algebra = algebra_of(system.group)
    eta, along_a, z = (numbers.astype(precision) for numbers in (-xi, along_a, z))
    w, *thetas = z.reshape(-1, algebra.unknowns)
    (odd, even), others = algebra.products_of(eta, w), []
    for along, theta in zip(parts(system, along_a), thetas, strict=True):
        matrices = algebra.matrix(-along), algebra.unknown(theta), algebra.matrix(eta)
        forced = algebra.products_of_force(*jax.tree.map(lambda entries: entries.astype(precision), matrices))
        odd, even = odd + forced[0], even + forced[1]
        others.append(algebra.products_of(eta, theta))
    odd = epsilon * jnp.concatenate([odd, *(part for part, _ in others)])
    return Moves(odd + epsilon**2 * jnp.concatenate([even, *(part for _, part in others)]), odd)


def moved(system: System, xi: Array, along_a: Array, z: Array, epsilon: Array | float) -> Array:
    """The increment of the unknowns z, (unknowns,) both, by ξ (dim G,) and ∂ℋ/∂a (ambient V*,).

    ε[P, W] + ε² PWP + Σ (ε[B, Θ] + ε²(BΘP + PΘB)) and ε[P, Θ] + ε² PΘP of every Θ. epsilon: half a step, one number.
    """
    return moves(system, xi, along_a, z, epsilon).whole


def brackets(
    system: System, xi: Array, along_a: Array, z: Array, epsilon: Array | float, precision: Any = np.float64
) -> Array:
    """The part of `moved` that is odd in ε, (unknowns,): ε[P, W] + Σ ε[B, Θ], and ε[P, Θ] of every Θ."""
    return moves(system, xi, along_a, z, epsilon, precision).odd
