"""What a motion must be by Euler–Lagrange's equations on matrices, by ℓ and by ℋ."""

from __future__ import annotations

from functools import partial

import explicit
import jax
import jax.numpy as jnp
from explicit import carry, hat, move, turn
from theorem_row import off

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous, poisson
from systems import generator


def placed(system, state):
    """G, q, q̇ and a₀ of a state by matrices."""
    group, Q, V = system.places
    G = group.matrix(state.g)
    return G, move(Q, group, G, state.n), carry(Q, group, G, state.n, state.nu), move(V, group, G, state.a)


def momenta(system, state):
    """(∂_ξℓ, ∂_νℓ)."""
    value = partial(explicit.lagrangian, system)
    return jax.grad(value, argnums=(0, 2))(state.xi, state.n, state.nu, state.a)


def rates(system, state, slope):
    """The rates of a vector field against those of a curve with its accelerations, Euler–Lagrange's terms last."""
    group, Q, V = system.places
    G, q, q_dot, a0 = placed(system, state)
    xi, n, nu, a = state.xi, state.n, state.nu, state.a
    n_dot, a_dot = nu - turn(Q, group, xi, n), -turn(V, group, xi, a)
    moving = G @ hat(group, xi), n_dot, slope.nu
    q_ddot = jax.jvp(lambda *parts: carry(Q, group, *parts), (G, n, nu), moving)[1]
    change, force = explicit.euler_lagrange(system, G, xi, slope.xi, q, q_dot, q_ddot, a0)

    def along(t):
        later = (x + t * v for x, v in ((xi, slope.xi), (n, n_dot), (nu, slope.nu), (a, a_dot)))
        return jax.grad(partial(explicit.lagrangian, system), argnums=(0, 2))(*later)

    mu_dot, pi_dot = jax.jvp(along, (0.0,), (1.0,))[1]
    g_dot = jax.jvp(group.matrix, (state.g,), (slope.g,))[1]
    return (
        (g_dot, slope.n, slope.a, slope.mu, slope.pi),
        (G @ hat(group, xi), n_dot, a_dot, mu_dot, pi_dot),
        change,
        force,
    )


def brackets(system, state):
    """The Hamiltonian field of the energy, and {f, ℋ} of a random f, along Euler–Lagrange's motion."""
    f = generator("bracket", system.name).normal(size=sum(map(len, (state.mu, state.n, state.pi, state.a))))

    def number(s):
        at = jnp.concatenate([s.mu, s.n, s.pi, s.a])
        return f @ at + 0.5 * (f @ at) ** 2

    def sides(s):
        slope = continuous.vector_field(system, s)
        _, (_, n, a, mu, pi), _, _ = rates(system, s, slope)
        field = poisson.vector_field(lambda s: continuous.energy(system, s), s)
        at, rate = jnp.concatenate([s.mu, s.n, s.pi, s.a]), jnp.concatenate([mu, n, pi, a])
        return tuple(field), (mu, n, pi, a), (1 + f @ at) * (f @ rate)

    found, expected, change = evaluate(sides, state)
    yield off(found, expected)

    def energy(s):
        return continuous.energy(system, s.replace(xi=state.xi, nu=state.nu))

    yield off(poisson.poisson_bracket(number, energy)(state), change)


def by_hamiltonian(system, state, value):
    """ℓ of ℋ := E with the momenta solved for, at μ = ∂_ξℓ: ℓ itself; here with ℋ(μ, π) that of a random function."""
    group, Q, V = system.places
    has_q, has_a = Q.ambient(group) > 0, V.ambient(group) > 0

    def hamiltonian(mu, *rest):
        n, pi = rest[:2] if has_q else (jnp.zeros(0), jnp.zeros(0))
        return explicit.lagrangian(system, mu, n, pi, rest[-2] if has_a else jnp.zeros(0))

    spaces = {"additional": Q if has_q else None, "advected": V if has_a else None}
    given = co.System(group, hamiltonian=hamiltonian, parameters=system.parameters, **spaces)

    def sides(s):
        xi, nu = momenta(system, s)
        slope = jax.grad(given.reduced_lagrangian, argnums=(0, 2))(xi, s.n, nu, s.a)
        return given.reduced_lagrangian(xi, s.n, nu, s.a), slope

    found, slope = evaluate(sides, state)
    yield off(found, value)
    yield off(slope, (state.xi, state.nu))
