"""Reduction and reconstruction: between sequences of configurations and of links (P36)–(P40), (B9)–(B11), (B17)."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.groups.group import Array, Element
from coadjoint.kernels.evaluate import evaluate, tabulate
from coadjoint.mechanics.state import Places
from coadjoint.mechanics.system import System
from coadjoint.theory.euler_poincare import Link
from coadjoint.theory.unreduced import Configuration, UnreducedLagrangian, has_points

INVARIANT = 1e-9
"""The relative change of L under random group elements that round-off may make."""


def invariance_defect(L: UnreducedLagrangian, h: float = 0.1, q: Any = None, samples: int = 5) -> float:
    """The largest |L(g̃g, g̃q, g̃g⁺, g̃q⁺, g̃a₀) − L(g, q, g⁺, q⁺, a₀)| over random elements, relative to |L| (P36).

    `q`: a point of a curved Q, where random points are made from it by the group; not needed on a linear Q.
    """
    group, Q, V = L.places
    random = np.random.default_rng(36)
    if not Q.flat and q is None:
        raise ArgumentError("The additional space is curved: give `q`, one of its points, to test invariance at.")

    def compare(etas, points, a0):
        g, g_next, moving = (group.exp(eta) for eta in etas)
        x, y = points
        if q is not None:
            x, y = Q.act(group, g, x), Q.act(group, g_next, y)
        plain = L(Configuration(g, x), Configuration(g_next, y), a0, h)
        turned = [Configuration(group.compose(moving, e), Q.act(group, moving, z)) for e, z in ((g, x), (g_next, y))]
        return plain, L(turned[0], turned[1], V.act(group, moving, a0), h)

    found = []
    for _ in range(samples):
        etas = random.normal(scale=0.6, size=(3, group.dim))
        points = random.normal(size=(2, Q.ambient(group))) if q is None else np.array([Q.point(group, q, "q")] * 2)
        found.append(evaluate(compare, etas, points, random.normal(size=V.ambient(group))))
    pairs = np.array(found)
    return float(np.max(np.abs(pairs[:, 0] - pairs[:, 1])) / max(np.max(np.abs(pairs)), 1e-300))


def reduce(L: UnreducedLagrangian, h: float = 0.1, q: Any = None) -> System:
    """The reduced system: Λ(F, n, s, a; h) = L(e, n, F, s, a; h) (P37), (B11), to be run by co.GroupVariational.

    `h`, `q`: where invariance is tested, see `invariance_defect`.
    Raises LagrangianError where L is not left-invariant.
    """
    defect = invariance_defect(L, h, q)
    if not defect <= INVARIANT:
        raise LagrangianError(
            "The discrete Lagrangian must be left-invariant, L(g̃g, g̃q, g̃g⁺, g̃q⁺, g̃a₀) = L(g, q, g⁺, q⁺, a₀), but at "
            f"random group elements it is off by {defect:.1e} of its size: make what breaks the symmetry an advected "
            "parameter."
        )
    return L.reduced


def unreduce(system: System) -> UnreducedLagrangian:
    """L(g, q, g⁺, q⁺, a₀; h) = Λ(g⁻¹g⁺, g⁻¹q, g⁻¹q⁺, g⁻¹a₀; h), the left-invariant Lagrangian of a reduced one."""
    group, Q, V = system.places
    dynamic, ruled = has_points(Q), has_points(V)

    def unreduced(g, *rest):
        rest = list(rest)
        q = rest.pop(0) if dynamic else np.zeros(0)
        g_next = rest.pop(0)
        q_next = rest.pop(0) if dynamic else np.zeros(0)
        a0 = rest.pop(0) if ruled else np.zeros(0)
        link = _link(system.places, Configuration(g, flat(q)), Configuration(g_next, flat(q_next)), flat(a0))
        return system.reduced_group_lagrangian(*link, rest[-1])

    return UnreducedLagrangian(
        group, unreduced, additional=Q if dynamic else None, advected=V if ruled else None,
        parameters=system.parameters,
    )  # fmt: skip


def flat(value: Any) -> Array:
    """A point as one array, whether it came as an array or by names."""
    return jnp.concatenate([flat(part) for part in value.asdict().values()]) if hasattr(value, "asdict") else value


def _link(places: Places, first: Configuration, second: Configuration, a0: Array) -> Link:
    group, Q, V = places
    back = group.inverse(first.g)
    return Link(
        group.compose(back, second.g), Q.act(group, back, first.q), Q.act(group, back, second.q), V.act(group, back, a0)
    )


def reduced_path(places: Places, path: Configuration, a0: Any = None) -> Link:
    """The links F_k = g_k⁻¹g_{k+1}, n_k = g_k⁻¹q_k, s_k = g_k⁻¹q_{k+1}, a_k = g_k⁻¹a₀ of a sequence (P38), (B9), (B10).

    `places` are those of a system or of an unreduced Lagrangian.
    """
    group, _, V = places
    a0 = np.zeros(0) if a0 is None else V.point(group, a0, "a0")
    first, second = (jax.tree.map(lambda leaf, cut=cut: leaf[cut], path) for cut in (slice(None, -1), slice(1, None)))
    return evaluate(jax.vmap(lambda x, y: _link(places, x, y, a0)), first, second)


def reconstruct(places: Places, g0: Element, path: Link) -> Configuration:
    """g_{k+1} = g_kF_k, q_k = g_kn_k, q_N = g_{N−1}s_{N−1} from g₀ (B17), inverse to `reduced_path`."""
    group, Q, _ = places
    g0 = jax.tree.map(np.asarray, g0)
    increments = [jax.tree.map(lambda leaf, k=k: leaf[k], path.F) for k in range(len(path.n))]
    elements, compose = [g0], tabulate(group.compose, g0, increments[0])
    for F in increments:
        elements.append(compose(elements[-1], F))
    g = jax.tree.map(lambda *leaves: np.stack(leaves), *elements)
    ends = np.concatenate([path.n, path.s[-1:]])
    frames = jax.tree.map(lambda leaf: np.concatenate([leaf[:-1], leaf[-2:-1]]), g)
    return Configuration(g, evaluate(jax.vmap(lambda g, x: Q.act(group, g, x)), frames, ends))
