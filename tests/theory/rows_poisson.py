"""Rows (B18)–(B27): the Euler–Poincaré–Poisson equations, against derivatives of the action on matrices."""

from __future__ import annotations

from functools import partial

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from explicit import H, hat, move, turn
from rows_discrete import ALGORITHMS, FOUR, GROUP_RUNS
from rows_semidirect import stationary
from sequences import SOLVED, at, gentle, induced, rebuilt, sequences, unsolved
from theorem_row import Rows, off, off_each

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from systems import generator

ROWS = Rows("flat V\\*, no Q")
row = ROWS.add

NAMES = ("SO3", "SE2", "SL2", "SE3")
POISSON = ALGORITHMS + "test_euler_poincare_poisson_is_the_reduced_algorithm_with_a_parameter"
KELVIN = ALGORITHMS + "test_discrete_kelvin_noether_theorem_of_euler_poincare_poisson"
ENDS = ("left", "right")
NOTHING = np.zeros(0)


def function_of(system, parameter: str):
    """l(f, a) with f an element and the parameter at either end, by matrices (B18)."""
    group, _, V = system.places

    def l(f, a, h):  # noqa: E743
        F = jnp.linalg.inv(group.matrix(f))
        return explicit.of_step(system, F, NOTHING, NOTHING, move(V, group, F, a) if parameter == "right" else a, h)

    return l


def lagrangian_of(system, parameter: str):
    return theory.PoissonLagrangian(system.group, system.advected, function_of(system, parameter), parameter)


def poisson_links(system, links):
    """(f, a) of links by the library, and f as matrices."""

    def one(link):
        made = theory.poisson_link(system.group, link)
        return made, system.group.matrix(made.f)

    return jax.vmap(one)(links)


@row(
    "(B18)",
    "reduced Lagrangian with a parameter, at the left or the right end",
    (
        "theory.poisson.PoissonLagrangian.taken",
        "theory.poisson.PoissonLagrangian.next_a",
        "theory.poisson.poisson_lagrangian",
        "theory.poisson.poisson_system",
        "theory.poisson.poisson_link",
    ),
    (POISSON,),
)
def lagrangian_with_a_parameter():
    for system, _, G, q, a0, links in sequences("a", NAMES):
        group, _, V = system.places
        made, f = evaluate(partial(poisson_links, system), links)
        back = np.linalg.inv(G)
        a = evaluate(jax.vmap(lambda B, V=V, group=group, a0=a0: move(V, group, B, a0)), back)
        yield off_each((f, made.a), (back[1:] @ G[:-1], a[:-1]))
        total = evaluate(partial(explicit.action, system), G, q, a0)
        for parameter, seen in zip(ENDS, (a[:-1], a[1:]), strict=True):
            given = lagrangian_of(system, parameter)
            taken = evaluate(jax.vmap(lambda link, l=given: (l.taken(link), l.next_a(link))), made)
            yield off_each(taken, (seen, a[1:]))
            l, again = theory.poisson_lagrangian(system, parameter), theory.poisson_system(given)
            value = evaluate(lambda f, a, l=l: jnp.sum(jax.vmap(lambda *x: l.function(*x, H))(f, a)), made.f, seen)
            yield off(value, total)
            yield off(evaluate(lambda path, y=again: theory.reduced_action(y, path, H), links), total)


@row(
    "[Theorem 4.1](theorems/euler-poincare-poisson.md), (B19)",
    "Euler–Poincaré–Poisson equations; their algorithm",
    (
        "theory.poisson.discrete_euler_poincare_poisson",
        "theory.poisson.PoissonLagrangian.slopes",
        "theory.poisson.poisson_algorithm",
    ),
    (POISSON, GROUP_RUNS),
    bound=SOLVED,
)
def theorem_4_1():
    for system, _, G, q, a0, links in sequences("a", NAMES):
        expected, _ = evaluate(partial(explicit.stationarity, system), G, q, a0)
        for parameter in ENDS:
            l = lagrangian_of(system, parameter)

            def found(links, l=l, system=system):
                made, _ = poisson_links(system, links)
                return theory.discrete_euler_poincare_poisson(l, at(made, 0), at(made, 1), H)

            yield off(evaluate(found, links), expected[0])
    for system, _, G, _, _, links in sequences("a", ("SO3", "SE2")):
        for parameter in ENDS:
            first = evaluate(lambda link, y=system: theory.poisson_link(y.group, link), gentle(system, links))
            path = theory.poisson_algorithm(lagrangian_of(system, parameter), first, H, 4)
            G, q = rebuilt(system, np.eye(len(G[0])), links_of(system, path))
            back = np.linalg.inv(G[:-1])
            a = evaluate(jax.vmap(lambda B, y=system, a=first.a: move(y.advected, y.group, B, a)), back)
            yield off_each((path.a, at(path.f, 0)), (a, first.f)) if not isinstance(first.f, tuple) else off(path.a, a)
            yield unsolved(system, G, q, first.a)


def links_of(system, path):
    """Links of the library from (f, a)."""
    group = system.group

    def back(f):
        return group.from_matrix(jnp.linalg.inv(group.matrix(f)))

    nothing = np.zeros((len(path.a), 0))
    return theory.Link(evaluate(jax.vmap(back), path.f), nothing, nothing, path.a)


@row("(B20)", "discrete Euler–Lagrange equations at fixed a₀", ("theory.unreduced.discrete_euler_lagrange",), (FOUR,))
def at_fixed_parameters():
    yield from stationary("a", NAMES)
    yield from stationary("na", ("SO3", "SL2"))


