"""Equations and theorems of constrained systems: reactions in the printed equations, momenta, the two-form on T*N."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.noether import total_momentum
from coadjoint.mechanics.reactions import node_rate, rate, reaction, site
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.rattle import constrained
from coadjoint.methods.step import Step
from coadjoint.theory.slopes import Impulse


class PhaseVariation(NamedTuple):
    """Variations of a state at fixed a₀: η = g⁻¹δg, w = g⁻¹δq = δn + η·n, δμ, δπ.

    eta, mu: (dim G,). w, pi: (ambient,).
    """

    eta: Array
    w: Array
    mu: Array
    pi: Array


class MomentumEquation(NamedTuple):
    """Both sides of the discrete momentum equation of a step, one number each.

    change: ⟨m_{k+1}, 𝒦_{k+1}⟩ − ⟨m_k, 𝒦_k⟩. moved: ⟨m_k, Ad_F𝒦_{k+1} − 𝒦_k⟩, by which the field itself changes.
    sources: ⟨Δ⁻, Ad_F𝒦_{k+1}⟩ + ⟨Δ⁺, 𝒦_{k+1}⟩ of ℓ, forces and reactions.
    """

    change: Array
    moved: Array
    sources: Array


def discrete_momentum_equation(
    system: System, step: Step, record: State, after: State, h: Scalar, section: Callable[[State], Array]
) -> MomentumEquation:
    """⟨m_{k+1}, 𝒦_{k+1}⟩ − ⟨m_k, 𝒦_k⟩ = ⟨m_k, Ad_F𝒦_{k+1} − 𝒦_k⟩ + ⟨Δ⁻, Ad_F𝒦_{k+1}⟩ + ⟨Δ⁺, 𝒦_{k+1}⟩.

    Theorem 7 along a field 𝒦: with 𝒦 = Ad_{g⁻¹}c₀ the Kelvin–Noether theorem, of which Δ∓ contain the reactions
    ½h(∂_aφᵀλ)⋄a of holonomic constraints; along 𝒦 with A·(𝒦, 𝒦·n) = 0 the momentum equation of nonholonomic systems
    (Bloch, Krishnaprasad, Marsden and Murray 1996), in which the reaction λ′ of node k + 1 does not appear.

    Arguments: step: of the method, without RATTLE around it. record: the state at node k with the unknowns of the step.
    after: the state at node k + 1. h: the length of the step. section: 𝒦 of a state, (dim G,).
    """
    around = constrained(system, step)
    ahead, behind = around.sources(system, record, h)
    here, there = section(record), section(after)
    carried = system.group.Ad(around.relative(system, record, h), there)
    first, last = total_momentum(system, record), total_momentum(system, after)
    return MomentumEquation(last @ there - first @ here, first @ (carried - here), ahead @ carried + behind @ there)


def with_reactions(system: System, records: State, forces: Impulse, h: Scalar) -> Impulse:
    """The share of forces in steps with ½hA_kᵀλ_k at their beginnings, and with ½hA_{k+1}ᵀλ′_{k+1} at their ends.

    records: consecutive nodes, (k,), of which the last has no end. forces: (k,). h: the length of a step, one number.
    """

    def both(record: State) -> list[tuple[Array, Array]]:
        strengths = record.memory.step, record.memory.end
        return [reaction(system, site(record), 0.5 * h * strength) for strength in strengths]

    first, second = evaluate(jax.vmap(both), records)
    second = [np.concatenate([one[1:], np.full_like(one[:1], np.nan)]) for one in second]
    return jax.tree.map(np.add, forces, Impulse(*first, *second))


def off_nodes(system: System, record: State) -> tuple[Array, Array, Array]:
    """φ of the holonomic constraints of a node, (m,), A·(ξ, ν) − b of all, (rows,), and (ξ, ν) of its momenta."""
    at, (xi, nu, _) = site(record), inverse_legendre.velocities(system, record)
    places = [one.value(system, at) for one in system.constraints if one.holonomic]
    return jnp.concatenate([jnp.zeros(0), *places]), rate(system, at, xi, nu), jnp.concatenate([xi, nu])


def generator(system: System, state: State, direction: Array) -> tuple[Array, Array]:
    """(𝒦, 𝒦·n), (dim G,) and (ambient,): the velocities (ξ, ν) of the motion g ↦ g exp(ε𝒦) at fixed n.

    direction: 𝒦, (dim G,).
    """
    return direction, system.additional.infinitesimal(system.group, direction, state.n)


def two_form(system: System, state: State, d1: PhaseVariation, d2: PhaseVariation) -> tuple[Array, Array]:
    """ω(δ₁, δ₂) = ⟨δ₂μ, η₁⟩ − ⟨δ₁μ, η₂⟩ + ⟨μ, [η₁, η₂]⟩ + ⟨δ₂π, w₁⟩ − ⟨δ₁π, w₂⟩ + ⟨π, η₁·w₂ − η₂·w₁⟩ and its size.

    One number each.
    """
    group, Q = system.group, system.additional
    turned = Q.lifted(group, d1.eta, state.n, d2.w) - Q.lifted(group, d2.eta, state.n, d1.w)
    on_group = [d2.mu @ d1.eta, -d1.mu @ d2.eta, state.mu @ group.ad(d1.eta, d2.eta)]
    terms = jnp.stack([*on_group, d2.pi @ d1.w, -d1.pi @ d2.w, state.pi @ turned])
    return jnp.sum(terms), jnp.sum(jnp.abs(terms))


def off_constraints(system: System, state: State, d: PhaseVariation) -> Array:
    """(Dφ·δ, Dφ̇·δ), 2m numbers, zero for tangents to T*N, N = {φ = 0}; raises ArgumentError where Q is curved."""
    group, Q, V = system.places
    if not Q.flat or not all(one.holonomic for one in system.constraints):
        raise ArgumentError("Tangents to T*N need holonomic constraints on a flat space of additional dynamics.")

    def rows(n, a, mu, pi):
        here = state.replace(n=n, a=a, mu=mu, pi=pi)
        return jnp.concatenate(
            [*(one.value(system, site(here)) for one in system.constraints), node_rate(system, here)]
        )

    along = d.w - Q.infinitesimal(group, d.eta, state.n), -V.infinitesimal(group, d.eta, state.a), d.mu, d.pi
    return jax.jvp(rows, (state.n, state.a, state.mu, state.pi), along)[1]


def tangent_to_constraints(system: System, state: State, d: PhaseVariation) -> PhaseVariation:
    """The nearest variation tangent to T*N, in the Euclidean norm of (η, w, δμ, δπ); raises as `off_constraints`."""
    sizes = [len(part) for part in d]
    ends = [sum(sizes[: i + 1]) for i in range(3)]

    def unpack(x: Array) -> PhaseVariation:
        return PhaseVariation(*jnp.split(x, ends))

    x = jnp.concatenate(d)
    L = jax.jacfwd(lambda x: off_constraints(system, state, unpack(x)))(x)
    return unpack(x - L.T @ jnp.linalg.solve(L @ L.T, L @ x))
