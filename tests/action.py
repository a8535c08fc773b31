"""The discrete action of every rule, written from section 6 of the mathematics and differentiated.

It shares with the methods only τ, the action of the group and ℓ: neither (dτ⁻¹)*, nor diamonds, nor node forms.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

import coadjoint as co
from coadjoint.methods import Step
from coadjoint.spaces import Space

MIDDLE = (co.Midpoint, co.Simpson)
"""The rules with a node in the middle of the step, F = H²."""


class Variations(NamedTuple):
    """η = g⁻¹δg and w = g⁻¹δq at both ends of a step."""

    eta: Any
    w: Any
    eta_next: Any
    w_next: Any


def half(system: co.System, step: Step, hxi) -> Any:
    """H = σ(hξ/2), of the midpoint rule."""
    return step.difference_map.tau(system.group, 0.5 * hxi)


def increment(system: co.System, step: Step, hxi) -> Any:
    """F = τ(hξ); of rules with a node in the middle F = H²."""
    if isinstance(step, MIDDLE):
        H = half(system, step, hxi)
        return system.group.compose(H, H)
    return step.difference_map.tau(system.group, hxi)


def chord_end(system: co.System, step: Step, record: co.State, h) -> Any:
    """s = g_k⁻¹q_{k+1} from the velocity at the rule's own node."""
    group, Q = system.group, system.additional
    frame = group.identity()
    if isinstance(step, co.RightRectangle):
        frame = increment(system, step, h * record.xi)
    if isinstance(step, MIDDLE):
        frame = half(system, step, h * record.xi)
    return Q.act(group, frame, Q.act(group, group.inverse(frame), record.n) + h * record.nu)


def nodes(system: co.System, step: Step, xi, n, s, a, h, t) -> list[tuple[float, Any]]:
    """(weight, (ξ, n, ν, a, t)) of the rule's quadrature."""
    group, Q, V = system.group, system.additional, system.advected

    def seen_from(frame, fraction, weight):
        back = group.inverse(frame)
        first, last = Q.act(group, back, n), Q.act(group, back, s)
        place, velocity = first + fraction * (last - first), (last - first) / h
        if isinstance(step, co.Simpson) and not Q.flat:
            turn = group.compose(back, half(system, step, h * xi))
            ends = [Q.act(group, group.inverse(turn), x) for x in (first, last)]
            bend = Q.push(group, turn, ends[0], middle(system, *ends) - 0.5 * (ends[0] + ends[1]))
            place, velocity = place + 4 * fraction * (1 - fraction) * bend, velocity + (4 - 8 * fraction) / h * bend
        return weight, (xi, place, velocity, V.act(group, back, a), t + fraction * h)

    if isinstance(step, co.LeftRectangle):
        return [seen_from(group.identity(), 0.0, 1.0)]
    if isinstance(step, co.RightRectangle):
        return [seen_from(increment(system, step, h * xi), 1.0, 1.0)]
    if isinstance(step, co.Midpoint):
        return [seen_from(half(system, step, h * xi), 0.5, 1.0)]
    if isinstance(step, co.Simpson):
        H, F = half(system, step, h * xi), increment(system, step, h * xi)
        return [seen_from(group.identity(), 0.0, 1 / 6), seen_from(H, 0.5, 4 / 6), seen_from(F, 1.0, 1 / 6)]
    assert isinstance(step, co.Trapezoidal)
    return [seen_from(group.identity(), 0.0, 0.5), seen_from(increment(system, step, h * xi), 1.0, 0.5)]


def middle(system: co.System, x, y) -> Any:
    """The middle of two points of a curved Q: the mean of two points halfway, by the retraction from either end."""
    group, Q = system.group, system.additional
    from_x, from_y = (p + Q.difference(group, p, Q.project(group, p, 0.5 * (q - p))) for p, q in ((x, y), (y, x)))
    return 0.5 * (from_x + from_y)


def discrete_lagrangian(system: co.System, step: Step, xi, n, s, a, h, t) -> Any:
    """Λ(ξ, n, s, a; h) = h Σ weight ℓ(node)."""
    return h * sum(w * system.reduced_lagrangian(*at) for w, at in nodes(system, step, xi, n, s, a, h, t))


def infinitesimal(space: Space, group, xi, x) -> Any:
    """ξ·x by differentiation of the action, whatever closed form the space has."""
    return Space.infinitesimal(space, group, xi, x)


def varied_velocity(system: co.System, step: Step, hxi, v: Variations) -> Any:
    """hδξ from δF = −η_kF + Fη_{k+1}: the linear equations Dτ(hξ)·hδξ = δF, solved by least squares."""
    group = system.group

    def F(x):
        return group.matrix(increment(system, step, x))

    tangent = jax.jacfwd(F)(hxi).reshape(-1, group.dim)
    change = F(hxi) @ group.hat(v.eta_next) - group.hat(v.eta) @ F(hxi)
    return jnp.linalg.solve(tangent.T @ tangent, tangent.T @ change.reshape(-1))


