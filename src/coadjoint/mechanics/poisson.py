"""The Hamiltonian side on 𝔤* × T*Q × V*: the reduced Poisson bracket and its vector fields (P6–P9)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import require_scalar
from coadjoint.spaces.space import require_flat, transpose

Function = Callable[[State], PyTree]
"""A number as a function of a state's μ, n, π, a."""


class Phase(NamedTuple):
    """μ, n, π, a, or their rates, or covectors on them.

    mu: (dim G,). n, pi: (ambient,). a: (dim V*,).
    """

    mu: Array
    n: Array
    pi: Array
    a: Array


def poisson_bracket(f: Function, k: Function) -> Function:
    """{f, k}, a function of a state again, so that brackets nest; ḟ = {f, ℋ} along the unforced motion.

    {f, k} = −⟨μ, [f_μ, k_μ]⟩ + ⟨f_n, k_π⟩ − ⟨k_n, f_π⟩ − ⟨f_n, k_μ·n⟩ + ⟨k_n, f_μ·n⟩
             + ⟨π, k_μ·f_π − f_μ·k_π⟩ − ⟨f_a, k_μ·a⟩ + ⟨k_a, f_μ·a⟩.

    f, k: functions of a state that return one number, by its mu, n, pi, a and places.
    Raises LagrangianError for other functions, ArgumentError for functions of g, q or velocities, and on a curved space
    of additional dynamics.
    """
    for given in (f, k):
        checks.function(given, "Each part of a Poisson bracket", "a function of a state")

    def value(state: State) -> Scalar:
        slope, rate = _slope(f, state), vector_field(k, state)
        return sum(b @ x for b, x in zip(slope, rate, strict=True))

    def bracket(state: State) -> Array:
        checks.instance(state, "The argument of a Poisson bracket", State, "a state, system.state(…)")
        for given in (f, k):
            require_scalar(given, "A function in a Poisson bracket", (state,))
            _require_phase(given, state)
        return evaluate(value, state)

    return bracket


def vector_field(k: Function, state: State) -> Phase:
    """The Hamiltonian vector field of k: with ξ = ∂_μk, ν = ∂_πk the equations (P20)–(P22), unforced.

    μ̇ = ad*_ξ μ − ∂_ak⋄a − ∂_nk⋄n + π⋄ν, ṅ = ν − ξ·n, π̇ = −∂_nk + L*_ξ π, ȧ = −ξ·a. Without n and a it is the
    Lie–Poisson equation μ̇ = ad*_{∂k/∂μ} μ.
    """
    group, Q, V = state.places
    require_flat(Q, "The Poisson bracket", "a curved space has no chart here")
    by = _slope(k, state)
    xi, nu, n, a = by.mu, by.pi, state.n, state.a
    turning = Q.lifted_diamond(group, state.pi, n, nu) - Q.diamond(group, by.n, n) - V.diamond(group, by.a, a)
    return Phase(
        mu=group.ad_dual(xi, state.mu) + turning,
        n=nu - Q.infinitesimal(group, xi, n),
        pi=transpose(lambda w: Q.lifted(group, xi, n, w), Q.ambient(group), state.pi) - by.n,
        a=-V.infinitesimal(group, xi, a),
    )


def _require_phase(f: Function, state: State) -> None:
    """Raise ArgumentError where f changes with g or the velocities, which the reduced bracket does not contain."""
    if traced(state) or not state.places.additional.flat:
        return
    others = {"g": state.g, "xi": state.xi, "nu": state.nu}
    slopes = evaluate(lambda others: jax.grad(lambda o: f(state.replace(**o)))(others), others)
    for name, slope in slopes.items():
        if any(np.any(np.asarray(leaf) != 0) for leaf in jax.tree.leaves(slope)):
            raise ArgumentError(
                f"A function in a Poisson bracket must depend on the state by mu, n, pi and a, but changes with "
                f"{name}: the bracket is that of the reduced space, and energies are functions of momenta there."
            )


def _slope(f: Function, state: State) -> Phase:
    """(f_μ, f_n, f_π, f_a)."""
    at = Phase(state.mu, state.n, state.pi, state.a)
    return jax.grad(lambda at: f(state.replace(**at._asdict())))(at)
