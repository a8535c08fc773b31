"""Rows (P1)–(P31): the continuous Euler–Poincaré equations, against Euler–Lagrange's on matrices before reduction."""

from __future__ import annotations

from functools import partial

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from explicit import carry, hat, lift, move, random_system, turn, vee
from motions import brackets, by_hamiltonian, momenta, placed, rates
from theorem_row import Rows, off, off_each

from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous, noether
from systems import generator

ROWS = Rows("every Q and V\\*")
row = ROWS.add

GROUPS = ("SO3", "SE2", "SL2", "SE3", "SO3xSE2")
PLACES = (*GROUPS, "SL2 on the half plane")
FAMILY = "theory/test_continuous_equivalence.py::test_the_variation_of_the_action_is_the_euler_poincare_equations"
CONTINUOUS = "mechanics/test_continuous.py::"
ACTIONS = "spaces/test_actions.py::"
DIAMOND = ACTIONS + "test_diamond_is_minus_the_transpose_of_the_infinitesimal_action"
REDUCTION = "theory/test_continuous_reduction.py::test_reduction_undoes_the_inverse"
FIELD = "mechanics.continuous.vector_field"


def along_motion(parts: str, names=PLACES):
    """How far the vector field is from Euler–Lagrange's motion."""
    for name in names:
        system, state = random_system(name, parts)

        def sides(state, system=system):
            return rates(system, state, continuous.vector_field(system, state))

        found, expected, change, force = evaluate(sides, state)
        kept = [pair for pair in zip(found, expected, strict=True) if np.size(pair[1])]
        yield off(change, force)
        yield off_each(*zip(*kept, strict=True))


def pointwise(names=PLACES, kinds=(0, 1)):
    """Every space of the random systems with a covector, a point, a velocity and an element of 𝔤."""
    for name in names:
        system, _ = random_system(name)
        for kind in kinds:
            space, random = system.places[1 + kind], generator("pointwise", name, kind)
            b, x, v = random.normal(size=(3, space.ambient(system.group)))
            x = x if space.affine else space.sample(system.group, random)
            yield system.group, space, b, x, v, random.normal(size=system.group.dim)


def transposed(group, function):
    """The covector ξ ↦ −function(ξ)."""
    return -jax.vmap(function)(jnp.eye(group.dim))


def before_reduction(name: str, parts: str):
    """L(g, ġ, q, q̇, a₀) reduced by the library against ℓ, and ℓ unreduced against L of matrices (P10), (P15)–(P17)."""
    system, s = random_system(name, parts)
    group, Q, V = system.places

    def by_matrices(g, g_dot, *rest):
        q, q_dot, a0 = rest if rest else (jnp.zeros(0),) * 3
        G, G_dot = jax.jvp(group.matrix, (g,), (g_dot,))
        return explicit.continuous(system)(G, G_dot, q, q_dot, a0)

    def with_all(g, g_dot, q, q_dot, a0):
        return by_matrices(g, g_dot, q, q_dot, a0)

    def alone(g, g_dot):
        return by_matrices(g, g_dot)

    spaces = {"additional": Q, "advected": V} if parts else {}
    given = theory.ContinuousLagrangian(group, with_all if parts else alone, **spaces)
    reduced, again = theory.reduce_continuous(given), theory.unreduce_continuous(system)

    def sides(s):
        G, q, q_dot, a0 = placed(system, s)
        g_dot = jax.jvp(lambda e: group.compose(s.g, e), (group.identity(),), (group.tangent(s.xi),))[1]
        above = again(theory.Configuration(s.g, q), theory.Configuration(g_dot, q_dot), a0, theory.Instant(0.0))
        below = explicit.continuous(system)(G, G @ hat(group, s.xi), q, q_dot, a0)
        here = explicit.lagrangian(system, s.xi, s.n, s.nu, s.a)
        return (reduced.reduced_lagrangian(s.xi, s.n, s.nu, s.a), above), (here, below)

    yield off_each(*evaluate(sides, s))


@row(
    "(P1)–(P2)",
    "a left-invariant Lagrangian is a function of the body velocity",
    (
        "mechanics.system.System.state",
        "mechanics.system.System.reduced_lagrangian",
        "theory.continuous.reduce_continuous",
        "theory.continuous.unreduce_continuous",
    ),
    (FAMILY, REDUCTION),
    domain="every G",
)
def invariance():
    for name in ("SO3", "SE3", "SL2", "SO4"):
        yield from before_reduction(name, "")
        system, start = random_system(name, "")
        group = system.group
        h = evaluate(lambda eta, group=group: group.exp(eta), generator("moved", name).normal(size=group.dim))
        for g in (start.g, evaluate(lambda h, g, group=group: group.compose(h, g), h, start.g)):
            state = system.state(g=g, xi=start.xi)
            found = evaluate(lambda s, system=system: system.reduced_lagrangian(s.xi, s.n, s.nu, s.a), state)

            def unreduced(g, xi, nothing, system=system):
                G = system.group.matrix(g)
                return explicit.continuous(system)(G, G @ hat(system.group, xi), nothing, nothing, nothing)

            yield off((state.g, state.xi), (g, start.xi))
            yield off(found, evaluate(unreduced, g, start.xi, np.zeros(0)))


