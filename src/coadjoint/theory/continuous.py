"""Continuous reduction (P1), (P10), (P15)–(P17): between L(g, ġ, q, q̇, a₀) and ℓ(ξ, n, ν, a)."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import LagrangianError
from coadjoint.groups.group import Element, LieGroup
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.system import System
from coadjoint.theory.instant import ALWAYS, Instant, given
from coadjoint.theory.reduction import defect_of, flat, point_of, require_invariant
from coadjoint.theory.unreduced import Configuration, LagrangianInSpace, has_points


def body_velocity(group: LieGroup, g: Element, g_dot: Element) -> Array:
    """ξ = (g⁻¹ġ)ᵛ, (dim,), of a tangent ġ in the arrays that hold g (P1), (P17); traceable by JAX."""
    matrix, moved = jax.jvp(group.matrix, (g,), (g_dot,))
    return group.vee(jnp.linalg.solve(matrix, moved))


def space_velocity(group: LieGroup, g: Element, xi: Array) -> Element:
    """ġ = gξ̂, in the arrays that hold g, of ξ (dim,); traceable by JAX."""
    return jax.jvp(lambda e: group.compose(g, e), (group.identity(),), (group.tangent(xi),))[1]


class ContinuousLagrangian(LagrangianInSpace):
    """L(g, ġ, q, q̇, a₀) on TG × TQ × V*, in the space frame (P15).

    `function` takes g, g_dot [, q, q_dot] [, a0] [, p] in this order and returns a number: q, q_dot with `additional`,
    a0 with `advected`, p with `parameters`; it may take keyword-only `t`, `inputs` and `internal`. ġ has the arrays of
    g: a matrix for a matrix, a pair (Ṙ, ẋ) for a pair (R, x). `forces`, `internal`: as those of co.System.
    Raises LagrangianError for other arguments.
    """

    _kind, _what = "lagrangian", "The unreduced Lagrangian"

    def _taken(self, dynamic: bool) -> list[str]:
        return ["g", "g_dot", "q", "q_dot"] if dynamic else ["g", "g_dot"]

    def __call__(self, place: Configuration, velocity: Configuration, a0: Array, at: Instant = ALWAYS) -> Array:
        """L, one number, at (g, q) with velocities (ġ, q̇). a0: (dim V*,); at: what L takes by keyword."""
        group, Q, _ = self.places
        pair = [Q.view(group, x) for x in (place.q, velocity.q)] if has_points(Q) else []
        return self._value([place.g, velocity.g, *pair], a0, at)

    def _at_identity(self, xi: Array, *rest: PyTree, **keywords: PyTree) -> Array:
        """ℓ(ξ, n, ν, a) = L(e, ξ̂, n, ν, a) (P17)."""
        group = self.places.group
        return self.function(group.identity(), group.tangent(xi), *rest, **keywords)


def continuous_invariance_defect(
    L: ContinuousLagrangian, q: object = None, samples: int = 5, at: Instant = ALWAYS
) -> float:
    """The largest |L(g̃g, g̃ġ, g̃q, g̃q̇, g̃a₀) − L(g, ġ, q, q̇, a₀)| over random elements, relative to |L| (P15).

    `q`: a point of a curved Q, where random points are made from it by the group; not needed on a linear Q. `at`: the
    instant, for an L with inputs or an internal state.
    """
    group, Q, V = L.places
    random, base = np.random.default_rng(15), point_of(L.places, q)
    at = replace(at, t=0.36) if at.t is None else at
    given(L.reduced, at)

    def compare(etas, xi: Array, x: Array, v: Array, a0: Array):
        g, moving = group.exp(etas[0]), group.exp(etas[1])
        if base is not None:
            x, v = Q.act(group, g, x), Q.push(group, g, x, Q.tangent(group, x, Q.coordinates(group, x, v)))
        turned = group.compose(moving, g)
        plain = Configuration(g, x), Configuration(space_velocity(group, g, xi), v), a0
        return defect_of(
            lambda place, velocity, a0: L(place, velocity, a0, at),
            plain,
            (
                Configuration(turned, Q.act(group, moving, x)),
                Configuration(space_velocity(group, turned, xi), Q.push(group, moving, x, v)),
                V.act(group, moving, a0),
            ),
        )

    found = []
    for _ in range(samples):
        etas, xi = random.normal(scale=0.6, size=(2, group.dim)), random.normal(size=group.dim)
        x, v = Q.sample(group, random) if base is None else base, random.normal(size=Q.ambient(group))
        found.append(evaluate(compare, etas, xi, x, v, V.sample(group, random)))
    return float(np.max(found))


def reduce_continuous(L: ContinuousLagrangian, q: object = None, at: Instant = ALWAYS) -> System:
    """The reduced system: ℓ(ξ, n, ν, a) = L(e, ξ̂, n, ν, a) with ξ = g⁻¹ġ, n = g⁻¹q, ν = g⁻¹q̇, a = g⁻¹a₀ (P16), (P17).

    Without Q it is (P10), without parameters (P1), (P2). `q`, `at`: where invariance is tested, see
    `continuous_invariance_defect`. Raises LagrangianError where L is not left-invariant to 1e-12 of its size.
    """
    require_invariant(continuous_invariance_defect(L, q, at=at), "Lagrangian", "L(g̃g, g̃ġ, g̃q, g̃q̇, g̃a₀)")
    return L.reduced


def unreduce_continuous(system: System) -> ContinuousLagrangian:
    """L(g, ġ, q, q̇, a₀) = ℓ(g⁻¹ġ, g⁻¹q, g⁻¹q̇, g⁻¹a₀), the left-invariant Lagrangian of a reduced one.

    Time, forces, inputs and the internal state of the system are those of L. Raises LagrangianError for a system that
    is given by a discrete Lagrangian alone.
    """
    if not system.continuous:
        raise LagrangianError(
            "This system has a discrete Lagrangian only: theory.unreduce gives its unreduced form; pass `lagrangian` "
            "to co.System for a continuous one."
        )
    group, Q, V = system.places
    dynamic, ruled = has_points(Q), has_points(V)
    # What L takes by keyword has been read from the signals already.
    plain = system.driven(None)

    def unreduced(g: Element, g_dot, *rest, t: Scalar = 0.0, inputs: PyTree = None, internal: PyTree = None):
        q, q_dot = map(flat, rest[:2]) if dynamic else (np.zeros(0),) * 2
        a0 = flat(rest[2 if dynamic else 0]) if ruled else np.zeros(0)
        back = group.inverse(g)
        n, nu, a = Q.act(group, back, q), Q.push(group, back, q, q_dot), V.act(group, back, a0)
        here = plain if plain.parameters is None else replace_parameters(plain, rest[-1])
        return here.reduced_lagrangian(body_velocity(group, g, g_dot), n, nu, a, t, inputs, internal)

    return ContinuousLagrangian.of(system, unreduced)
