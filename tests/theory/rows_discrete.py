"""Rows (P36)–(P52): the discrete Euler–Poincaré equations, against derivatives of the action on matrices."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from explicit import H, carry, group_system, hat, move, random_sequence, random_system, turn
from rows_continuous import DIAMOND, pointwise, transposed
from sequences import (
    GROUPS,
    SOLVED,
    at,
    gentle,
    induced,
    links_by_matrices,
    pair,
    rebuilt,
    records_of,
    sequences,
    unsolved,
    varied,
)
from theorem_row import Rows, largest, off, off_each

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.theory import euler_poincare
from systems import generator

ROWS = Rows("every Q and V\\*")
row = ROWS.add

FOUR = "theory/test_equivalences.py::test_the_four_statements_are_one_covector"
RUNS = "theory/test_equations.py::test_the_equations_of_theorems_6_and_7_hold_on_runs_of_every_rule"
GROUP_RUNS = "theory/test_equations.py::test_the_equations_of_both_papers_hold_on_runs_in_group_form"
ALGORITHMS = "theory/test_algorithms.py::"
ONE_MOTION = ALGORITHMS + "test_unreduced_reduced_and_reconstructed_algorithms_give_one_motion"
INVERSE = ALGORITHMS + "test_reduction_and_reconstruction_are_inverse"


def invariant(system):
    """L of matrices, as a function of elements."""

    def L(g, q, g_next, q_next, a0, h):
        return explicit.of_pair(system, h)(system.group.matrix(g), q, system.group.matrix(g_next), q_next, a0)

    return L


def torn(system):
    """L = ±1 that the group changes: off by 2 of its size."""

    def L(g, q, g_next, q_next, a0, h):
        return jnp.sign(jnp.sin(40 * jnp.sum(system.group.matrix(g))))

    return L


@row(
    "(P36)–(P37)",
    "left-invariant discrete Lagrangian and its reduction",
    ("theory.reduction.reduce", "theory.reduction.invariance_defect", "theory.reduction.unreduce"),
    (ALGORITHMS + "test_a_lagrangian_that_is_not_invariant_is_refused", GROUP_RUNS),
)
def invariance():
    for system, g, G, q, a0, links in sequences():
        group, Q, V = system.places

        L, wrong = (
            theory.UnreducedLagrangian(group, made(system), additional=Q, advected=V) for made in (invariant, torn)
        )
        first, second = (theory.Configuration(at(g, k), q[k]) for k in (0, 1))
        expected = evaluate(explicit.of_pair(system), *pair(G, q, 0), a0)
        again, reduced = theory.unreduce(system), theory.reduce(L)
        yield off(evaluate(lambda *pair, L=L, a0=a0: L(*pair, a0, H), first, second), expected)
        yield off(evaluate(lambda *pair, L=again, a0=a0: L(*pair, a0, H), first, second), expected)
        found = evaluate(lambda *link, y=reduced: y.reduced_group_lagrangian(*link, H), *at(links, 0)[:4])
        yield off(found, expected)
        yield abs(theory.invariance_defect(L))
        yield off(theory.invariance_defect(wrong), 2.0)
        yield 1.0 if accepted(wrong) else 0.0


def accepted(L) -> bool:
    """Whether a Lagrangian is reduced."""
    try:
        theory.reduce(L)
    except co.errors.LagrangianError:
        return False
    return True


@row(
    "(P38)–(P40)",
    "F = τ(hξ) = g_k⁻¹g_{k+1}, n, s, a",
    ("theory.reduction.reduced_path", "methods.LeftRectangle.relative"),
    (INVERSE, RUNS),
)
def reduced_variables():
    for system, g, G, q, a0, _ in sequences():
        group = system.group
        found = theory.reduced_path(system.places, theory.Configuration(g, q), a0)
        matrices = evaluate(jax.vmap(group.matrix), found.F)
        yield off_each((matrices, *found[1:4]), evaluate(partial(links_by_matrices, system), G, q, a0))
        xi = generator("increment", group).normal(size=group.dim)

        def sides(xi, system=system):
            half = 0.5 * H * hat(system.group, xi)
            one = jnp.eye(len(half))
            F = co.LeftRectangle(co.Cayley()).relative(system, SimpleNamespace(xi=xi), H)
            return system.group.matrix(F), jnp.linalg.solve(one - half, one + half)

        yield off(*evaluate(sides, xi))


@row("(P41)", "reduced discrete action", ("theory.euler_poincare.reduced_action",), (FOUR,))
def reduced_action():
    for system, _, G, q, a0, links in sequences():
        found = evaluate(lambda links, system=system: theory.reduced_action(system, links, H), links)
        yield off(found, evaluate(partial(explicit.action, system), G, q, a0))


@row(
    "[Theorem 6](theorems/discrete-euler-poincare.md), (P42)–(P44)",
    "discrete Euler–Poincaré equations with parameters and additional dynamics; their algorithm",
    (
        "theory.euler_poincare.discrete_euler_poincare",
        "theory.euler_poincare.left_momenta",
        "theory.euler_poincare.right_momenta",
        "theory.euler_poincare.discrete_euler_poincare_algorithm",
        "theory.legendre.discrete_legendre",
        "methods.GroupVariational.equations",
        "methods.GroupVariational.advance",
        "methods.LeftRectangle.equations",
        "methods.LeftRectangle.advance",
    ),
    (FOUR, RUNS, ONE_MOTION),
    bound=SOLVED,
)
def theorem_6():
    for system, _, G, q, a0, links in sequences():
        before, here = (evaluate(partial(explicit.legendre, system), *pair(G, q, k), a0) for k in (0, 1))

        def momenta(first, second, system=system):
            ends = euler_poincare.left_momenta(system, second, H), euler_poincare.right_momenta(system, first, H)
            return *ends, theory.discrete_euler_poincare(system, first, second, H)

        found = evaluate(momenta, at(links, 0), at(links, 1))
        yield off_each(tuple(tuple(pair) for pair in found),
                       (here[:2], before[2:], (here[0] - before[2], here[1] - before[3])))  # fmt: skip
    for name in GROUPS:
        yield from legendre_transforms(name)
        yield from steps_in_group_form(name)
        yield from left_rectangle(name)
    for system, _, G, _, _, links in sequences(names=("SO3", "SE2")):
        found = theory.discrete_euler_poincare_algorithm(system, gentle(system, links), H, 4)
        yield off(at(found, 0)[1:4], gentle(system, links)[1:4])
        yield unsolved(system, *rebuilt(system, np.eye(len(G[0])), found), found.a[0])


def legendre_transforms(name: str):
    """F± of steps in group form and of the left rule, at unknowns that solve nothing."""
    system, links, ends = next(ends_of(name))
    records, step = records_of(name, "na", links[1], links[0]), co.methods.GroupVariational(co.Exponential())
    minus, plus = theory.discrete_legendre(system, step, records, H)
    yield off_each((*minus, *plus), ends)
    system, start = random_system(name)

    def by_matrices(record):
        mu, pi, F, torque, pushed = left_step(system, record)
        return mu, pi, explicit.Ad_dual(system.group, F, mu + torque), pushed

    minus, plus = theory.discrete_legendre(system, co.LeftRectangle(co.Cayley()), start, H)
    yield off_each((*minus, *plus), evaluate(by_matrices, start))


def ends_of(name: str):
    """A system in group form, the elements and links of a sequence, and (μ_k, π_k, μ_{k+1}, π_{k+1}) by matrices."""
    for system, g, G, q, a0, links in sequences(names=(name,)):
        ends = jax.vmap(lambda *two, y=system, a0=a0: explicit.legendre(y, *two, a0))
        yield system, (g, links), evaluate(ends, G[:-1], q[:-1], G[1:], q[1:])


def steps_in_group_form(name: str):
    """The equations and the step of co.methods.GroupVariational at any record: momenta that do not fit show by how
    much."""
    system = group_system(name)
    g, G, q, a0 = random_sequence(name)
    _, _, _, _, _, links = next(sequences(names=(name,)))
    record = at(records_of(name, "na", links, g), 0)
    mu, pi, mu_next, pi_next = evaluate(partial(explicit.legendre, system), *pair(G, q, 0), a0)
    step = co.methods.GroupVariational(co.Exponential())
    left = evaluate(lambda s: step.equations(system, s, H), record)
    yield off(left, np.concatenate([mu - record.mu, record.pi - pi]))
    after = evaluate(lambda s: step.advance(system, s, H), record.replace(mu=mu, pi=pi))
    _, n, _, a = evaluate(partial(links_by_matrices, system), np.stack([G[1], G[1]]), np.stack([q[1], q[1]]), a0)
    placed = evaluate(system.group.matrix, after.g), after.n, after.a
    yield off_each((*placed, after.mu, after.pi), (G[1], n[0], a[0], mu_next, pi_next))


def left_rectangle(name: str):
    """(P42)–(P44) of Λ = hℓ(ξ, n, (s − n)/h, a) with the Cayley transform, by differentiation of matrices."""
    system, start = random_system(name)
    random = generator("left", name)
    record = start.replace(mu=random.normal(size=len(start.mu)), pi=random.normal(size=len(start.pi)))
    step = co.LeftRectangle(co.Cayley())

    def sides(record):
        mu, pi, F, torque, pushed = left_step(system, record)
        fitting = step.advance(system, record.replace(mu=mu, pi=pi), H)
        group, Q, V = system.places
        back, s = jnp.linalg.inv(F), record.n + H * record.nu
        G = group.matrix(record.g)
        placed = G @ F, move(Q, group, back, s), move(V, group, back, record.a)
        right = explicit.Ad_dual(group, F, mu + torque), pushed
        found = group.matrix(fitting.g), fitting.n, fitting.a, fitting.mu, fitting.pi
        left = jnp.concatenate([mu - record.mu, pi - record.pi])
        return (step.equations(system, record, H), *found), (left, *placed, *right)

    yield off_each(*evaluate(sides, record))


def left_step(system, record):
    """μ_k and π_k that fit (ξ, ν) of the record, F, the torque ∂_aΛ⋄a + ∂_nΛ⋄n + ∂_sΛ⋄s, and π_{k+1} = F*∂_sΛ."""
    group, Q, V = system.places
    s = record.n + H * record.nu

    def value(xi, n, s, a):
        return H * explicit.lagrangian(system, xi, n, (s - n) / H, a)

    def increment(xi):
        half, one = 0.5 * H * hat(group, xi), jnp.eye(group.matrix_size)
        return jnp.linalg.solve(one - half, one + half)

    by_xi, by_n, by_s, by_a = jax.grad(value, argnums=(0, 1, 2, 3))(record.xi, record.n, s, record.a)
    F, slope = increment(record.xi), jax.jacfwd(increment)(record.xi)
    turned = jax.vmap(lambda d: explicit.vee(group, d @ jnp.linalg.inv(F)), in_axes=2, out_axes=1)(slope)
    torque = transposed(group, lambda xi: by_a @ turn(V, group, xi, record.a) + by_n @ turn(Q, group, xi, record.n)
                        + by_s @ turn(Q, group, xi, s))  # fmt: skip
    ahead = move(Q, group, jnp.linalg.inv(F), s)
    pushed = jax.vmap(lambda w: by_s @ carry(Q, group, F, ahead, w))(jnp.eye(len(s)))
    return jnp.linalg.solve(turned.T, by_xi) - torque, -by_n, F, torque, pushed


@row("(P45)", "pointwise diamond", ("spaces.space.Space.diamond",), (DIAMOND,))
def diamond():
    for group, space, b, x, _, _ in pointwise((*GROUPS, "Heisenberg", "SO3xSE2")):

        def sides(b, x, group=group, space=space):
            return space.diamond(group, b, x), transposed(group, lambda xi: b @ turn(space, group, xi, x))

        yield off(*evaluate(sides, b, x))


@row(
    "(P46)",
    "τ\\*: T\\*\\_sQ → T\\*\\_nQ",
    ("spaces.space.Space.pull", "spaces.space.Space.push"),
    ("spaces/test_actions.py::test_pull_is_dual_to_push",),
)
def pull():
    for group, space, b, x, v, xi in pointwise((*GROUPS, "Heisenberg", "SO3xSE2")):

        def sides(b, x, v, xi, group=group, space=space):
            F = co.Exponential().tau(group, 0.5 * xi)
            along = jax.vmap(lambda w: b @ carry(space, group, group.matrix(F), x, w))(jnp.eye(len(x)))
            pushed = carry(space, group, group.matrix(F), x, v)
            return (space.pull(group, F, x, b), space.push(group, F, x, v)), (along, pushed)

        yield off_each(*evaluate(sides, b, x, v, xi))


@row(
    "(P47)",
    "hδξ = dτ⁻¹_{−hξ}η⁺ − dτ⁻¹_{hξ}η",
    ("theory.euler_poincare.induced_variation", "difference_maps.difference_map.DifferenceMap.dtau_inverse"),
    (RUNS, FOUR),
    domain="every G whose Lie algebra the map fits",
)
def variation_of_increments():
    for system, _, G, q, a0, links in sequences():
        group, eta = system.group, generator("variation", system.group).normal(size=(len(q), system.group.dim))
        w = np.zeros_like(q)
        found = evaluate(lambda *x, system=system: induced(system, *x)[1], links, eta, w)
        yield off(found, evaluate(lambda *x, system=system: varied(system, *x)[0][0], G, q, a0, eta, w))
        for tau in (co.Cayley(), co.Exponential()):

            def sides(xi, eta, ahead, group=group, tau=tau):
                change = tau.dtau_inverse(group, -xi, ahead) - tau.dtau_inverse(group, xi, eta)
                F, moved = jax.jvp(lambda x: group.matrix(tau.tau(group, x)), (xi,), (change,))
                return moved, F @ hat(group, ahead) - hat(group, eta) @ F

            yield off(*evaluate(sides, *0.5 * eta[:3]))


@row(
    "(P48)–(P49)",
    "induced variations of n, s, a; the action's derivative",
    ("theory.euler_poincare.induced_variation", "theory.euler_poincare.reduced_action"),
    (FOUR,),
)
def induced_variations():
    for system, _, G, q, a0, links in sequences():
        eta = generator("variation", system.group).normal(size=(len(q), system.group.dim))
        w = generator("variation", system.group, "w").normal(size=q.shape)

        def library(links, eta, w, system=system):
            made, _ = induced(system, links, eta, w)
            change = jax.jvp(lambda path: theory.reduced_action(system, path, H), (links,), (made,))[1]
            return *made[1:4], change

        (_, *expected), change = evaluate(partial(varied, system), G, q, a0, eta, w)
        yield off_each(evaluate(library, links, eta, w), (*expected, change))


@row(
    "[Theorem 7](theorems/kelvin-noether.md), (P50)–(P52)",
    "discrete Kelvin–Noether theorem",
    (
        "mechanics.noether.KelvinNoether.paper_quantity",
        "mechanics.noether.KelvinNoether.momentum_map",
        "theory.legendre.discrete_momentum_maps",
        "theory.equations.equations_of",
    ),
    (
        RUNS,
        "methods/test_discrete_equations.py::test_balance_of_theorem_7",
        "methods/test_unforced_steps.py::test_paper_quantity_satisfies_its_balance",
    ),
    bound=SOLVED,
)
def theorem_7():
    for name in GROUPS:
        system = group_system(name)
        g, G, q, a0 = random_sequence(name)
        _, _, _, _, _, links = next(sequences(names=(name,)))
        records, step = records_of(name, "na", links, g), co.methods.GroupVariational(co.Exponential())
        c0 = generator("theorem 7", name).normal(size=system.group.dim)
        quantities = co.mechanics.KelvinNoether(c0)
        legendre = jax.vmap(lambda *pair, y=system, a0=a0: explicit.legendre(y, *pair, a0))
        fits = evaluate(legendre, G[:-1], q[:-1], G[1:], q[1:])
        K, values, sources = evaluate(jax.vmap(partial(kelvin, system, c0)), G[:-1], G[1:], q[1:], *links[1:4])
        fitting = records.replace(mu=fits[0], pi=fits[1])

        def library(record, quantities=quantities, step=step, system=system):
            return quantities.momentum_map(system, record), quantities.paper_quantity(system, step, record, H)

        yield off_each(evaluate(jax.vmap(library), fitting), (K, values))
        maps = theory.discrete_momentum_maps(system, step, fitting, H)
        yield off_each(
            tuple(maps), evaluate(jax.vmap(partial(momentum_maps, system, a0)), G[:-1], q[:-1], G[1:], q[1:])
        )
        found = theory.equations_of(system, step, fitting, H, quantities)
        yield off(found["P52"].values, np.abs(np.diff(values) - sources[1:]))
        yield largest(found["P50"].values) / largest(K)
    for system, _, G, _, _, links in sequences(names=("SO3", "SE2")):
        first = gentle(system, links)
        path = theory.discrete_euler_poincare_algorithm(system, first, H, 4)
        G, q = rebuilt(system, np.eye(len(G[0])), path)
        c0 = np.arange(1.0, 1 + system.group.dim)
        _, values, sources = evaluate(jax.vmap(partial(kelvin, system, c0)), G[:-1], G[1:], q[1:], *path[1:4])
        yield off(np.diff(values), sources[1:], values)


def momentum_maps(system, a0, G, q, G_next, q_next):
    """J∓: the derivatives of ∓L along η·(g, q) at the first and at the second end."""
    group, Q, _ = system.places
    L = explicit.of_pair(system)

    def moved(eta, ahead):
        first, second = (jnp.eye(group.matrix_size) + hat(group, x) for x in (eta, ahead))
        return L(first @ G, q + turn(Q, group, eta, q), second @ G_next, q_next + turn(Q, group, ahead, q_next), a0)

    minus, plus = jax.grad(moved, argnums=(0, 1))(jnp.zeros(group.dim), jnp.zeros(group.dim))
    return -minus, plus


def kelvin(system, c0, G, G_next, q_next, n, s, a):
    """𝒦 = Ad_{g⁻¹}c₀, (P51) ⟨𝒦, D^R_FΛ − ∂_sΛ⋄s⟩ and ⟨𝒦, ∂_aΛ⋄a⟩ by moving F, s, a along 𝒦."""
    group, Q, V = system.places
    K = explicit.Ad(group, jnp.linalg.inv(G), c0)
    F, X = jnp.linalg.solve(G, G_next), hat(group, K)
    value = partial(explicit.of_step, system)
    ways = (X @ F, jnp.zeros_like(n), turn(Q, group, K, s), jnp.zeros_like(a))
    along = jax.jvp(value, (F, n, s, a), ways)[1]
    source = -jax.jvp(lambda a: value(F, n, s, a), (a,), (turn(V, group, K, a),))[1]
    return K, along, source