@row(
    "(B21)–(B23)",
    "induced variations; the principle of Lagrange–d'Alembert",
    ("theory.euler_poincare.induced_variation", "theory.poisson.poisson_link"),
    (FOUR,),
)
def induced_at_fixed_parameters():
    for system, _, G, q, a0, links in sequences("a", NAMES):
        group, V = system.group, system.advected
        eta = generator("B21", group).normal(size=(len(q), group.dim))

        def library(links, eta, system=system):
            change, _ = induced(system, links, eta, jnp.zeros((len(eta), 0)))
            (made, _), (moved, f) = jax.jvp(partial(poisson_links, system), (links,), (change,))
            l = function_of(system, "left")
            rate = jax.jvp(lambda x: jnp.sum(jax.vmap(lambda *x: l(*x, H))(*x[:2])), (made,), (moved,))[1]
            return f, moved.a, rate

        def by_curves(G, eta, system=system, group=group, V=V, q=q, a0=a0):
            def at_e(e):
                turned = jax.vmap(lambda G, x: G @ (jnp.eye(len(G)) + e * hat(group, x)))(G, eta)
                back = jax.vmap(jnp.linalg.inv)(turned)
                a = jax.vmap(lambda B: move(V, group, B, a0))(back[:-1])
                return back[1:] @ turned[:-1], a, explicit.action(system, turned, q, a0)

            return jax.jvp(at_e, (0.0,), (1.0,))[1]

        yield off_each(evaluate(library, links, eta), evaluate(by_curves, G, eta))


def quantities(system, parameter: str, G, a0, K):
    """⟨D^Rl, 𝒦⟩ and −⟨D₂l⋄a, 𝒦⟩ of one step, a and K those of its node where the parameter of l is, by matrices."""
    group, _, V = system.places
    back = [jnp.linalg.inv(g) for g in G]
    f = back[1] @ G[0]
    a = move(V, group, back[0 if parameter == "left" else 1], a0)

    def value(f, a):
        F = jnp.linalg.inv(f)
        return explicit.of_step(system, F, NOTHING, NOTHING, move(V, group, F, a) if parameter == "right" else a, H)

    momentum = jax.jvp(lambda f: value(f, a), (f,), (hat(group, K) @ f,))[1]
    return momentum, jax.jvp(lambda a: value(f, a), (a,), (turn(V, group, K, a),))[1]


def kelvin(system, parameter: str, G, a0, K):
    """I^B_k = ⟨D^Rl_{k−1}, 𝒦_k⟩ (B24) and its change over the next step (B25), of three elements."""
    before, here = (quantities(system, parameter, pair, a0, K) for pair in (G[:2], G[1:]))
    return before[0], (here if parameter == "left" else before)[1]


@row("(B24)", "Kelvin–Noether quantity I^B", ("theory.poisson.kelvin_noether_poisson",), (KELVIN,))
def quantity():
    for system, _, G, _, a0, links in sequences("a", NAMES):
        K = generator("B24", system.group).normal(size=system.group.dim)
        for parameter in ENDS:
            l = lagrangian_of(system, parameter)

            def found(links, l=l, K=K, system=system):
                made, _ = poisson_links(system, links)
                return theory.kelvin_noether_poisson(l, at(made, 0), at(made, 1), K, H)

            expected = evaluate(partial(kelvin, system, parameter), G[:3], a0, K)
            yield off_each(evaluate(found, links), expected)


@row(
    "[Theorem 5.1](theorems/euler-poincare-poisson.md), (B25)–(B27)",
    "discrete Kelvin–Noether theorem, I^B = −I",
    ("theory.poisson.kelvin_noether_poisson", "mechanics.noether.KelvinNoether.momentum_map"),
    (KELVIN,),
    bound=SOLVED,
)
def theorem_5_1():
    for system, _, G, _, _, links in sequences("a", ("SO3", "SE2")):
        for parameter in ENDS:
            yield from along_solution(system, parameter, len(G[0]), gentle(system, links))


def along_solution(system, parameter: str, size: int, link, steps: int = 5):
    """(B25) for 𝒦 = c along a motion that solves (B19), with 𝒦 by the library; and I^B = −I of Theorem 7."""
    l, group = lagrangian_of(system, parameter), system.group
    first = evaluate(lambda link: theory.poisson_link(group, link), link)
    path = theory.poisson_algorithm(l, first, H, steps)
    G, q = rebuilt(system, np.eye(size), links_of(system, path))
    c0 = generator("B25", group).normal(size=group.dim)
    own = evaluate(jax.vmap(lambda G: explicit.Ad(group, jnp.linalg.inv(G), c0)), G)
    _, start = explicit.random_system(system_name(group), "a")

    def library(G, before, here):
        record = start.replace(g=group.from_matrix(G))
        K = co.mechanics.KelvinNoether(c0).momentum_map(system, record)
        return K, *theory.kelvin_noether_poisson(l, before, here, K, H)

    K, values, changes = evaluate(jax.vmap(library), G[1:-1], at(path, slice(None, -1)), at(path, slice(1, None)))
    yield off(K, own[1:-1])
    yield off(np.diff(values), changes[:-1], path.a)
    momenta = [evaluate(partial(explicit.legendre, system), *G_q, first.a)[2] for G_q in _pairs(G, q)]
    if parameter == "left":
        yield off(values, [-mu @ k for mu, k in zip(momenta[:-1], own[1:-1], strict=True)])


def _pairs(G, q):
    return [(G[k], q[k], G[k + 1], q[k + 1]) for k in range(len(G) - 1)]


def system_name(group) -> str:
    """The name of a group among those of the random systems."""
    return next(name for name, known in explicit.GROUPS.items() if known == group)