def virtual_work(system: co.System, step: Step, record: co.State, h, v: Variations, dhxi) -> Any:
    """Σ h weight (⟨T, η⟩ + ⟨f, w⟩) with η, w those of the nodes' own frames."""
    group, Q = system.group, system.additional
    hxi = h * record.xi
    s = chord_end(system, step, record, h)
    F = increment(system, step, hxi)
    total = 0.0
    for index, (weight, at) in enumerate(nodes(system, step, record.xi, record.n, s, record.a, h, record.t)):
        torque, force = system.body_force(system.motion(*at))
        if isinstance(step, co.Midpoint) or (isinstance(step, co.Simpson) and index == 1):
            value, change = jax.jvp(lambda x: group.matrix(half(system, step, x)), (hxi,), (dhxi,))
            eta = group.vee(jnp.linalg.solve(value, group.hat(v.eta) @ value + change))
            ends = v.w, Q.push(group, F, Q.act(group, group.inverse(F), s), v.w_next)
            back = group.inverse(half(system, step, hxi))
            w0, w1 = (Q.push(group, back, record.n, end) for end in ends)
            w = 0.5 * (w0 + w1)
            if isinstance(step, co.Simpson) and not Q.flat:
                x = [Q.act(group, back, p) for p in (record.n, s)]
                moves = [end - infinitesimal(Q, group, eta, p) for end, p in zip((w0, w1), x, strict=True)]
                place, change = jax.jvp(lambda a, b: middle(system, a, b), tuple(x), tuple(moves))
                w = infinitesimal(Q, group, eta, place) + change
        else:
            first = isinstance(step, co.LeftRectangle) or (isinstance(step, co.Trapezoidal | co.Simpson) and index == 0)
            eta, w = (v.eta, v.w) if first else (v.eta_next, v.w_next)
        total = total + h * weight * (torque @ eta + force @ w)
    return total


def variation(system: co.System, step: Step, record: co.State, h, v: Variations) -> Any:
    """dΛ + virtual work of one step under the variations at its ends."""
    group, Q, V = system.group, system.additional, system.advected
    s = chord_end(system, step, record, h)
    F = increment(system, step, h * record.xi)
    dhxi = varied_velocity(system, step, h * record.xi, v)
    dn = v.w - infinitesimal(Q, group, v.eta, record.n)
    ds = Q.push(group, F, Q.act(group, group.inverse(F), s), v.w_next) - infinitesimal(Q, group, v.eta, s)
    da = -infinitesimal(V, group, v.eta, record.a)

    def action(xi, n, s, a):
        return discrete_lagrangian(system, step, xi, n, s, a, h, record.t)

    change = jax.jvp(action, (record.xi, record.n, s, record.a), (dhxi / h, dn, ds, da))[1]
    return change + virtual_work(system, step, record, h, v, dhxi)


def boundary_momenta(system: co.System, step: Step, record: co.State, h) -> Variations:
    """(μ_k, π_k, μ_{k+1}, π_{k+1}) for which dΛ + work = [⟨μ, η⟩ + ⟨π, w⟩]: both discrete Legendre transforms."""
    group, Q = system.group, system.additional
    nothing = Variations(
        jnp.zeros(group.dim), jnp.zeros(Q.ambient(group)), jnp.zeros(group.dim), jnp.zeros(Q.ambient(group))
    )
    slopes = jax.grad(lambda v: variation(system, step, record, h, v))(nothing)
    n_next = Q.act(group, group.inverse(increment(system, step, h * record.xi)), chord_end(system, step, record, h))
    return Variations(
        -slopes.eta,
        Q.project(group, record.n, -slopes.w),
        slopes.eta_next,
        Q.project(group, n_next, slopes.w_next),
    )


def boundary_forces(system: co.System, step: Step, record: co.State, h) -> Variations:
    """(T⁻, φ⁻, T⁺, φ⁺): the virtual work of a step as a covector on the variations at its ends."""
    group, Q = system.group, system.additional
    zeros = jnp.zeros(group.dim), jnp.zeros(Q.ambient(group))

    def work(v):
        return virtual_work(system, step, record, h, v, varied_velocity(system, step, h * record.xi, v))

    return jax.grad(work)(Variations(*zeros, *zeros))


def gradients(system: co.System, step: Step, record: co.State, h) -> tuple[Any, Any, Any, Any]:
    """(∂_ξΛ, ∂_nΛ, ∂_sΛ, ∂_aΛ) at a record."""
    s = chord_end(system, step, record, h)

    def action(xi, n, s, a):
        return discrete_lagrangian(system, step, xi, n, s, a, h, record.t)

    return jax.grad(action, argnums=(0, 1, 2, 3))(record.xi, record.n, s, record.a)


def diamond(space: Space, group, b, x) -> Any:
    """b⋄x by its definition ⟨b⋄x, ξ⟩ = −⟨b, ξ·x⟩, one basis element of 𝔤 after the other."""
    return -jax.vmap(lambda xi: b @ infinitesimal(space, group, xi, x))(jnp.eye(group.dim))
