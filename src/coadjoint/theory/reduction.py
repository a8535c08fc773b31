"""Reduction and reconstruction: between sequences of configurations and of links (P36)–(P40), (B9)–(B11), (B17)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.state import Places
from coadjoint.mechanics.system import System
from coadjoint.spaces.named import Named
from coadjoint.theory.euler_poincare import Link
from coadjoint.theory.instant import ALWAYS, Instant, given, require_instants
from coadjoint.theory.unreduced import (
    Configuration,
    UnreducedLagrangian,
    has_points,
    link_of,
    parameter_of,
)

INVARIANT = 1e-12
"""The relative change of L under random group elements that round-off may make."""

CANCELLED = 32 * np.finfo(float).eps / INVARIANT
"""How far an entry x of the arguments counts, |∂_xL||x|, so that terms which cancel in L are not a defect."""


def defect_of(function: Callable[..., Array], plain: object, turned: object) -> Array:
    """|L(turned) − L(plain)|, one number, relative to |L| and to what round-off in the arguments makes of L.

    Traceable by JAX.
    """

    def sized(arguments: object) -> tuple[Array, Array]:
        value, slopes = jax.value_and_grad(lambda arguments: function(*arguments))(arguments)
        pairs = zip(jax.tree.leaves(slopes), jax.tree.leaves(arguments), strict=True)
        inside = sum((jnp.sum(jnp.abs(jnp.nan_to_num(slope) * x)) for slope, x in pairs), jnp.zeros(()))
        return value, jnp.abs(value) + CANCELLED * inside

    (value, size), (moved, other) = sized(plain), sized(turned)
    return jnp.abs(moved - value) / jnp.maximum(jnp.maximum(size, other), 1e-300)


def invariance_defect(
    L: UnreducedLagrangian, h: Scalar = 0.1, q: object = None, samples: int = 5, at: Instant = ALWAYS
) -> float:
    """The largest |L(g̃g, g̃q, g̃g⁺, g̃q⁺, g̃a₀) − L(g, q, g⁺, q⁺, a₀)| over random elements, relative to |L| (P36).

    Half of the steps are of length 1, half of length h, where a potential counts against the kinetic energy.
    `q`: a point of a curved Q, where random points are made from it by the group; not needed on a linear Q.
    `at`: the instant of the step, for an L with inputs or an internal state.
    """
    group, Q, V = L.places
    random = np.random.default_rng(36)
    base = point_of(L.places, q)
    at = replace(at, t=0.36) if at.t is None else at
    given(L.reduced, at)

    def compare(etas, points, a0: Array, scale):
        g, moving = group.exp(etas[0]), group.exp(etas[2])
        g_next = group.compose(g, group.exp(scale * etas[1]))
        x, y = points[0], points[0] + scale * (points[1] - points[0])
        if base is not None:
            x, y = Q.act(group, g, x), Q.act(group, g_next, x)
        plain = Configuration(g, x), Configuration(g_next, y), a0
        turned = [Configuration(group.compose(moving, e), Q.act(group, moving, z)) for e, z in plain[:2]]
        return defect_of(
            lambda first, second, a0: L(first, second, a0, h, at), plain, (*turned, V.act(group, moving, a0))
        )

    found = []
    for scale in (1.0, h):
        for _ in range(samples):
            etas = random.normal(scale=0.6, size=(3, group.dim))
            points = np.stack([Q.sample(group, random) if base is None else base for _ in range(2)])
            a0 = V.sample(group, random)
            found.append(evaluate(compare, etas, points, a0, np.float64(scale)))
    return float(np.max(found))


def point_of(places: Places, q: PyTree) -> Array | None:
    """A point of a curved Q, (ambient,); None on a flat one, where any will do."""
    group, Q, _ = places
    if q is not None:
        return Q.point(group, q, "q")
    if not Q.flat:
        raise ArgumentError("The additional space is curved: give `q`, one of its points, to test invariance at.")
    return None


def reduce(L: UnreducedLagrangian, h: Scalar = 0.1, q: object = None, at: Instant = ALWAYS) -> System:
    """The reduced system: Λ(F, n, s, a; h) = L(e, n, F, s, a; h) (P37), (B11), to be run by
    co.methods.GroupVariational.

    `h`, `q`, `at`: where invariance is tested, see `invariance_defect`; give the h of your runs.
    Raises LagrangianError where L is not left-invariant to 1e-12 of its size.
    """
    require_invariant(invariance_defect(L, h, q, at=at), "discrete Lagrangian", "L(g̃g, g̃q, g̃g⁺, g̃q⁺, g̃a₀)")
    return L.reduced


def require_invariant(defect: float, what: str, turned: str) -> None:
    """Raise LagrangianError unless a defect is one of round-off."""
    if not defect <= INVARIANT:
        plain = turned.replace("g̃", "")
        raise LagrangianError(
            f"The {what} must be left-invariant, {turned} = {plain}, but at random group elements it is off by "
            f"{defect:.1e} of its size: make what breaks the symmetry an advected parameter."
        )


def unreduce(system: System) -> UnreducedLagrangian:
    """L(g, q, g⁺, q⁺, a₀; h) = Λ(g⁻¹g⁺, g⁻¹q, g⁻¹q⁺, g⁻¹a₀; h), the left-invariant Lagrangian of a reduced one.

    Time, forces, inputs and the internal state of the system are those of L.
    """
    _, Q, V = system.places
    dynamic, ruled = has_points(Q), has_points(V)
    # What L takes by keyword has been read from the signals already.
    plain = system.driven(None)

    def unreduced(g: Element, *rest, t: Scalar = 0.0, inputs: PyTree = None, internal: PyTree = None):
        rest = list(rest)
        q = rest.pop(0) if dynamic else np.zeros(0)
        g_next = rest.pop(0)
        q_next = rest.pop(0) if dynamic else np.zeros(0)
        a0 = rest.pop(0) if ruled else np.zeros(0)
        ends = Configuration(g, flat(q)), Configuration(g_next, flat(q_next))
        F, n, s, a, _ = link_of(system.places, *ends, flat(a0))
        here = plain if plain.parameters is None else replace_parameters(plain, rest[-2])
        return here.reduced_group_lagrangian(F, n, s, a, rest[-1], t, inputs, internal)

    return UnreducedLagrangian.of(system, unreduced)


def flat(value: Array | Named) -> Array:
    """A point as one array (ambient,), whether it came as an array or by names."""
    return jnp.concatenate([flat(part) for part in value.asdict().values()]) if isinstance(value, Named) else value


def reduced_path(places: Places, path: Configuration, a0: PyTree = None, at: Instant = ALWAYS) -> Link:
    """The links F_k = g_k⁻¹g_{k+1}, n_k = g_k⁻¹q_k, s_k = g_k⁻¹q_{k+1}, a_k = g_k⁻¹a₀ of a sequence (P38), (B9), (B10).

    `places` are those of a system or of an unreduced Lagrangian. `at`: the instants of the steps, with a leading axis,
    such as theory.instants of a run's records but the last, where the system depends on them.
    """
    a0 = parameter_of(places, a0)
    require_instants(at, len(path.q) - 1)
    first, second = (jax.tree.map(lambda leaf, cut=cut: leaf[cut], path) for cut in (slice(None, -1), slice(1, None)))
    return evaluate(jax.vmap(lambda x, y, at: link_of(places, x, y, a0, at)), first, second, at)


def reconstruct(places: Places, g0: Element, path: Link) -> Configuration:
    """g_{k+1} = g_kF_k, q_k = g_kn_k, q_N = g_{N−1}s_{N−1} from g₀ (B17), inverse to `reduced_path`."""
    group, Q, _ = places
    if np.ndim(path.n) != 2 or not len(path.n):
        raise ArgumentError(
            "Argument `path` must hold one link or more with a leading axis, as theory.reduced_path makes, but its "
            f"n has shape {np.shape(path.n)}."
        )
    g0 = jax.tree.map(np.asarray, g0)
    increments = [jax.tree.map(lambda leaf, k=k: leaf[k], path.F) for k in range(len(path.n))]
    elements, compose = [g0], tabulate(group.compose, g0, increments[0])
    for F in increments:
        elements.append(compose(elements[-1], F))
    g = jax.tree.map(lambda *leaves: np.stack(leaves), *elements)
    ends = np.concatenate([path.n, path.s[-1:]])
    frames = jax.tree.map(lambda leaf: np.concatenate([leaf[:-1], leaf[-2:-1]]), g)
    return Configuration(g, evaluate(jax.vmap(lambda g, x: Q.act(group, g, x)), frames, ends))
