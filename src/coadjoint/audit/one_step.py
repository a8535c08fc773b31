"""What one step keeps: the two-form, and the way back.

Two curves ε ↦ (g, q, μ, π) with tangents δ₁, δ₂ go through a step as they are, by the kernel that runs it; the tangents
before and after are central differences of order 8 in ε. Kept is (mathematics: section 5)

    ω(δ₁, δ₂) = ⟨δ₂μ, η₁⟩ − ⟨δ₁μ, η₂⟩ + ⟨μ, [η₁, η₂]⟩ + ⟨δ₂π, w₁⟩ − ⟨δ₁π, w₂⟩ + ⟨π, η₁·w₂ − η₂·w₁⟩,

η = g⁻¹δg, w = g⁻¹δq = δn + η·n, a₀ fixed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.audit.stepper import Stepper, distance
from coadjoint.groups.group import Array
from coadjoint.kernels.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

SEED = 20260117
SPREAD = 0.01
"""ε of the differences: their truncation, ε⁸, and the round-off in them, 1e-16/ε, are then both small."""

_WEIGHTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 4 / 5, -1 / 5, 4 / 105, -1 / 280]) / SPREAD
_PLACES = np.array([-4, -3, -2, -1, 1, 2, 3, 4]) * SPREAD


class Tangent(NamedTuple):
    """A variation of a state at fixed a₀."""

    eta: Array
    w: Array
    mu: Array
    pi: Array


def symplectic_defect(stepper: Stepper, h: float, pairs: int = 3) -> float:
    """|ω after − ω before| of a step relative to the sum of the sizes of their terms, the largest of random pairs."""
    random = np.random.default_rng(SEED)
    system, state = stepper.system, stepper.begin(h)
    worst = 0.0
    for _ in range(pairs):
        before = [_curve(system, state, random) for _ in range(2)]
        after = [_stack([stepper.run(one, h, 1).final for one in _rows(curve)]) for curve in before]
        end = stepper.run(state, h, 1).final
        (first, size), (last, other) = (_form(system)(s, *c) for s, c in ((state, before), (end, after)))
        worst = max(worst, abs(float(last - first)) / float(size + other))
    return worst


def irreversibility(stepper: Stepper, h: float, steps: int = 10) -> float:
    """The distance from the start after `steps` steps of h and as many of −h."""
    begun = stepper.begin(h)
    there = stepper.run(begun, h, 1, steps).final
    return distance(stepper.run(there, -h, 1, steps).final, begun)


def _curve(system: System, state: State, random: np.random.Generator) -> State:
    """States along a random curve through `state`, one at each place of the differences."""
    group, Q, V = system.places
    eta, mu = random.normal(size=(2, group.dim))
    y, pi = random.normal(size=(2, Q.dim(group))), random.normal(size=Q.ambient(group))

    def at(state: State, eps: Array) -> State:
        g = group.compose(state.g, group.exp(eps * eta))
        back = group.inverse(group.exp(eps * eta))
        moved = state.n + Q.difference(group, state.n, Q.tangent(group, state.n, eps * y[0]))
        n = Q.act(group, back, moved)
        b = Q.project(group, n, state.pi + eps * pi)
        return state.replace(g=g, n=n, a=V.act(group, back, state.a), mu=state.mu + eps * mu, pi=b)

    return evaluate(lambda s: jax.vmap(at, in_axes=(None, 0))(s, _PLACES), state)


def _form(system: System) -> Any:
    """ω at a state of the tangents of two curves through it, and the sum of the sizes of its terms."""
    group, Q, _ = system.places

    def tangent(state: State, curve: State) -> Tangent:
        def slope(rows):
            return jnp.tensordot(_WEIGHTS, rows, 1)

        turned = slope(jax.vmap(group.matrix)(curve.g))
        eta = group.vee(jnp.linalg.solve(group.matrix(state.g), turned))
        return Tangent(eta, slope(curve.n) + Q.infinitesimal(group, eta, state.n), slope(curve.mu), slope(curve.pi))

    def form(state: State, one: State, other: State):
        d1, d2 = tangent(state, one), tangent(state, other)
        turned = Q.lifted(group, d1.eta, state.n, d2.w) - Q.lifted(group, d2.eta, state.n, d1.w)
        on_group = [d2.mu @ d1.eta, -d1.mu @ d2.eta, state.mu @ group.ad(d1.eta, d2.eta)]
        terms = jnp.stack([*on_group, d2.pi @ d1.w, -d1.pi @ d2.w, state.pi @ turned])
        return jnp.sum(terms), jnp.sum(jnp.abs(terms))

    return lambda *values: evaluate(form, *values)


def _rows(states: State) -> list[State]:
    return [jax.tree.map(lambda leaf, i=i: leaf[i], states) for i in range(len(_PLACES))]


def _stack(states: list[State]) -> State:
    return jax.tree.map(lambda *leaves: np.stack(leaves), *states)
