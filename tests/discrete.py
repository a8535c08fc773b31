"""Discrete Lagrangians in group form on which the discrete theorems are tested: random ones, and Moser–Veselov's."""

from __future__ import annotations

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint import theory
from systems import element, flat, generator, point, random_system


def velocity(group, F, h):
    """(F − F⁻¹)ᵛ/2h, an algebra-valued function of an increment that needs no chart."""
    return group.vee(group.matrix(F) - group.matrix(group.inverse(F))) / (2 * h)


@lru_cache(maxsize=64)
def random_group_system(world: str, forced: bool = False) -> tuple[co.System, co.State]:
    """Λ(F, n, s, a; h) = h ℓ((F − F⁻¹)ᵛ/2h, n, (s − n)/h, a) with the random ℓ of a world, and its start."""
    system, start = random_system(world, forced)
    group, Q, V = system.places

    def discrete(t, F, *rest):
        n, s = rest[:2] if Q.ambient(group) else (np.zeros(0), np.zeros(0))
        a = rest[-3] if V.ambient(group) else np.zeros(0)
        h = rest[-1]
        n, s, a = flat(n), flat(s), flat(a)
        return h * system.reduced_lagrangian(velocity(group, F, h), n, (s - n) / h, a, t)

    def timed(F, *rest, t):
        return discrete(t, F, *rest)

    def timeless(F, *rest):
        return discrete(0.0, F, *rest)

    made = co.System(
        group,
        group_lagrangian=timed if forced else timeless,
        additional=Q,
        advected=V,
        forces=system.forces,
        parameters=system.parameters,
        name=world,
    )
    return made, start


def moser_veselov(J) -> co.System:
    """Λ = tr((I − F)D)/h with D = ½tr(J)I − J: the discrete free rigid body of Moser and Veselov."""
    J = np.asarray(J, dtype=float)

    def group_lagrangian(F, p, h):
        return jnp.trace((jnp.eye(3) - F) @ p.D) / h

    D = 0.5 * np.trace(J) * np.eye(3) - J
    return co.System(co.SO3(), group_lagrangian=group_lagrangian, parameters={"D": D}, name="Moser–Veselov")


def random_path(system, name, nodes=4):
    """Any sequence of configurations with relative motions of size one."""
    group, Q, V = system.places
    random = generator("path", name)
    elements = [element(group, random, 0.4) for _ in range(nodes)]
    g = jax.tree.map(lambda *leaves: np.stack(leaves), *elements)
    points = [Q.point(group, point(Q, group, random), "q") for _ in range(nodes)] if Q.ambient(group) else None
    q = np.zeros((nodes, 0)) if points is None else np.stack(points)
    a0 = V.point(group, point(V, group, random), "a0") if V.ambient(group) else np.zeros(0)
    eta = random.normal(size=(nodes, group.dim))
    w = random.normal(size=(nodes, Q.ambient(group)))
    return theory.Configuration(g, q), a0, eta, w


def at(path, k):
    return jax.tree.map(lambda leaf: leaf[k], path)


def named_point(system, a0):
    """The flat advected parameter as a user gives it."""
    view = system.advected.view(system.group, a0)
    return view.asdict() if hasattr(view, "asdict") else view
