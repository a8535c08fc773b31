"""Discrete Lagrangians in group form on which the discrete theorems are tested: random ones, and Moser–Veselov's."""

from __future__ import annotations

from functools import lru_cache

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from systems import random_system


def velocity(group, F, h):
    """(F − F⁻¹)ᵛ/2h, an algebra-valued function of an increment that needs no chart."""
    return group.vee(group.matrix(F) - group.matrix(group.inverse(F))) / (2 * h)


@lru_cache(maxsize=64)
def random_group_system(world: str, forced: bool = False) -> tuple[co.System, co.State]:
    """Λ(F, n, s, a; h) = h ℓ((F − F⁻¹)ᵛ/2h, n, (s − n)/h, a) with the random ℓ of a world, and its start."""
    system, start = random_system(world, forced)
    group, Q, V = system.places

    def group_lagrangian(F, *rest, t):
        n, s = rest[:2] if Q.ambient(group) else (np.zeros(0), np.zeros(0))
        a = rest[-3] if V.ambient(group) else np.zeros(0)
        h = rest[-1]
        n, s, a = flat_parts(n), flat_parts(s), flat_parts(a)
        return h * system.reduced_lagrangian(velocity(group, F, h), n, (s - n) / h, a, t)

    made = co.System(
        group,
        group_lagrangian=group_lagrangian,
        additional=Q,
        advected=V,
        forces=system.forces,
        parameters=system.parameters,
        name=world,
    )
    return made, start


def flat_parts(value):
    """A point as one array, whether it came as an array or by names."""
    from systems import flat

    return flat(value)


def moser_veselov(J) -> co.System:
    """Λ = tr((I − F)D)/h with D = ½tr(J)I − J: the discrete free rigid body of Moser and Veselov."""
    J = np.asarray(J, dtype=float)

    def group_lagrangian(F, p, h):
        return jnp.trace((jnp.eye(3) - F) @ p.D) / h

    D = 0.5 * np.trace(J) * np.eye(3) - J
    return co.System(co.SO3(), group_lagrangian=group_lagrangian, parameters={"D": D}, name="Moser–Veselov")
