"""Rows (B7)–(B17): semidirect products, against matrices and derivatives of the action on them."""

from __future__ import annotations

from functools import partial

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from explicit import H, move, turn
from rows_discrete import ALGORITHMS, FOUR, GROUP_RUNS, INVERSE, ONE_MOTION, invariant
from sequences import SOLVED, at, gentle, induced, links_by_matrices, rebuilt, sequences, unsolved
from theorem_row import Rows, off, off_each

from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.theory import unreduced
from systems import generator

ROWS = Rows("Q = V linear")
row = ROWS.add

NAMES = ("SO3", "SL2", "SO3xSE2", "Heisenberg")
SEMIDIRECT = "groups/test_semidirect_product.py::"
ALGORITHM = ALGORITHMS + "test_the_algorithm_of_the_semidirect_product_is_the_reduced_one"


def unreduced_lagrangian(system):
    """L of matrices for a system with any parts."""
    group, Q, V = system.places
    L = invariant(system)
    has_q, has_a = Q.ambient(group) > 0, V.ambient(group) > 0

    if has_q and has_a:
        return theory.UnreducedLagrangian(group, L, additional=Q, advected=V)
    if has_q:

        def without_a(g, q, g_next, q_next, h):
            return L(g, q, g_next, q_next, jnp.zeros(0), h)

        return theory.UnreducedLagrangian(group, without_a, additional=Q)

    def without_q(g, g_next, a0, h):
        return L(g, jnp.zeros(0), g_next, jnp.zeros(0), a0, h)

    return theory.UnreducedLagrangian(group, without_q, advected=V)


@row("(B7)", "action of a discrete Lagrangian on S × S", ("theory.unreduced.action",), (FOUR,))
def action():
    for system, g, G, q, a0, _ in sequences("n", NAMES):
        L = unreduced_lagrangian(system)
        found = evaluate(lambda path, L=L, a0=a0: unreduced.action(L, path, a0, H), theory.Configuration(g, q))
        yield off(found, evaluate(partial(explicit.action, system), G, q, a0))


def stationary(parts: str, names):
    """(B8) at the inner nodes of any sequence against the derivative of the action."""
    for system, g, G, q, a0, _ in sequences(parts, names):
        L, path = unreduced_lagrangian(system), theory.Configuration(g, q)

        def found(path, L=L, a0=a0):
            nodes = [theory.discrete_euler_lagrange(L, at(path, k - 1), at(path, k), at(path, k + 1), a0, H)
                     for k in (1, 2)]  # fmt: skip
            return tuple(jnp.stack(part) for part in zip(*nodes, strict=True))

        expected = evaluate(partial(explicit.stationarity, system), G, q, a0)
        kept = [pair for pair in zip(evaluate(found, path), expected, strict=True) if np.size(pair[1])]
        yield off_each(*zip(*kept, strict=True))


@row("(B8)", "discrete Euler–Lagrange equations", ("theory.unreduced.discrete_euler_lagrange",), (FOUR, GROUP_RUNS))
def discrete_euler_lagrange():
    yield from stationary("n", NAMES)


def in_f(system, G, q):
    """f = g_{k+1}⁻¹g_k, y = g_{k+1}⁻¹v_k, u⁺ = g_{k+1}⁻¹v_{k+1} by matrices (B9), (B10)."""
    group, Q, _ = system.places
    back = jax.vmap(jnp.linalg.inv)(G[1:])
    y, u = (jax.vmap(lambda B, x: move(Q, group, B, x))(back, x) for x in (q[:-1], q[1:]))
    return back @ G[:-1], y, u


def by_matrices(system):
    """l(f, y, u⁺) with f an element (B11)."""

    def l(f, y, u, h):  # noqa: E743
        group, Q, _ = system.places
        F = jnp.linalg.inv(group.matrix(f))
        return explicit.of_step(system, F, move(Q, group, F, y), move(Q, group, F, u), jnp.zeros(0), h)

    return l


