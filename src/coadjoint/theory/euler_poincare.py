"""The reduced equations and the reduced algorithm in group form (P38)–(P48), (B9)–(B12), with forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.groups.derivative import left_derivative, right_derivative
from coadjoint.groups.group import Element, LieGroup
from coadjoint.mechanics.system import System
from coadjoint.spaces import Space
from coadjoint.theory.algorithm import Algorithm
from coadjoint.theory.instant import ALWAYS, Instant, given, next_instant


class Link(NamedTuple):
    """A step in reduced variables: F = g_k⁻¹g_{k+1}, n = g_k⁻¹q_k, s = g_k⁻¹q_{k+1}, a = g_k⁻¹a₀ (P38), (P39).

    `at`: its start time and the inputs and internal state held over it, for systems that depend on these.

    F: an element. n, s: (ambient,). a: (dim V*,). A sequence of steps has a leading axis.
    """

    F: Element
    n: Array
    s: Array
    a: Array
    at: Instant = ALWAYS


class Momenta(NamedTuple):
    """(μ, π) ∈ 𝔤* × T*Q, (dim G,) and (ambient,)."""

    mu: Array
    pi: Array


def _value(system: System, h: Scalar, at: Instant):
    now = given(system, at)
    return lambda F, n, s, a: system.reduced_group_lagrangian(F, n, s, a, h, *now)


def velocities(system: System, link: Link, h: Scalar) -> tuple[Array, Array]:
    """((F − F⁻¹)ᵛ/2h, (s − n)/h), (dim G,) and (ambient,): what forces take for ξ and ν on a step."""
    group = system.group
    turn = group.vee(group.matrix(link.F) - group.matrix(group.inverse(link.F))) / (2 * h)
    return turn, (link.s - link.n) / h


def impulse(system: System, link: Link, h: Scalar) -> tuple[Array, Array]:
    """(T⁻, φ⁻) = (hT, hf), (dim G,) and (ambient,), of forces at the left node of a step, as in
    co.methods.GroupVariational."""
    if system.forces is None:
        return jnp.zeros(system.group.dim), jnp.zeros_like(link.n)
    xi, nu = velocities(system, link, h)
    torque, force = system.body_force(system.motion(xi, link.n, nu, link.a, *given(system, link.at)))
    return h * torque, h * force


def left_momenta(system: System, link: Link, h: Scalar) -> Momenta:
    """The left discrete Legendre transform F⁻ of a step, μ_k (dim G,) and π_k (ambient,); traceable by JAX.

    μ_k = D^R_FΛ − ∂_aΛ⋄a − ∂_nΛ⋄n − ∂_sΛ⋄s − T⁻, π_k = −∂_nΛ − φ⁻. h: the length of the step, one number, s.
    """
    group, Q, V = system.places
    F, n, s, a, at = link
    value = _value(system, h, at)
    torque, force = impulse(system, link, h)
    along_n, along_s, along_a = jax.grad(value, argnums=(1, 2, 3))(F, n, s, a)
    mu = right_derivative(group, lambda F: value(F, n, s, a), F)
    mu = mu - V.diamond(group, along_a, a) - Q.diamond(group, along_n, n) - Q.diamond(group, along_s, s)
    return Momenta(mu - torque, Q.project(group, n, -along_n - force))


def right_momenta(system: System, link: Link, h: Scalar) -> Momenta:
    """The right discrete Legendre transform F⁺ of a step, μ_{k+1} (dim G,) and π_{k+1} (ambient,); traceable by JAX.

    μ_{k+1} = D^L_FΛ and π_{k+1} = F*∂_sΛ (P46). h: the length of the step, one number, s.
    """
    group, Q, _ = system.places
    F, n, s, a, at = link
    value = _value(system, h, at)
    ahead = Q.act(group, group.inverse(F), s)
    pi = Q.pull(group, F, ahead, jax.grad(value, argnums=2)(F, n, s, a))
    return Momenta(left_derivative(group, lambda F: value(F, n, s, a), F), Q.project(group, ahead, pi))


def discrete_euler_poincare(system: System, before: Link, here: Link, h: Scalar) -> Momenta:
    """(P42) in group form: the left momenta of step k minus the right momenta of step k − 1, zero on solutions.

    In algebra form D^R_FΛ = (dτ⁻¹_{hξ})*∂_ξΛ/h and D^L_FΛ = (dτ⁻¹_{−hξ})*∂_ξΛ/h. With forces it is the discrete
    Lagrange–d'Alembert principle, reduced. h: the length of both steps, one number, s. Returns (dim G,) and (ambient,).
    Traceable by JAX. Raises ArgumentError for links without their `at`.
    """
    left, right = left_momenta(system, here, h), right_momenta(system, before, h)
    return Momenta(left.mu - right.mu, left.pi - right.pi)


def advected(system: System, link: Link) -> tuple[Array, Array]:
    """n_{k+1} = F⁻¹s (P43), (ambient,), and a_{k+1} = F⁻¹a (P44), (dim V*,)."""
    group, Q, V = system.places
    back = group.inverse(link.F)
    return Q.act(group, back, link.s), V.act(group, back, link.a)


def instant_after(system: System, link: Link, h: Scalar) -> Instant:
    """The start of the next step, after one of length h, one number, with the inputs and internal state held over
    it."""
    n, a = advected(system, link)
    xi, nu = velocities(system, link, h)
    return next_instant(system, link.at, h, (xi, n, nu, a))


class Variation(NamedTuple):
    """η_k = g_k⁻¹δg_k and w_k = g_k⁻¹δq_k at the two ends of a step.

    eta, eta_next: (dim G,). w, w_next: (ambient,).
    """

    eta: Array
    w: Array
    eta_next: Array
    w_next: Array


def induced_variation(system: System, link: Link, v: Variation) -> Link:
    """The tangent of a step under variations of its ends: δF = −ηF + Fη⁺, and (P48) for δn, δs, δa.

    For F = τ(hξ) the first is hδξ = dτ⁻¹_{−hξ}η⁺ − dτ⁻¹_{hξ}η (P47). Time and held quantities do not vary.
    Traceable by JAX.
    """
    group, Q, V = system.places
    F, n, s, a, at = link
    e = group.identity()
    behind = jax.jvp(lambda d: group.compose(d, F), (e,), (group.tangent(-v.eta),))[1]
    ahead = jax.jvp(lambda d: group.compose(F, d), (e,), (group.tangent(v.eta_next),))[1]
    moved = Q.push(group, F, Q.act(group, group.inverse(F), s), v.w_next)
    return Link(
        jax.tree.map(lambda x, y: x + y, behind, ahead),
        v.w - Q.infinitesimal(group, v.eta, n),
        moved - Q.infinitesimal(group, v.eta, s),
        -V.infinitesimal(group, v.eta, a),
        jax.tree.map(jnp.zeros_like, at),
    )


def reduced_action(system: System, path: Link, h: Scalar) -> Array:
    """ΣΛ(F_k, n_k, s_k, a_k; h) of steps with a leading axis, one number (P41), (B12); traceable by JAX."""
    return jnp.sum(jax.vmap(lambda link: _value(system, h, link.at)(*link[:4]))(path))


@dataclass(frozen=True)
class DiscreteEulerPoincare(Algorithm):
    """The algorithm (F_{k−1}, n_{k−1}, s_{k−1}, a_{k−1}) ↦ (F_k, n_k, s_k, a_k) of (P42)–(P44)."""

    system: System

    @property
    def group(self) -> LieGroup:  # type: ignore[override]
        return self.system.group

    @property
    def space(self) -> Space:  # type: ignore[override]
        return self.system.additional

    def last(self, pair: Link, h: Scalar):
        group, Q, _ = self.system.places
        n, _ = advected(self.system, pair)
        velocity = Q.push(group, group.inverse(pair.F), pair.s, (pair.s - pair.n) / h)
        return pair.F, n, Q.tangent(group, n, Q.coordinates(group, n, velocity))

    def conditions(self, pair: Link, h: Scalar, F: Element, s: Array):
        return discrete_euler_poincare(self.system, pair, self.following(pair, h, F, s), h)

    def following(self, pair: Link, h: Scalar, F: Element, s: Array):
        n, a = advected(self.system, pair)
        return Link(F, n, s, a, instant_after(self.system, pair, h))


def discrete_euler_poincare_algorithm(system: System, first: Link, h: Scalar, steps: int) -> Link:
    """The `steps` links that start with one and solve (P42)–(P44), every leaf with a leading axis.

    `system` has a discrete Lagrangian in group form; its time, forces, inputs and internal state go on from `first.at`
    as in co.simulate. Raises StepError where Newton does not solve a step, ArgumentError for a link without its `at`.
    """
    first = jax.tree.map(lambda leaf: np.asarray(leaf, dtype=float), first)
    found: Any = DiscreteEulerPoincare(system).run(first, h, checks.whole(steps, "steps") - 1)
    return found
