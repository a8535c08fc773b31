"""What the printed equations take from the discrete Lagrangian of a step, differentiated anew from Λ and τ.

Neither (dτ⁻¹)* nor node forms nor transported momenta of the methods are used, so that a check does not share their
mistakes.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from coadjoint.groups.derivative import right_derivative
from coadjoint.groups.group import Array
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import GroupVariational, Variational
from coadjoint.theory.euler_poincare import Link


class Slopes(NamedTuple):
    """A step of a trajectory with what the equations take from Λ there."""

    link: Link
    right: Array
    left: Array
    along_n: Array
    along_s: Array
    along_a: Array


def slopes_of(system: System, step: Any, h: float, record: State) -> Slopes:
    """The link of the step that starts at a record, D^R_FΛ, D^L_FΛ and the gradients of Λ."""
    group, Q, _ = system.places
    F, turn = step.relative(system, record, h), step.turn(system, h, record.xi)
    start = record.n if turn is None else Q.act(group, group.inverse(turn), record.n)
    chord = record.nu if turn is None else Q.push(group, turn, start, record.nu)
    s = record.n + h * chord
    if isinstance(step, GroupVariational):

        def in_group(F, n, s, a):
            return system.reduced_group_lagrangian(F, n, s, a, h, record.t, record.inputs, record.internal)

        right = right_derivative(group, lambda F: in_group(F, record.n, s, record.a), F)
        along = jax.grad(in_group, argnums=(1, 2, 3))(F, record.n, s, record.a)
    else:
        value = partial(_value, system, step, record, h)
        along_xi, *along = jax.grad(value, argnums=(0, 1, 2, 3))(record.xi, record.n, s, record.a)
        right = jnp.linalg.solve(trivialised(system, step, h, record.xi).T, along_xi)
    return Slopes(Link(F, record.n, s, record.a), right, group.Ad_dual(F, right), *along)


def _value(system: System, step: Any, record: State, h: float, xi, n, s, a) -> Array:
    """Λ(ξ, n, s, a; h) of a rule: h Σ w ℓ at its nodes; or the user's own."""
    if isinstance(step, Variational):
        return step.discrete_lagrangian(system, record.replace(xi=xi, n=n, nu=(s - n) / h, a=a), h)
    group, Q, _ = system.places
    turn = step.turn(system, h, xi)
    nu = (s - n) / h if turn is None else Q.push(group, group.inverse(turn), n, (s - n) / h)
    moved = record.replace(xi=xi, n=n, nu=nu, a=a)
    return h * sum(weight * at.lagrangian for weight, at in step.nodes(system, moved, h))


def trivialised(system: System, step: Any, h: float, xi: Array) -> Array:
    """The matrix of δξ ↦ (δF)F⁻¹ ∈ 𝔤 for F = F(hξ), by differentiation of F: h dτ_{hξ}."""
    group = system.group
    F = group.matrix(step.increment(system, h, xi))
    slope = jax.jacfwd(lambda x: group.matrix(step.increment(system, h, x)))(xi)
    return jax.vmap(lambda d: group.vee(jnp.linalg.solve(F.T, d.T).T), in_axes=2, out_axes=1)(slope)
