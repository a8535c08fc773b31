"""Properties of one step: the two-form that it conserves, and reversibility.

Two curves ε ↦ (g, q, μ, π) with tangents δ₁, δ₂ go through a step as they are, by the kernel that runs it; the tangents
before and after are central differences of order 8 in ε. Kept is (mathematics: section 5)

    ω(δ₁, δ₂) = ⟨δ₂μ, η₁⟩ − ⟨δ₁μ, η₂⟩ + ⟨μ, [η₁, η₂]⟩ + ⟨δ₂π, w₁⟩ − ⟨δ₁π, w₂⟩ + ⟨π, η₁·w₂ − η₂·w₁⟩,

η = g⁻¹δg, w = g⁻¹δq = δn + η·n, a₀ fixed.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.audit.stepper import AuditStepper, distance
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

SEED = 20260117
SPREAD = 0.01
"""ε of the differences: their truncation, ε⁸, and the round-off in them, 1e-16/ε, are then both small."""

_WEIGHTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / SPREAD
_PLACES = np.array([-4, -3, -2, -1, 1, 2, 3, 4]) * SPREAD


class CurveTangent(NamedTuple):
    """A variation of a state at fixed a₀.

    eta, mu: (dim G,). w, pi: (ambient,).
    """

    eta: Array
    w: Array
    mu: Array
    pi: Array


def symplectic_defect(stepper: AuditStepper, h: float, pairs: int = 3) -> float:
    """|ω after − ω before| of a step relative to the sum of the sizes of their terms, the largest of random pairs."""
    system, state = stepper.system, stepper.begin(h)
    before = _curves(system, state, 2 * pairs)
    after = _stack([_stack([stepper.run(one, h, 1).final for one in _rows(curve)]) for curve in _rows(before)])
    (first, size), (last, other) = (
        _forms(system, at, curves) for at, curves in ((state, before), (stepper.run(state, h, 1).final, after))
    )
    return float(np.max(np.abs(last - first) / (size + other)))


def irreversibility(stepper: AuditStepper, h: float, steps: int = 10) -> float:
    """The distance from the start after `steps` steps of h and as many of −h."""
    begun = stepper.begin(h)
    there = stepper.run(begun, h, 1, steps).final
    return distance(stepper.run(there, -h, 1, steps).final, begun)


def _curves(system: System, state: State, count: int) -> State:
    """States along random curves through `state`, (curve, place of the differences, ...)."""
    group, Q, V = system.places
    random = np.random.default_rng(SEED)
    sizes = group.dim, Q.dim(group), group.dim, Q.ambient(group)
    ways = tuple(random.normal(size=(count, size)) for size in sizes)

    def at(state: State, way: tuple[Array, ...], eps: Array) -> State:
        eta, y, mu, pi = (eps * part for part in way)
        g = group.compose(state.g, group.exp(eta))
        back = group.inverse(group.exp(eta))
        moved = state.n + Q.difference(group, state.n, Q.tangent(group, state.n, y))
        n = Q.act(group, back, moved)
        b = Q.project(group, n, state.pi + pi)
        return state.replace(g=g, n=n, a=V.act(group, back, state.a), mu=state.mu + mu, pi=b)

    along = jax.vmap(jax.vmap(at, in_axes=(None, None, 0)), in_axes=(None, 0, None))
    return evaluate(along, state, ways, _PLACES)


def _forms(system: System, state: State, curves: State) -> tuple[Array, Array]:
    """ω at a state of the tangents of pairs of curves through it, and the sums of the sizes of its terms."""
    group, Q, _ = system.places

    def tangent(state: State, curve: State) -> CurveTangent:
        def slope(rows):
            return jnp.tensordot(_WEIGHTS, rows, 1)

        turned = slope(jax.vmap(group.matrix)(curve.g))
        eta = group.vee(jnp.linalg.solve(group.matrix(state.g), turned))
        return CurveTangent(
            eta, slope(curve.n) + Q.infinitesimal(group, eta, state.n), slope(curve.mu), slope(curve.pi)
        )

    def form(state: State, one: State, other: State):
        d1, d2 = tangent(state, one), tangent(state, other)
        turned = Q.lifted(group, d1.eta, state.n, d2.w) - Q.lifted(group, d2.eta, state.n, d1.w)
        on_group = [d2.mu @ d1.eta, -d1.mu @ d2.eta, state.mu @ group.ad(d1.eta, d2.eta)]
        terms = jnp.stack([*on_group, d2.pi @ d1.w, -d1.pi @ d2.w, state.pi @ turned])
        return jnp.sum(terms), jnp.sum(jnp.abs(terms))

    one, other = (jax.tree.map(lambda leaf, i=i: leaf[i::2], curves) for i in range(2))
    return evaluate(jax.vmap(form, in_axes=(None, 0, 0)), state, one, other)


def _rows(states: State) -> list[State]:
    return [jax.tree.map(lambda leaf, i=i: leaf[i], states) for i in range(len(states.t))]


def _stack(states: list[State]) -> State:
    return jax.tree.map(lambda *leaves: np.stack(leaves), *states)
