"""The discrete core in node form: what a quadrature rule needs from ℓ at one node (Theorem 6; mathematics: 5, 6)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.mechanics.reduced_functions import added
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.traced_once import traced_once


class Point(NamedTuple):
    """Where ℓ is evaluated: (ξ, n, ν, a) at time t.

    xi: (dim G,). n, nu: (ambient,). a: (dim V*,). t: one number, s.
    """

    xi: Array
    n: Array
    nu: Array
    a: Array
    t: Scalar


class Node(NamedTuple):
    """What the discrete equations take from ℓ and the forces at a point.

    mu = ∂_ξℓ, pi = ∂_νℓ, torque = ∂_aℓ⋄a + ∂_nℓ⋄n + ∂_νℓ⋄ν + T (D/h), force = ∂_nℓ + f (κ/h),
    source = ∂_aℓ⋄a + T − f⋄n (Δ), energy = ⟨∂_ξℓ, ξ⟩ + ⟨∂_νℓ, ν⟩ − ℓ, lagrangian = ℓ, and power = ⟨T, ξ⟩ + ⟨f, ν⟩ of
    each force, then −∂_tℓ where ℓ depends on time: they add up to Ė.

    mu, torque, source: (dim G,). pi, force: (ambient,). energy, lagrangian: one number. power: (lines,).
    """

    mu: Array
    pi: Array
    torque: Array
    force: Array
    source: Array
    energy: Array
    lagrangian: Array
    power: Array


class Chord(NamedTuple):
    """The step of q in the frame of a node: from x to y, with n = x + w(y − x) and ν = (y − x)/h.

    x, y: (ambient,). weight: w. h: one number, s.
    """

    x: Array
    y: Array
    weight: float
    h: Scalar


def chord(system: System, x: Array, nu: Array, weight: float, h: Scalar) -> Chord | None:
    """The chord from x to x + hν, both (ambient,), for `node`; None where the action is affine, which needs none."""
    return None if system.additional.affine else Chord(x, x + h * nu, weight, h)


@traced_once
def node(system: System, state: State, point: Point, chord: Chord | None = None) -> Node:
    """Evaluate ℓ, its gradients and the forces once at `point`; inputs and internal state are those over its step.

    chord: the step of q, if the action on Q is not affine. Then ∂_nℓ⋄n + ∂_νℓ⋄ν of `torque` is the value along the
    chord, ((1 − w)∂_nℓ⋄x + w∂_nℓ⋄y) + (∂_νℓ⋄y − ∂_νℓ⋄x)/h, and f⋄n of `source` likewise: so the ends of the step turn,
    whose action is exact.
    """
    group, Q, V = system.places
    xi, n, nu, a, t = point

    def lagrangian(xi: Array, n: Array, nu: Array, a: Array, t: Scalar):
        return system.reduced_lagrangian(xi, n, nu, a, t, state.inputs, state.over_step, near=(state.mu, state.pi))

    along = (0, 1, 2, 3, 4) if system.depends_on_time else (0, 1, 2, 3)
    value, slopes = jax.value_and_grad(lagrangian, argnums=along)(xi, n, nu, a, jnp.asarray(t))
    mu, along_n, pi, along_a, *along_t = slopes
    forces = system.body_forces(system.motion(xi, n, nu, a, t, state.inputs, state.over_step, (mu, pi)))
    torque, force = added(system, forces)
    from_advected = V.diamond(group, along_a, a)

    def at_place(b: Array) -> Array:
        """b⋄n, or the mean over both ends of a chord."""
        if chord is None:
            return Q.diamond(group, b, n)
        x, y, w, _ = chord
        return (1 - w) * Q.diamond(group, b, x) + w * Q.diamond(group, b, y)

    if chord is None:
        moving = Q.lifted_diamond(group, pi, n, nu)
    else:
        moving = (Q.diamond(group, pi, chord.y) - Q.diamond(group, pi, chord.x)) / chord.h
    return Node(
        mu=mu,
        pi=pi,
        torque=from_advected + at_place(along_n) + moving + torque,
        force=along_n + force,
        source=from_advected + torque - at_place(force),
        energy=mu @ xi + pi @ nu - value,
        lagrangian=value,
        power=power(forces, xi, nu, along_t),
    )


def power(forces: list[tuple[Array, Array]], xi: Array, nu: Array, along_t: Sequence[Array]) -> Array:
    """⟨T, ξ⟩ + ⟨f, ν⟩ of each force, then −∂_tℓ where it is given: shape (forces,) or (forces + 1,).

    forces: pairs of T (dim G,) and f (ambient,). xi: (dim G,). nu: (ambient,). along_t: ∂_tℓ, or nothing.
    """
    return jnp.stack([*(T @ xi + f @ nu for T, f in forces), *(-slope for slope in along_t), jnp.zeros(())])[:-1]
