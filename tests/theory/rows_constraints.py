"""Rows on constraints: reactions against derivatives of ⟨λ, φ⟩ on matrices, steps between two states of T*N."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from explicit import H, hat, inverse, move, vee
from theorem_row import Rows, largest, off

import coadjoint as co
import pinned
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import noether, reactions
from coadjoint.methods.rattle import Rattle
from coadjoint.theory import constraints
from systems import generator, system_on
from two_form import carry, tangents

ROWS = Rows("flat Q, every V\\*")
row = ROWS.add

RATTLE = "methods/test_rattle.py::"
TRUTH = "truth/test_nonholonomic.py::"
WORLDS = {
    "SO3": (co.SO3(), co.Defining(), co.Defining()),
    "SE2": (co.SE2(), co.spaces.Points(), co.spaces.Adjoint()),
    "SL2": (co.groups.SLn(2), co.spaces.Dual(), co.Coadjoint()),
}
STEP = co.Midpoint(co.Exponential())


def held(name: str, holonomic: bool) -> tuple[co.System, co.State, np.random.Generator]:
    """A random ℓ, whose masses depend on the place, with two random constraints that its random state satisfies."""
    group, Q, V = WORLDS[name]
    _, state = system_on(group, Q, V, False, f"constraints {name}")
    random = generator("constraints", name, holonomic)
    wide = len(state.n) + len(state.a)
    C, W = random.normal(size=(2, 2, wide))
    A, B = random.normal(size=(2, 2, group.dim + len(state.n)))
    A0 = random.normal(size=(group.dim + len(state.n),) * 2)

    def value(n, a):
        y = jnp.concatenate([n, a])
        return C @ y + jnp.sin(W @ y)

    if holonomic:
        begun = evaluate(value, state.n, state.a)
        constraint = co.Holonomic(lambda n, a: value(n, a) - begun)
    else:
        constraint = co.Nonholonomic(lambda n, a: A + B * jnp.sin(W @ jnp.concatenate([n, a]))[:, None])
    M, u = A0 @ A0.T / 4 + 2 * np.eye(len(A0)), random.normal(size=wide)

    def lagrangian(xi, n, nu, a):
        z, y = jnp.concatenate([xi, nu]), jnp.concatenate([n, a])
        return 0.5 * z @ M @ z + 0.1 * z @ z * jnp.cos(u @ y) + jnp.sum(jnp.sin(W @ y))

    system = co.System(group, lagrangian, additional=Q, advected=V, constraints={"held": constraint})
    return system, state, random


def driven(system: co.System, state: co.State, random: np.random.Generator):
    """A RATTLE step with random unknowns, which momenta solve: its record and the state after it.

    The place where it ends is off the constraints.
    """
    count = reactions.count(system)
    step = Rattle(STEP)

    def advanced(state, z):
        begun = state.replace(memory=co.methods.rattle.Reactions(z[-count:], z[-count:], None, None))
        record = step.record(system, begun, H, z)
        size = len(z) - count

        def left(p):
            mu, pi = jnp.split(p, [system.group.dim])
            return step.equations(system, record.replace(mu=mu, pi=pi), H)[:size]

        p = jnp.concatenate([state.mu, state.pi])
        mu, pi = jnp.split(p - jnp.linalg.solve(jax.jacfwd(left)(p), left(p)), [system.group.dim])
        record = record.replace(mu=mu, pi=pi)
        return record, step.advance(system, record, H)

    z = np.concatenate([state.xi, state.nu, np.zeros(count)]) + 0.3 * random.normal(size=system.unknowns + count)
    return evaluate(advanced, state, z)


@row(
    "Theorems 2 and 7 with reactions",
    "Kelvin–Noether with reactions inside ∂_aℓ⋄a: dI = ⟨𝒦, (∂_aφᵀλ)⋄a⟩",
    (
        "mechanics.constraints.Bound.reaction",
        "mechanics.reactions.source",
        "methods.rattle.Rattle.sources",
        "theory.constraints.discrete_momentum_equation",
    ),
    (RATTLE + "test_gaps_stay_at_round_off_and_energy_in_its_band",),
)
def kelvin_noether() -> Iterator[float]:
    for name in WORLDS:
        yield from _kelvin_noether(name)


def _kelvin_noether(name: str) -> Iterator[float]:
    system, state, random = held(name, True)
    group, V, one = system.group, system.advected, system.constraints[0]
    strength, eta = random.normal(size=2), random.normal(size=group.dim)
    G = evaluate(group.matrix, state.g)
    a0 = evaluate(partial(move, V, group), G, state.a)

    def turned(eps, eta, strength):
        """⟨λ, φ⟩ after the motion by εη of space, in which n stays and a₀ does not move along."""
        a = move(V, group, inverse(G) @ (jnp.eye(len(G)) - eps * hat(group, eta)), a0)
        return strength @ one.value(system, reactions.site(state)._replace(a=a))

    work = evaluate(lambda eta, strength: jax.jvp(lambda e: turned(e, eta, strength), (0.0,), (1.0,))[1], eta, strength)
    body = evaluate(lambda eta: vee(group, inverse(G) @ hat(group, eta) @ G), eta)
    found = evaluate(lambda s, x: reactions.source(system, reactions.site(s), x), state, strength)
    yield off(found @ body, work)
    torque, force = evaluate(lambda s, x: one.reaction(system, reactions.site(s), x), state, strength)
    rates = jax.jacfwd(lambda v: one.rate(system, reactions.site(state), v[: group.dim], v[group.dim :]))
    velocities = np.concatenate([state.xi, state.nu])
    yield off(np.concatenate([torque, force]), evaluate(rates, velocities).T @ strength)

    record, after = driven(system, state, random)
    section = partial(_carried, system, random.normal(size=group.dim))
    terms = evaluate(lambda r, s: theory.discrete_momentum_equation(system, STEP, r, s, H, section), record, after)
    change = evaluate(lambda s: section(s) @ noether.total_momentum(system, s), after)
    change -= evaluate(lambda s: section(s) @ noether.total_momentum(system, s), record)
    yield off(terms.change, change)
    yield largest(terms.moved)
    yield off(terms.sources, change)


def _carried(system, c0, state):
    return system.group.Ad(system.group.inverse(state.g), c0)


@row(
    "Discrete momentum equation",
    "nonholonomic: along 𝒦 with A·(𝒦, 𝒦·n) = 0 reactions do not appear at node k + 1",
    (
        "theory.constraints.generator",
        "theory.constraints.discrete_momentum_equation",
        "mechanics.reactions.source",
        "methods.rattle.Rattle.sources",
    ),
    (TRUTH + "test_reactions_without_a_right_side_do_no_work_and_enter_the_momentum_budget",),
)
def momentum_equation() -> Iterator[float]:
    for name in WORLDS:
        yield from _momentum_equation(name)


def _momentum_equation(name: str) -> Iterator[float]:
    system, state, random = held(name, False)
    group, one = system.group, system.constraints[0]
    c, strength, direction = random.normal(size=group.dim), random.normal(size=2), random.normal(size=group.dim)

    def rows(state):
        """A of the motions (𝒦, 𝒦·n), (2, dim G), from the action alone."""
        G = system.group.identity()
        A = one.rows(system, reactions.site(state))[0]

        def moved(K):
            along = jax.jvp(lambda g: system.additional.act(system.group, g, state.n), (G,), (system.group.tangent(K),))
            return jnp.concatenate([K, along[1]])

        return A @ jax.jacfwd(moved)(jnp.zeros(system.group.dim))

    def section(state):
        B = rows(state)
        return c - B.T @ jnp.linalg.solve(B @ B.T, B @ c)

    found = evaluate(lambda s, x: reactions.source(system, reactions.site(s), x), state, strength)
    moving = evaluate(lambda s, d: jnp.concatenate(constraints.generator(system, s, d)), state, direction)
    A = evaluate(lambda s: one.rows(system, reactions.site(s))[0], state)
    yield off(strength @ A @ moving, found @ direction)
    yield off(A @ moving, evaluate(rows, state) @ direction)

    record, after = driven(system, state, random)
    terms = evaluate(lambda r, s: theory.discrete_momentum_equation(system, STEP, r, s, H, section), record, after)
    change = evaluate(lambda s: section(s) @ noether.total_momentum(system, s), after)
    change -= evaluate(lambda s: section(s) @ noether.total_momentum(system, s), record)
    yield off(terms.change, change)
    yield off(terms.moved + terms.sources, change)
    end = evaluate(lambda s: section(s) @ reactions.source(system, reactions.site(s), s.memory.end), after)
    yield largest(end) / largest(after.memory.end)


def distances() -> Iterator[tuple[co.System, co.State, co.methods.Method]]:
    """The pinned body, and the body at a fixed distance from a point of space."""
    yield pinned.pinned(), pinned.start(pinned.pinned()), co.Midpoint()
    rod = co.Holonomic(lambda n, a, p: (n + p.pin - a) @ (n + p.pin - a) - 1.5)
    system = pinned.body(constraints={"rod": rod})
    yield system, system.project(pinned.start(system, q=[0.5, 0.7, -0.6])), co.Trapezoidal()


@row(
    "Symplecticity on T\\*N",
    "the RATTLE step maps T\\*N, N = {φ = 0}, to itself and keeps the two-form there",
    (
        "theory.constraints.two_form",
        "mechanics.reactions.closing",
    ),
    (RATTLE + "test_a_pinned_body_converges_to_the_top_with_the_order_of_the_method",),
    bound=2e-12,
)
def symplecticity() -> Iterator[float]:
    for system, start, method in distances():
        yield from _symplecticity(system, start, method)


def _symplecticity(system, start, method) -> Iterator[float]:
    random = generator("two-form", method.title)
    state = method.begin(system, start, H)
    free = [tangents(system, state, random) for _ in range(2)]
    first, second = (evaluate(partial(theory.tangent_to_constraints, system), state, d) for d in free)
    yield largest([evaluate(partial(theory.off_constraints, system), state, d) for d in (first, second)])
    yield off(
        evaluate(partial(theory.two_form, system), state, *free)[0],
        evaluate(partial(_of_family, system), state, *free),
    )
    *_, after, code, (before, later, size) = evaluate(partial(carry, system, method), state, 0.1, first, second)
    assert code == 0
    assert abs(before) > 1e-4 * size, "a two-form of nothing proves nothing"
    yield abs(later - before) / size
    value = evaluate(lambda s: system.constraints[0].value(system, reactions.site(s)), after)
    yield largest(value, evaluate(partial(reactions.node_rate, system), after)) / largest(after.nu)


def _of_family(system, state, d1, d2):
    """∂_t(⟨μ, η₁⟩ + ⟨π, w₁⟩) − ∂_s(⟨μ, η₂⟩ + ⟨π, w₂⟩) of G exp(sη₁ + tη₂), q + G(sw₁ + tw₂), μ and π likewise."""
    group, Q = system.group, system.additional
    G = group.matrix(state.g)

    def matrix(s, t):
        X = s * hat(group, d1.eta) + t * hat(group, d2.eta)
        return G @ (jnp.eye(len(G)) + X + 0.5 * X @ X)

    def place(s, t):
        return move(Q, group, G, state.n + s * d1.w + t * d2.w)

    def form(s, t, along):
        ds, dt = along
        g, g_dot = jax.jvp(matrix, (s, t), (ds, dt))
        q_dot = jax.jvp(place, (s, t), (ds, dt))[1]
        eta = vee(group, inverse(g) @ g_dot)
        w = move(Q, group, inverse(g), q_dot, velocity=True)
        return (state.mu + s * d1.mu + t * d2.mu) @ eta + (state.pi + s * d1.pi + t * d2.pi) @ w

    first = jax.grad(lambda t: form(0.0, t, (1.0, 0.0)))(0.0)
    return first - jax.grad(lambda s: form(s, 0.0, (0.0, 1.0)))(0.0)