def semidirect_links(system, links):
    """The library's (f, y, u⁺) of links, and f as matrices."""
    group, Q, _ = system.places

    def one(link):
        made = theory.semidirect_link(group, Q, link)
        return made, group.matrix(made.f)

    return jax.vmap(one)(links)


@row(
    "(B9)–(B12)",
    "projection onto f, y, u⁺; reduced Lagrangian and action",
    (
        "theory.semidirect.semidirect_link",
        "theory.semidirect.semidirect_lagrangian",
        "theory.semidirect.semidirect_system",
    ),
    (ALGORITHM,),
)
def projection():
    for system, _, G, q, a0, links in sequences("n", NAMES):
        group, Q, _ = system.places
        made, f = evaluate(partial(semidirect_links, system), links)
        yield off_each((f, made.y, made.u), evaluate(partial(in_f, system), G, q))
        l, again = theory.semidirect_lagrangian(system), theory.semidirect_system(group, Q, by_matrices(system))
        total = evaluate(partial(explicit.action, system), G, q, a0)
        yield off(evaluate(lambda made, l=l: jnp.sum(jax.vmap(lambda *x: l(*x, H))(*made[:3])), made), total)
        yield off(evaluate(lambda path, y=again: theory.reduced_action(y, path, H), links), total)


def statement(system, G, q, a0):
    """The derivative of the action along (gη, gη·u) and (0, gw) at the inner nodes: body variables of S."""
    group, Q, _ = system.places
    on_group, on_space = explicit.stationarity(system, G, q, a0)

    def node(G, q, along_g, along_q):
        def along(way, size):
            return jax.vmap(lambda e: along_q @ move(Q, group, G, way(e), velocity=True))(jnp.eye(size))

        u = move(Q, group, jnp.linalg.inv(G), q)
        return along_g + along(lambda e: turn(Q, group, e, u), group.dim), along(lambda w: w, len(q))

    return jax.vmap(node)(G[1:-1], q[1:-1], on_group, on_space)


@row(
    "[Theorem 3.1](theorems/semidirect-products.md), (B13)",
    "four equivalent statements; discrete Euler–Poincaré equations",
    ("theory.semidirect.discrete_euler_poincare_semidirect",),
    (FOUR, ALGORITHM),
)
def theorem_3_1():
    for system, _, G, q, a0, links in sequences("n", NAMES):
        group, Q, _ = system.places

        def found(links, system=system, group=group, Q=Q):
            made, _ = semidirect_links(system, links)
            return theory.discrete_euler_poincare_semidirect(group, Q, by_matrices(system), at(made, 0), at(made, 1), H)

        expected = evaluate(partial(statement, system), G, q, a0)
        yield off_each(evaluate(found, links), at(expected, 0))


@row(
    "(B14)–(B15)",
    "induced variations and the derivative of the reduced action",
    ("theory.euler_poincare.induced_variation", "theory.semidirect.semidirect_link"),
    (FOUR,),
)
def induced_in_f():
    for system, _, G, q, a0, links in sequences("n", NAMES):
        group, random = system.group, generator("B14", system.group)
        eta, w = random.normal(size=(len(q), group.dim)), random.normal(size=q.shape)

        def library(links, eta, w, system=system, group=group):
            change, _ = induced(system, links, eta, w)
            (made, _), (moved, f) = jax.jvp(partial(semidirect_links, system), (links,), (change,))
            l = by_matrices(system)
            rate = jax.jvp(lambda x: jnp.sum(jax.vmap(lambda *x: l(*x, H))(*x[:3])), (made,), (moved,))[1]
            return f, moved.y, moved.u, rate

        def by_curves(G, q, eta, w, system=system, group=group, a0=a0):
            def at_e(e):
                turned = jax.vmap(lambda G, x: G @ (jnp.eye(len(G)) + e * explicit.hat(group, x)))(G, eta)
                pushed = jax.vmap(lambda G, w: move(system.additional, group, G, w, velocity=True))(G, w)
                return *in_f(system, turned, q + e * pushed), explicit.action(system, turned, q + e * pushed, a0)

            return jax.jvp(at_e, (0.0,), (1.0,))[1]

        yield off_each(evaluate(library, links, eta, w), evaluate(by_curves, G, q, eta, w))


