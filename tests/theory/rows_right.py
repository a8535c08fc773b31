"""Rows on right-invariant systems, ξ = ġg⁻¹, n = gq, a = ga₀: against derivatives of L on matrices before reduction."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from explicit import H, hat, inverse, move, turn, vee
from motions import momenta
from rows_continuous import transposed
from sequences import SOLVED, at
from theorem_row import Rows, off, off_each

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous, noether
from coadjoint.theory import euler_poincare
from discrete import velocity
from systems import element, generator, system_on

ROWS = Rows("flat or curved Q and V\\*")
row = ROWS.add

RIGHT = "mechanics/test_right_invariance.py::"
WRITTEN_OUT = RIGHT + "test_a_run_follows_the_right_invariant_equations_written_out_in_matrices"
STAYS = RIGHT + "test_the_momentum_in_the_body_stays_where_no_parameter_takes_part"
PRINTED = RIGHT + "test_printed_equations_hold_along_a_right_invariant_run"
SPACES = tuple(
    f"spaces.by_inverse.ByInverse.{name}" for name in ("diamond", "lifted_diamond", "infinitesimal", "lifted")
)
WORLDS: dict[str, tuple[co.groups.LieGroup, Any, Any]] = {
    "SO3": (co.SO3(), co.Defining(), co.Defining()),
    "SE2": (co.SE2(), co.spaces.Points(), co.spaces.Adjoint()),
    "SL2": (co.groups.SLn(2), co.spaces.Dual(), co.Coadjoint()),
}


@lru_cache(maxsize=8)
def both(name: str) -> tuple[co.System, co.State, co.System]:
    """A random ℓ on a group, with numbers to take it at, and the right-invariant system of the same ℓ."""
    group, Q, V = WORLDS[name]
    system, state = system_on(group, Q, V, False, f"right {name}")
    ours = co.System(group, partial(explicit.lagrangian, system), additional=Q, advected=V, invariance="right")
    return system, state, ours


def before_reduction(system: co.System):
    """L(G, Ġ, q, q̇, a₀) = ℓ((ĠG⁻¹)ᵛ, Gq, Gq̇, Ga₀)."""
    group, Q, V = system.places

    def L(G, G_dot, q, q_dot, a0):
        n, nu = move(Q, group, G, q), move(Q, group, G, q_dot, velocity=True)
        return explicit.lagrangian(system, vee(group, G_dot @ inverse(G)), n, nu, move(V, group, G, a0))

    return L


def euler_lagrange(system: co.System, G, xi, xi_dot, q, q_dot, q_ddot, a0):
    """d/dt ∂L/∂ċ and ∂L/∂c along (ê_iG, 0) and (0, e_j) on the curve (1 + tX + ½t²(X² + Ẋ))G."""
    group, L = system.group, before_reduction(system)
    X, X_dot = hat(group, xi), hat(group, xi_dot)

    def curve(t):
        g = (jnp.eye(group.matrix_size) + t * X + 0.5 * t**2 * (X @ X + X_dot)) @ G
        return g, (X + t * (X @ X + X_dot)) @ G, q + t * q_dot + 0.5 * t**2 * q_ddot, q_dot + t * q_ddot

    def along(eta, w):
        Y = hat(group, eta)

        def momentum(t):
            g, g_dot, x, v = curve(t)
            return jax.jvp(lambda d, v: L(g, d, x, v, a0), (g_dot, v), (Y @ g, w))[1]

        g, g_dot, x, v = curve(0.0)
        force = jax.jvp(lambda *c: L(*c, v, a0), (g, g_dot, x), (Y @ g, Y @ g_dot, w))[1]
        return jax.jvp(momentum, (0.0,), (1.0,))[1], force

    ways = jnp.eye(group.dim + len(q))
    return jax.vmap(along)(ways[:, : group.dim], ways[:, group.dim :])


@row(
    "(P20)–(P24), right-invariant",
    "Euler–Poincaré equations with ξ = ġg⁻¹: every name in the right frame",
    ("mechanics.continuous.vector_field", "groups.Opposite.ad_dual", *SPACES),
    (WRITTEN_OUT,),
)
def euler_poincare_equations():
    for name in WORLDS:
        system, state, ours = both(name)
        group, Q, V = system.places

        def sides(s, system=system, ours=ours, group=group, Q=Q, V=V):
            slope = continuous.vector_field(ours, s)
            G = group.matrix(s.g)
            back = inverse(G)
            q, q_dot, a0 = (
                move(Q, group, back, s.n),
                move(Q, group, back, s.nu, velocity=True),
                move(V, group, back, s.a),
            )
            q_ddot = move(Q, group, back, slope.nu - turn(Q, group, s.xi, s.nu, velocity=True), velocity=True)
            change, force = euler_lagrange(system, G, s.xi, slope.xi, q, q_dot, q_ddot, a0)
            n_dot, a_dot = s.nu + turn(Q, group, s.xi, s.n), turn(V, group, s.xi, s.a)

            def along(t):
                later = (x + t * v for x, v in ((s.xi, slope.xi), (s.n, n_dot), (s.nu, slope.nu), (s.a, a_dot)))
                return jax.grad(partial(explicit.lagrangian, system), argnums=(0, 2))(*later)

            rates = jax.jvp(along, (0.0,), (1.0,))[1]
            g_dot = jax.jvp(group.matrix, (s.g,), (slope.g,))[1]
            found = g_dot, slope.n, slope.a, slope.mu, slope.pi
            return found, (hat(group, s.xi) @ G, n_dot, a_dot, *rates), change, force

        found, expected, change, force = evaluate(sides, state)
        yield off(change, force)
        yield off_each(found, expected)


@row(
    "[Theorem 2](theorems/kelvin-noether.md), right-invariant",
    "Kelvin–Noether: 𝒦 = Ad_g c₀, and the momentum in the body, Ad\\*\\_g(μ + π⋄n)",
    (
        "mechanics.noether.KelvinNoether.momentum_map",
        "mechanics.noether.total_momentum",
        "mechanics.noether.spatial_momentum",
        "groups.Opposite.Ad_dual",
    ),
    (STAYS,),
)
def theorem_2():
    for name in WORLDS:
        system, state, ours = both(name)
        group, Q, _ = system.places
        c0 = generator("kelvin on the right", name).normal(size=group.dim)

        def sides(s, system=system, ours=ours, group=group, Q=Q, c0=c0):
            mu, pi = momenta(system, s)
            G = group.matrix(s.g)
            total = mu + transposed(group, lambda xi: pi @ turn(Q, group, xi, s.n))
            s = s.replace(mu=mu, pi=pi)
            found = (
                noether.KelvinNoether(c0).momentum_map(ours, s),
                noether.total_momentum(ours, s),
                noether.spatial_momentum(ours, s),
            )
            return found, (explicit.Ad(group, G, c0), total, explicit.Ad_dual(group, G, total))

        yield off_each(*evaluate(sides, state))


def of_pair(system: co.System):
    """L(G, q, G⁺, q⁺, a₀) = h ℓ((F − F⁻¹)ᵛ/2h, n, (s − n)/h, a), F = G⁺G⁻¹, n = Gq, s = Gq⁺, a = Ga₀."""
    group, Q, V = system.places

    def L(G, q, G_next, q_next, a0):
        F, n, s = G_next @ inverse(G), move(Q, group, G, q), move(Q, group, G, q_next)
        return explicit.of_step(system, F, n, s, move(V, group, G, a0))

    return L


def legendre(system: co.System, G, q, G_next, q_next, a0):
    """(μ_k, π_k, μ_{k+1}, π_{k+1}): the derivatives of L along (1 + εη̂)G and q + εG⁻¹w at the ends of a step."""
    group, Q, _ = system.places
    L, one = of_pair(system), jnp.eye(group.matrix_size)

    def moved(eta, w, eta_next, w_next):
        first = (one + hat(group, eta)) @ G, q + move(Q, group, inverse(G), w, velocity=True)
        back = move(Q, group, inverse(G_next), w_next, velocity=True)
        return L(*first, (one + hat(group, eta_next)) @ G_next, q_next + back, a0)

    still = jnp.zeros(group.dim), jnp.zeros(len(q))
    mu, pi, mu_next, pi_next = jax.grad(moved, argnums=(0, 1, 2, 3))(*still, *still)
    return -mu, -pi, mu_next, pi_next


@lru_cache(maxsize=8)
def in_group_form(name: str) -> co.System:
    """Λ(F, n, s, a; h) of the same ℓ, right-invariant."""
    system = both(name)[0]
    group, Q, V = WORLDS[name]

    def group_lagrangian(F, n, s, a, h):
        return h * explicit.lagrangian(system, velocity(group, F, h), n, (s - n) / h, a)

    return co.System(group, group_lagrangian=group_lagrangian, additional=Q, advected=V, invariance="right")


def sequence(name: str, nodes: int = 4, spread: float = 0.35) -> tuple[Any, ...]:
    """Matrices, points of Q and a₀ that no equation ties together, with the links of their steps."""
    system = both(name)[0]
    group, Q, V = system.places
    random = generator("sequence on the right", name)
    elements = [element(group, random, spread) for _ in range(nodes)]
    G = evaluate(jax.vmap(group.matrix), jax.tree.map(lambda *leaves: np.stack(leaves), *elements))
    q, a0 = spread * random.normal(size=(nodes, Q.ambient(group))), random.normal(size=V.ambient(group))

    def made(G, q, a0):
        F = jax.vmap(group.from_matrix)(G[1:] @ jax.vmap(inverse)(G[:-1]))
        n, s = (jax.vmap(lambda G, x: move(Q, group, G, x))(G[:-1], x) for x in (q[:-1], q[1:]))
        return F, n, s, jax.vmap(lambda G: move(V, group, G, a0))(G[:-1])

    return G, q, a0, theory.Link(*evaluate(made, G, q, a0))


@row(
    "[Theorem 6](theorems/discrete-euler-poincare.md), right-invariant",
    "discrete Euler–Poincaré equations with F = g_{k+1}g_k⁻¹",
    (
        "theory.euler_poincare.discrete_euler_poincare",
        "theory.euler_poincare.left_momenta",
        "theory.euler_poincare.right_momenta",
        "spaces.by_inverse.ByInverse.pull",
    ),
    (PRINTED,),
)
def theorem_6():
    for name in WORLDS:
        system, ours = both(name)[0], in_group_form(name)
        G, q, a0, links = sequence(name)
        ends = [(G[k], q[k], G[k + 1], q[k + 1]) for k in (0, 1)]
        before, here = (evaluate(partial(legendre, system), *end, a0) for end in ends)

        def library(first, second, ours=ours):
            momenta = euler_poincare.left_momenta(ours, second, H), euler_poincare.right_momenta(ours, first, H)
            return *momenta, theory.discrete_euler_poincare(ours, first, second, H)

        found = evaluate(library, at(links, 0), at(links, 1))
        yield off_each(tuple(tuple(pair) for pair in found),
                       (here[:2], before[2:], (here[0] - before[2], here[1] - before[3])))  # fmt: skip


@row(
    "[Theorem 7](theorems/kelvin-noether.md), right-invariant",
    "discrete Kelvin–Noether theorem along what the algorithm of Theorem 6 returns",
    ("theory.euler_poincare.discrete_euler_poincare_algorithm", "spaces.by_inverse.ByInverse.act"),
    (STAYS,),
    bound=SOLVED,
)
def theorem_7():
    """I_{k+1} − I_k = ⟨𝒦, ∂_aΛ⋄a⟩: I is the momentum map of δg = gη̂, and L changes along it by its part in a₀ alone."""
    for name in WORLDS:
        system, ours = both(name)[0], in_group_form(name)
        group, Q, V = system.places
        _, _, _, links = sequence(name, spread=0.05)
        path = theory.discrete_euler_poincare_algorithm(ours, at(links, 0), H, 4)
        Fs = evaluate(jax.vmap(group.matrix), path.F)
        G = [np.eye(group.matrix_size)]
        for F in Fs:
            G.append(F @ G[-1])
        G = np.stack(G)
        frames, points = np.stack([*G[:-1], G[-2]]), np.concatenate([path.n, path.s[-1:]])
        q = evaluate(jax.vmap(lambda G, x, group=group, Q=Q: move(Q, group, inverse(G), x)), frames, points)
        a0 = path.a[0]  # as g₀ = e
        c0 = np.cos(np.arange(float(group.dim)))

        def ends(G, q, G_next, q_next, a0, system=system, group=group, Q=Q, V=V, c0=c0):
            """⟨J⁻, c₀⟩, ⟨J⁺, c₀⟩ and the change of L with a₀, along δ(g, q) = (−gĉ₀, ĉ₀·q)."""
            L, C = of_pair(system), hat(group, c0)

            def moved(e, ahead, of_a):
                one = jnp.eye(group.matrix_size)
                first = G @ (one - e * C), q + e * turn(Q, group, c0, q)
                second = G_next @ (one - ahead * C), q_next + ahead * turn(Q, group, c0, q_next)
                return L(*first, *second, a0 + of_a * turn(V, group, c0, a0))

            minus, plus, source = jax.grad(moved, argnums=(0, 1, 2))(0.0, 0.0, 0.0)
            return -minus, plus, source

        minus, plus, source = evaluate(jax.vmap(ends, in_axes=(0, 0, 0, 0, None)), G[:-1], q[:-1], G[1:], q[1:], a0)
        yield off(plus - minus, -source, minus)  # L does not change where a₀ moves along
        yield off(minus[1:], plus[:-1])