@row(
    "(P3)–(P5)",
    "basic Euler–Poincaré equation μ̇ = ad\\*\\_ξμ; ad and its dual",
    (FIELD, "groups.group.LieGroup.ad", "groups.group.LieGroup.ad_dual"),
    (FAMILY, "groups/test_group_axioms.py::test_duals_pair_as_they_must"),
    domain="every G",
)
def basic_euler_poincare():
    yield from along_motion("", GROUPS)
    for name in (*GROUPS, "Heisenberg", "SO4"):
        group = explicit.GROUPS[name]
        xi, eta, mu = generator("bracket", name).normal(size=(3, group.dim))

        def sides(xi, eta, mu, group=group):
            expected = explicit.bracket(group, xi, eta), explicit.ad_dual(group, xi, mu)
            return (group.ad(xi, eta), group.ad_dual(xi, mu)), expected

        yield off_each(*evaluate(sides, xi, eta, mu))


@row(
    "(P6)–(P9)",
    "Lie–Poisson form, reduced Legendre transform, ∂ℋ/∂μ = ξ",
    (
        "mechanics.poisson.vector_field",
        "mechanics.poisson.poisson_bracket",
        "mechanics.legendre.lagrangian",
        "mechanics.legendre.momenta",
        "mechanics.continuous.energy",
        "mechanics.continuous.velocities",
    ),
    (
        "mechanics/test_poisson.py::test_the_vector_field_of_the_energy_is_the_motion",
        CONTINUOUS + "test_gradients_of_the_reduced_hamiltonian",
    ),
    domain="flat or smooth Q, every V\\*",
)
def legendre():
    for name, parts in (("SO3", ""), ("SE2", "na"), ("SL2", "na"), (PLACES[-1], "na")):
        system, state = random_system(name, parts)
        mu, pi = evaluate(partial(momenta, system), state)
        state = state.replace(mu=mu, pi=pi)
        value = evaluate(lambda s, y=system: explicit.lagrangian(y, s.xi, s.n, s.nu, s.a), state)
        legendre = mu @ state.xi + pi @ state.nu - value
        yield off(evaluate(partial(continuous.energy, system), state), legendre)
        near = state.replace(xi=1.01 * state.xi, nu=1.01 * state.nu)
        yield off(evaluate(partial(continuous.velocities, system), near), (state.xi, state.nu))
        yield from brackets(system, state)
        yield from by_hamiltonian(system, state, legendre)


@row(
    "[Theorem 1](theorems/euler-poincare.md), (P10)–(P14)",
    "Euler–Poincaré equations with advected parameters",
    (FIELD, "spaces.space.Space.diamond"),
    (FAMILY, DIAMOND),
    domain="every V\\*",
)
def theorem_1():
    yield from along_motion("a")
    for group, space, b, x, _, _ in pointwise(kinds=(1,)):

        def sides(b, x, group=group, space=space):
            return space.diamond(group, b, x), transposed(group, lambda xi: b @ turn(space, group, xi, x))

        yield off(*evaluate(sides, b, x))


@row(
    "(P15)–(P19)",
    "reduction on G × Q with parameters; variations; the infinitesimal action",
    (
        "mechanics.system.System.state",
        "mechanics.system.System.reduced_lagrangian",
        "theory.continuous.reduce_continuous",
        "theory.continuous.unreduce_continuous",
        "spaces.space.Space.infinitesimal",
        "spaces.space.Space.lifted",
        "groups.group.LieGroup.ad",
    ),
    (FAMILY, ACTIONS + "test_infinitesimal_action_is_the_derivative_along_the_exponential"),
)
def reduction():
    for name in PLACES:
        yield from before_reduction(name, "na")
        system, start = random_system(name)
        group, Q, _ = system.places
        G, q, q_dot, a0 = evaluate(partial(placed, system), start)
        state = system.state(g=start.g, q=q, qdot=q_dot, xi=start.xi, a0=a0)
        yield off((state.g, state.n, state.nu, state.a), (start.g, start.n, start.nu, start.a))
        found = evaluate(lambda s, system=system: system.reduced_lagrangian(s.xi, s.n, s.nu, s.a), state)
        yield off(
            found, evaluate(explicit.continuous(system), G, G @ evaluate(partial(hat, group), start.xi), q, q_dot, a0)
        )
        random = generator("variation", name)
        eta, eta_dot = random.normal(size=(2, group.dim))
        w, w_dot = random.normal(size=(2, Q.ambient(group)))
        yield off_each(*evaluate(partial(variations, system), state, G, q, q_dot, a0, eta, eta_dot, w, w_dot))