def solution_of_pairs(system, g0, link, a0, steps: int = 4):
    """The algorithm of (B16) from two configurations that a link ties together, and its matrices."""
    group, Q, V = system.places
    first = theory.Configuration(g0, evaluate(lambda g, x: move(Q, group, group.matrix(g), x), g0, link.n))
    ahead = evaluate(lambda g, F, s: (group.compose(g, F), move(Q, group, group.matrix(g), s)), g0, link.F, link.s)
    given = a0 if V.ambient(group) else None
    L = unreduced_lagrangian(system)
    path = theory.discrete_euler_lagrange_algorithm(L, first, theory.Configuration(*ahead), given, H, steps)
    return path, evaluate(jax.vmap(group.matrix), path.g), (first, ahead)


def solved_in_pairs(parts: str, names):
    """How far the algorithm's sequence is from a stationary one, and its first pair from the given one."""
    for system, g, _, _, a0, links in sequences(parts, names):
        path, G, (first, ahead) = solution_of_pairs(system, at(g, 0), gentle(system, links), a0)
        yield off(jax.tree.leaves(at(path, 0)), jax.tree.leaves(first))
        yield off(jax.tree.leaves(at(path, 1)), jax.tree.leaves(ahead))
        yield unsolved(system, G, path.q, a0)


@row(
    "(B16)",
    "algorithm: discrete Euler–Lagrange",
    ("theory.unreduced.discrete_euler_lagrange_algorithm",),
    (ONE_MOTION,),
    bound=SOLVED,
)
def euler_lagrange_algorithm():
    yield from solved_in_pairs("n", ("SO3", "SL2"))


@row(
    "after (B16)",
    "algorithm: discrete Euler–Poincaré",
    ("theory.semidirect.semidirect_algorithm",),
    (ALGORITHM,),
    bound=SOLVED,
)
def euler_poincare_algorithm():
    for system, _, G, _, a0, links in sequences("n", ("SO3", "SL2")):
        group, Q, _ = system.places
        first = evaluate(lambda link, y=system: theory.semidirect_link(*y.places[:2], link), gentle(system, links))
        found = theory.semidirect_algorithm(group, Q, by_matrices(system), first, H, 4)
        yield off_each(at(found, 0)[1:3], first[1:3])

        def back(f, y, u, group=group, Q=Q):
            F = jnp.linalg.inv(group.matrix(f))
            return group.from_matrix(F), move(Q, group, F, y), move(Q, group, F, u)

        F, n, s = evaluate(jax.vmap(back), *found[:3])
        path = rebuilt(system, np.eye(len(G[0])), theory.Link(F, n, s, np.zeros((len(n), 0))))
        yield unsolved(system, *path, a0)
        yield off(n[1:], evaluate(partial(links_by_matrices, system), *path, a0)[1][1:])


@row(
    "[Theorem 3.2](theorems/semidirect-products.md), (B17)",
    "reduction and reconstruction are inverse",
    ("theory.reduction.reduced_path", "theory.reduction.reconstruct"),
    (INVERSE, ONE_MOTION),
)
def theorem_3_2():
    for system, g, G, q, a0, _ in sequences("n", NAMES):
        path = theory.Configuration(g, q)
        links = theory.reduced_path(system.places, path)
        F = evaluate(jax.vmap(system.group.matrix), links.F)
        yield off_each((F, *links[1:3]), evaluate(partial(links_by_matrices, system), G, q, a0)[:3])
        again = theory.reconstruct(system.places, at(g, 0), links)
        yield off_each((evaluate(jax.vmap(system.group.matrix), again.g), again.q), (G, q))
