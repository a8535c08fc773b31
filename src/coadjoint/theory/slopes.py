"""The slopes of the discrete Lagrangian of a step that the printed equations need, differentiated from Λ and τ.

Neither (dτ⁻¹)* nor node forms nor transported momenta of the methods are used, so that a check does not share their
mistakes.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.groups.group import LieGroup
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.step import Step
from coadjoint.theory.curves import Curve, Trial, trial
from coadjoint.theory.euler_poincare import Link, Momenta
from coadjoint.theory.instant import instants


class Impulse(NamedTuple):
    """(T⁻, φ⁻) at the beginning and (T⁺, φ⁺) at the end of a step: the virtual work of its forces.

    torque, torque_next: (dim G,). force, force_next: (ambient,).
    """

    torque: Array
    force: Array
    torque_next: Array
    force_next: Array


class Slopes(NamedTuple):
    """A step of a trajectory with what the equations take from Λ and from forces there.

    right = D^R_FΛ, left = D^L_FΛ, then ∂_nΛ, ∂_sΛ, ∂_aΛ. `inner`: the remainder of d(ΣΛ) + work along variations of the
    step with fixed ends: empty for a rule of one velocity, zero on the solutions of Galerkin's curves.

    right, left: (dim G,). along_n, along_s: (ambient,). along_a: (dim V*,). inner: shape (unknowns,) or (0,).
    """

    link: Link
    right: Array
    left: Array
    along_n: Array
    along_s: Array
    along_a: Array
    impulse: Impulse
    inner: Array


def slopes_of(system: System, step: Step, h: Scalar, record: State) -> Slopes:
    """A step with D^R_FΛ and D^L_FΛ, (dim G,) each, the gradients of Λ, and the forces' share.

    h: its length, one number.
    """
    group = system.group
    here, n, a = trial(system, step, h, record), record.n, record.a
    curve = here.curve(here.z, n, a)
    link = Link(curve.F, n, n + curve.d, a, instants(record))
    ends = _ends(system, here, record, curve)

    along_z, along_n, along_a = jax.grad(lambda *at: here.curve(*at).value, argnums=(0, 1, 2))(here.z, n, a)
    right, along_s, inner = _through(ends, along_z, group.dim)
    impulse, more = _impulse(system, here, h, record, link, curve, ends)
    inner = inner + more if len(more) else inner
    return Slopes(
        link, right, group.Ad_dual(curve.F, right), along_n - along_s, along_s, along_a, impulse, inner
    )  # fmt: skip


def impulse_of(system: System, step: Step, h: Scalar, record: State) -> Impulse:
    """What the forces of a step of a rule of one velocity give at its two ends; h: its length, one number."""
    here = trial(system, step, h, record)
    curve = here.curve(here.z, record.n, record.a)
    link = Link(curve.F, record.n, record.n + curve.d, record.a)
    return _impulse(system, here, h, record, link, curve, _ends(system, here, record, curve))[0]


def _ends(system: System, here: Trial, record: State, curve: Curve) -> Array:
    """The matrix of δz ↦ ((δF)F⁻¹, δd)."""
    group, F = system.group, system.group.matrix(curve.F)

    def end(z: Array) -> tuple[Array, Array]:
        moved = here.curve(z, record.n, record.a)
        return group.matrix(moved.F), moved.d

    turning, moving = jax.jacfwd(end)(here.z)
    return jnp.concatenate([jax.vmap(_right_trivialised(group, F), in_axes=-1, out_axes=1)(turning), moving])


def _right_trivialised(group: LieGroup, F: Array):
    """δF ↦ (δF)F⁻¹ ∈ 𝔤, of matrices (n, n), or of links (N, n, n)."""
    turned = jnp.swapaxes(F, -1, -2)
    return lambda change: group.vee(jnp.swapaxes(jnp.linalg.solve(turned, jnp.swapaxes(change, -1, -2)), -1, -2))


def _through(ends: Array, along_z: Array, dim: int) -> tuple[Array, Array, Array]:
    """(D^R_F, ∂_s) of a function of the ends of a step from its slope along z, and what z changes beyond them."""
    if ends.shape[0] == ends.shape[1]:
        found, inner = jnp.linalg.solve(ends.T, along_z), jnp.zeros(0)
    else:
        found = jnp.linalg.solve(ends @ ends.T, ends @ along_z)
        inner = along_z - ends.T @ found
    return found[:dim], found[dim:], inner


def _impulse(
    system: System, here: Trial, h: Scalar, record: State, link: Link, curve: Curve, ends: Array
) -> tuple[Impulse, Array]:
    """The virtual work h Σ w (⟨T, g⁻¹δg⟩ + ⟨f, g⁻¹δq⟩) of the nodes as covectors at the ends, and its inner part.

    At a node in the frame X at x, seen from node k: g⁻¹δg = Ad_{X⁻¹}η + X⁻¹δX and g⁻¹δq = X⁻¹(δx + η·x).
    """
    group, Q, _ = system.places
    if system.forces is None:
        nothing = jnp.zeros(group.dim), jnp.zeros_like(record.n)
        return Impulse(*nothing, *nothing), jnp.zeros(0)
    held = record.inputs, record.over_step
    forces = [(h * p.weight, *system.body_force(system.motion(*p.point, *held))) for p in curve.places]

    def work(z: Array, n: Array) -> Array:
        """Its derivative is the virtual work at fixed g_k."""
        total = jnp.zeros(())
        for (size, torque, force), was, now in zip(
            forces, curve.places, here.curve(z, n, record.a).places, strict=True
        ):
            back = group.inverse(was.frame)
            turned = group.vee(group.matrix(group.compose(back, now.frame)))
            total = total + size * (torque @ turned + force @ Q.push(group, back, was.x, now.x - was.x))
        return total

    along_z, along_n = jax.grad(work, argnums=(0, 1))(here.z, record.n)
    right, along_s, inner = _through(ends, along_z, group.dim)
    along_n = along_n - along_s
    torque = Q.diamond(group, along_n, link.n) + Q.diamond(group, along_s, link.s) - right
    for (size, T, f), place in zip(forces, curve.places, strict=True):
        back = group.inverse(place.frame)
        torque = torque + size * group.Ad_dual(back, T)
        torque = torque - size * Q.diamond(group, Q.pull(group, back, place.x, f), place.x)
    ahead = Q.act(group, group.inverse(link.F), link.s)
    return Impulse(torque, along_n, group.Ad_dual(link.F, right), Q.pull(group, link.F, ahead, along_s)), inner


def legendre_transforms(system: System, at: Slopes) -> tuple[Momenta, Momenta]:
    """F⁻ = (μ_k, π_k) and F⁺ = (μ_{k+1}, π_{k+1}) of a step:

    μ_k = D^R_FΛ − ∂_aΛ⋄a − ∂_nΛ⋄n − ∂_sΛ⋄s − T⁻, π_k = −∂_nΛ − φ⁻; μ_{k+1} = D^L_FΛ + T⁺, π_{k+1} = F*∂_sΛ + φ⁺.
    """
    group, Q, V = system.places
    F, n, s, a, _ = at.link
    torque = V.diamond(group, at.along_a, a) + Q.diamond(group, at.along_n, n) + Q.diamond(group, at.along_s, s)
    left = Momenta(at.right - torque - at.impulse.torque, Q.project(group, n, -at.along_n - at.impulse.force))
    ahead = Q.act(group, group.inverse(F), s)
    pi = Q.pull(group, F, ahead, at.along_s) + at.impulse.force_next
    return left, Momenta(at.left + at.impulse.torque_next, Q.project(group, ahead, pi))


def trivialised(system: System, step: Step, h: Scalar, record: State) -> Array:
    """The matrix (dim, dim) of δξ ↦ (δF)F⁻¹ ∈ 𝔤 for F = F(hξ), by differentiation of F: h dτ_{hξ}."""
    group = system.group

    def increment(xi: Array) -> Array:
        return group.matrix(step.relative(system, record.replace(xi=xi), h))

    F, slope = increment(record.xi), jax.jacfwd(increment)(record.xi)
    return jax.vmap(_right_trivialised(group, F), in_axes=-1, out_axes=1)(slope)