def variations(system, state, G, q, q_dot, a0, eta, eta_dot, w, w_dot):
    """(P18), (P19) by the library, and by differentiation of curves of matrices with g⁻¹δg = η, g⁻¹δq = w."""
    group, Q, V = system.places
    X, one = hat(group, state.xi), jnp.eye(group.matrix_size)

    def curve(t, e):
        g = G @ (one + t * X + 0.5 * t**2 * X @ X)
        x = q + t * q_dot
        moved = carry(Q, group, g, move(Q, group, jnp.linalg.inv(g), x), w + t * w_dot)
        return g @ (one + e * hat(group, eta + t * eta_dot)), x + e * moved

    def body(e):
        (g, x), (g_dot, v) = jax.jvp(lambda t: curve(t, e), (0.0,), (1.0,))
        back = jnp.linalg.inv(g)
        nu = carry(Q, group, back, x, v)
        return vee(group, back @ g_dot), move(Q, group, back, x), nu, move(V, group, back, a0)

    expected = jax.jvp(body, (0.0,), (1.0,))[1]
    xi, n, nu, a = state.xi, state.n, state.nu, state.a
    found = (
        eta_dot + group.ad(xi, eta),
        w - Q.infinitesimal(group, eta, n),
        w_dot + Q.lifted(group, xi, n, w) - Q.lifted(group, eta, n, nu),
        -V.infinitesimal(group, eta, a),
    )
    return found, expected


@row(
    "(P20)–(P24)",
    "Euler–Poincaré equations with advected parameters and additional dynamics",
    (
        FIELD,
        "spaces.space.Space.lifted_diamond",
        "spaces.space.Space.diamond",
        "spaces.space.Space.infinitesimal",
        "spaces.space.Space.lifted",
    ),
    (FAMILY, CONTINUOUS + "test_accelerations_move_the_legendre_momenta_as_the_equations_say"),
    domain="flat or smooth Q, every V\\*",
)
def with_additional_dynamics():
    yield from along_motion("na")
    yield from along_motion("n", ("SO3", "SE2"))
    for group, space, b, x, v, _ in pointwise(kinds=(0,)):

        def sides(b, x, v, group=group, space=space):
            expected = transposed(group, lambda xi: b @ lift(space, group, xi, x, v))
            return space.lifted_diamond(group, b, x, v), expected

        yield off(*evaluate(sides, b, x, v))


@row(
    "[Theorem 2](theorems/kelvin-noether.md), (P25)–(P31)",
    "Kelvin–Noether: dI/dt = ⟨𝒦, ∂_aℓ⋄a⟩",
    (
        "mechanics.noether.KelvinNoether.quantity",
        "mechanics.noether.KelvinNoether.momentum_map",
        "mechanics.noether.total_momentum",
        "mechanics.noether.spatial_momentum",
    ),
    (
        CONTINUOUS + "test_theorem_2_holds_at_every_state",
        CONTINUOUS + "test_theorem_2_and_energy_along_an_exact_solution",
    ),
)
def theorem_2():
    for name in PLACES:
        system, state = random_system(name)
        group = system.group
        c0 = generator("kelvin", name).normal(size=group.dim)
        yield off_each(*evaluate(partial(kelvin, system, noether.KelvinNoether(c0), c0), state))


def kelvin(system, quantities, c0, state):
    """I and its rate along the motion by the library, and ⟨c, m⟩ and ⟨c, ∂_aℓ⋄a⟩ for 𝒦 = c = Ad_{g⁻¹}c₀."""
    group, Q, V = system.places
    mu, pi = momenta(system, state)
    state = state.replace(mu=mu, pi=pi)
    G, _, _, _ = placed(system, state)
    c = explicit.Ad(group, jnp.linalg.inv(G), c0)
    orbital = transposed(group, lambda xi: pi @ turn(Q, group, xi, state.n))
    slope = continuous.vector_field(system, state)
    names = ("g", "n", "a", "mu", "pi", "xi", "nu")

    def moving(*values):
        moved = state.replace(**dict(zip(names, values, strict=True)))
        return quantities.quantity(system, moved), c0 @ noether.spatial_momentum(system, moved)

    values, rates = ([getattr(s, name) for name in names] for s in (state, slope))
    (quantity, _), (rate, same) = jax.jvp(moving, values, rates)
    along_a = jax.grad(lambda a: explicit.lagrangian(system, state.xi, state.n, state.nu, a))(state.a)
    source = -along_a @ turn(V, group, c, state.a)
    found = quantities.momentum_map(system, state), noether.total_momentum(system, state), quantity, rate, same
    return found, (c, mu - orbital, c @ (mu - orbital), source, source)
