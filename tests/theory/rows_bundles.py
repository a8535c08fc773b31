"""Rows (B28)–(B37): discrete connections and principal bundles over groups that do not commute, against matrices."""

from __future__ import annotations

from functools import cache, partial

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from rows_discrete import ONE_MOTION
from rows_semidirect import solved_in_pairs
from sequences import SOLVED, at
from theorem_row import Rows, off, off_each

import coadjoint as co
from bundles import (
    SIZE,
    TURNED,
    kinetic_system,
    random_connection,
    random_motion,
    random_system,
    smooth_connection,
    turned_connection,
    turned_lagrangian,
    turned_motion,
    turned_start,
    turned_system,
)
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import bundle
from coadjoint.theory import principal_bundles
from coadjoint.theory.discrete_connections import discrete_mechanical_connection
from systems import GROUPS, element, generator

ROWS = Rows("G × Q → Q, flat or curved Q")
row = ROWS.add

H = 0.1
NAMES = ("SO3", "SE2", "SL2")
BUNDLES = "mechanics/test_bundles.py::"
POINCARE = "theory/test_lagrange_poincare.py::"
ANY_CONNECTION = POINCARE + "test_the_reduced_algorithm_gives_the_unreduced_motion_whatever_the_connection"
CONNECTION = "mechanics.discrete_connection.DiscreteConnection."
REDUCED = "theory.principal_bundles.ReducedLagrangian."
RULES = {"left": co.LeftRectangle(co.Cayley()), "trapezoidal": co.Trapezoidal(co.Cayley())}


def action(system, rule: str, G, x):
    """Σ Λ of a rule with the Cayley transform: hξ̂ = 2(F − 1)(F + 1)⁻¹, ℓ at the left end or at both."""
    group, nothing = system.group, jnp.zeros(0)

    def value(G, x, G_next, x_next):
        F, one = jnp.linalg.solve(G, G_next), jnp.eye(len(G))
        xi = explicit.vee(group, 2 * (F - one) @ jnp.linalg.inv(F + one)) / H
        ends = [explicit.lagrangian(system, xi, y, (x_next - x) / H, nothing) for y in (x, x_next)]
        return H * (ends[0] if rule == "left" else 0.5 * (ends[0] + ends[1]))

    return jnp.sum(jax.vmap(value)(G[:-1], x[:-1], G[1:], x[1:]))


def stationarity(system, rule: str, G, x):
    """The derivatives of the action at the inner nodes, (N−1, dim G + m)."""
    return jnp.concatenate(explicit.stationarity_of(system.group, partial(action, system, rule), G, x), axis=1)


@cache
def motion(name: str, steps: int = 4):
    """Any elements and shapes with small relative motions, and the matrices."""
    g, x = random_motion(name, steps, scale=0.15)
    return g, x, evaluate(jax.vmap(lambda g: GROUPS[name].matrix(g)), g)


def turned_action(rule: str, numbers, a0, G, x):
    """Σ Λ of a rule of `bundles.turned_system` in body coordinates: s = (direction⁺, F place⁺)."""
    group = GROUPS["SO3"]

    def value(G, x, G_next, x_next):
        F, one = G.T @ G_next, jnp.eye(3)
        xi = explicit.vee(group, 2 * (F - one) @ jnp.linalg.inv(F + one)) / H
        v = (jnp.concatenate([x_next[:3], F @ x_next[3:]]) - x) / H
        left = turned_lagrangian(numbers, xi, x, v, G.T @ a0)
        v = jnp.concatenate([v[:3], F.T @ v[3:]])
        right = turned_lagrangian(numbers, xi, x_next, v, G_next.T @ a0)
        return H * (left if rule == "left" else 0.5 * (left + right))

    return jnp.sum(jax.vmap(value)(G[:-1], x[:-1], G[1:], x[1:]))


def turned_stationarity(rule: str, numbers, a0, G, x):
    """The derivatives of that action at the inner nodes, along G and in the frame of M, (N−1, 3 + 5)."""
    on_group, on_shapes = explicit.stationarity_of(GROUPS["SO3"], partial(turned_action, rule, numbers, a0), G, x)
    frame = jax.vmap(partial(TURNED.coordinates, GROUPS["SO3"]))(x[1:-1], on_shapes)
    return jnp.concatenate([on_group, frame], axis=1)


def omegas(connection, x):
    """Ω(x_k, x_{k+1}) as matrices."""
    return evaluate(jax.vmap(lambda x, y: connection.group.matrix(connection.increment(x, y))), x[:-1], x[1:])


def matrices(group, g):
    return evaluate(jax.vmap(lambda g: group.matrix(g)), g)


@row(
    "(B28)–(B31)",
    "discrete connection, its equivariance and local form",
    (
        CONNECTION + "form",
        CONNECTION + "__call__",
        CONNECTION + "in_section",
        CONNECTION + "from_connection",
        CONNECTION + "from_form",
    ),
    (BUNDLES + "test_a_discrete_connection_is_equivariant_and_its_global_form_gives_it_back",),
)
def connections():
    for name in NAMES:
        group, connection, (g, x, G) = GROUPS[name], random_connection(name), motion(name)
        first, second = (at(g, 0), x[0]), (at(g, 1), x[1])
        omega = omegas(connection, x[:2])[0]
        form = evaluate(lambda *pair, c=connection: c.group.matrix(c.form(*pair)), *first, *second)
        yield off(form, G[1] @ np.linalg.inv(G[0] @ omega))
        yield off(evaluate(group.matrix, connection(x[0], x[1])), omega)
        f, f_next = (element(group, generator("equivariant", name, k)) for k in (0, 1))

        def turned(f, f_next, g, x, g_next, x_next, c=connection):
            compose, matrix = c.group.compose, c.group.matrix
            return matrix(c.form(compose(f, g), x, compose(f_next, g_next), x_next)), matrix(f_next), matrix(f)

        moved, A_next, A = evaluate(turned, f, f_next, *first, *second)
        yield off(moved, A_next @ G[1] @ np.linalg.inv(A @ G[0] @ omega))

        def section(x, name=name):
            return co.Cayley().tau(GROUPS[name], 0.3 * jnp.sin(jnp.arange(1.0, 1 + GROUPS[name].dim) * x[0] + x[1]))

        chi = evaluate(jax.vmap(lambda x, y=group, s=section: y.matrix(s(x))), x[:2])
        seen = connection.in_section(section)
        yield off(
            evaluate(lambda x, y, c=seen: c.group.matrix(c.increment(x, y)), *x[:2]),
            chi[0] @ omega @ np.linalg.inv(chi[1]),
        )
        smooth = smooth_connection(name)
        lifted = co.mechanics.DiscreteConnection.from_connection(smooth, co.Cayley())

        def by_cayley(x, y, c=smooth):
            half = 0.5 * explicit.hat(c.group, -c.form(0.5 * (x + y)) @ (y - x))
            return jnp.linalg.solve(jnp.eye(len(half)) - half, jnp.eye(len(half)) + half)

        found = evaluate(lambda x, y, c=lifted: c.group.matrix(c.increment(x, y)), *x[:2])
        yield off(found, evaluate(by_cayley, *x[:2]))
        again = co.mechanics.DiscreteConnection.from_form(group, SIZE, connection.form)
        yield off(evaluate(lambda x, y, c=again: c.group.matrix(c.increment(x, y)), *x[:2]), omega)
    turned, x = turned_connection(), turned_motion(1)[1]
    yield off(evaluate(turned.group.matrix, turned(*x)), omegas(turned, x)[0])


@row(
    "(B32)–(B34)",
    "reduced variable σ and reduced Lagrangian on a principal bundle",
    (
        "mechanics.bundle.reduced",
        "mechanics.bundle.horizontal_lift",
        REDUCED + "increment",
        REDUCED + "velocity",
        REDUCED + "value",
        "theory.discrete_connections.discrete_mechanical_connection",
    ),
    (BUNDLES + "test_sigma_is_e_exactly_on_horizontal_steps",),
    bound=SOLVED,
)
def reduced_variables():
    for name in NAMES:
        group, connection, (g, x, G) = GROUPS[name], random_connection(name), motion(name)
        omega, (system, start) = omegas(connection, x), random_system(name)
        F = np.linalg.solve(G[:-1], G[1:])
        sigma = bundle.reduced(connection, g, x)
        yield off(matrices(group, sigma), np.linalg.solve(F, omega))
        lift = [np.eye(len(G[0]))]
        for step in omega:
            lift.append(lift[-1] @ step)
        yield off(matrices(group, bundle.horizontal_lift(connection, x)), np.stack(lift))
        exact = evaluate(jax.vmap(group.from_matrix), np.linalg.solve(F, omega))
        for rule, method in RULES.items():
            yield from values(
                principal_bundles.ReducedLagrangian(system, method, connection, H), rule, start, x, exact, G
            )
    yield from horizontal()


def values(l, rule: str, start, x, sigma, G):
    """F, ξ and l(x, σ, x⁺) of a step, by the library and by matrices."""
    group, first = l.system.group, at(sigma, 0)

    def found(x, sigma, x_next):
        xi = l.velocity(start, x, sigma, x_next)
        return group.matrix(l.increment(x, sigma, x_next)), xi, l.value(start, xi, x, sigma, x_next)

    F, xi, value = evaluate(found, x[0], first, x[1])
    expected, one = np.linalg.solve(G[0], G[1]), np.eye(len(G[0]))
    half = (expected - one) @ np.linalg.inv(expected + one)
    total = evaluate(partial(action, l.system, rule), G[:2], x[:2])
    yield off_each((F, xi, value), (expected, evaluate(lambda X: explicit.vee(group, 2 * X) / H, half), total))


def horizontal():
    """Ω of the discrete mechanical connection: D^R_FΛ(Ω, x, x⁺) = 0 for a kinetic energy on M × G, and on TURNED."""
    for name in ("SO3", "SE2"):
        system, x = kinetic_system(name), motion(name)[1]
        group, p = system.group, system.parameters
        connection = discrete_mechanical_connection(system, RULES["left"], H)

        def momentum(F, x, x_next, group=group, p=p):
            def value(chi):
                one, moved = jnp.eye(len(F)), F + explicit.hat(group, chi) @ F
                xi = explicit.vee(group, 2 * (moved - one) @ jnp.linalg.inv(moved + one)) / H
                z = jnp.concatenate([xi, (x_next - x) / H])
                bent = p.A @ z + jnp.sin(p.C @ x) * z
                return H * (0.5 * bent @ bent / len(z) + z @ z)

            return jax.grad(value)(jnp.zeros(group.dim))

        omega = omegas(connection, x[:2])[0]
        still = evaluate(momentum, np.eye(len(omega)), x[0], x[1])
        yield off(evaluate(momentum, omega, x[0], x[1]), np.zeros(group.dim), still)
    (system, numbers), x = turned_system(advected=False), turned_motion(1)[1]

    def along_group(F):
        def value(chi):
            G = jnp.stack([jnp.eye(3), F + explicit.hat(GROUPS["SO3"], chi) @ F])
            return turned_action("left", numbers, jnp.zeros(3), G, x)

        return jax.grad(value)(jnp.zeros(3))

    omega = omegas(discrete_mechanical_connection(system, RULES["left"], H), x)[0]
    still = evaluate(along_group, np.eye(3))
    yield off(evaluate(along_group, omega), np.zeros(3), still)


@row(
    "[Theorem 6.1](theorems/principal-bundles.md), (B35)–(B36)",
    "discrete equations on a principal bundle",
    ("theory.principal_bundles.lagrange_poincare_residual", REDUCED + "slopes"),
    (
        POINCARE + "test_the_first_variation_of_the_action_is_the_residual_on_any_sequence",
        POINCARE + "test_the_residual_vanishes_on_the_motion_and_nowhere_near_it",
    ),
    "G × Q → Q, flat or curved Q, flat V\\*",
    bound=SOLVED,
)
def theorem_6_1():
    for name in NAMES:
        (system, start), (g, x, G) = random_system(name), motion(name)
        for index, (rule, method) in enumerate(RULES.items()):
            found = principal_bundles.lagrange_poincare_residual(
                system, start, dt=H, method=method, connection=random_connection(name, index), g=g, x=x
            )
            yield off(found, evaluate(partial(stationarity, system, rule), G, x))
    (system, numbers), start, (g, x) = turned_system(), turned_start(), turned_motion(4)
    for index, (rule, method) in enumerate(RULES.items()):
        found = principal_bundles.lagrange_poincare_residual(
            system, start, dt=H, method=method, connection=turned_connection(index), g=g, x=x
        )
        yield off(found, evaluate(partial(turned_stationarity, rule, numbers, g[0] @ start.a), g, x))


@row(
    "(B37)",
    "algorithm: discrete Euler–Lagrange on the bundle",
    ("theory.unreduced.discrete_euler_lagrange_algorithm",),
    (ANY_CONNECTION, ONE_MOTION),
    bound=SOLVED,
)
def euler_lagrange_algorithm():
    yield from solved_in_pairs("n", ("SO3 with shapes", "SE2 with shapes"))


@row(
    "after (B37)",
    "algorithm: discrete Euler–Poincaré on the bundle",
    ("theory.principal_bundles.lagrange_poincare",),
    (ANY_CONNECTION,),
    "G × Q → Q, flat or curved Q, flat V\\*",
    bound=SOLVED,
)
def euler_poincare_algorithm():
    for name, rule in (("SO3", "left"), ("SE2", "trapezoidal")):
        (system, start), connection = random_system(name), random_connection(name)
        found = principal_bundles.lagrange_poincare(
            system, start, dt=H, steps=3, method=RULES[rule], connection=connection
        )
        G = matrices(system.group, found.g)
        yield off((found.time, found.x[0], G[0]),
                  (start.t + H * np.arange(4), start.n, evaluate(system.group.matrix, start.g)))  # fmt: skip
        left = evaluate(partial(stationarity, system, rule), G, found.x)
        yield off(left, np.zeros_like(left), (start.mu, start.pi))
        sigma = np.linalg.solve(np.linalg.solve(G[:-1], G[1:]), omegas(connection, found.x))
        yield off(matrices(system.group, found.sigma), sigma)
    (system, numbers), start = turned_system(), turned_start()
    found = principal_bundles.lagrange_poincare(
        system, start, dt=H, steps=3, method=RULES["trapezoidal"], connection=turned_connection()
    )
    left = evaluate(partial(turned_stationarity, "trapezoidal", numbers, start.a), found.g, found.x)
    yield off(left, np.zeros_like(left), (start.mu, start.pi))


@row(
    "[Theorem 6.2](theorems/principal-bundles.md)",
    "reduction and reconstruction on the bundle",
    ("mechanics.bundle.reduced", "mechanics.bundle.reconstructed"),
    (BUNDLES + "test_reduction_and_reconstruction_are_inverse",),
)
def theorem_6_2():
    for name in (*NAMES, "SE3"):
        group, connection, (g, x, G) = GROUPS[name], random_connection(name), motion(name, 6)
        sigma = np.linalg.solve(np.linalg.solve(G[:-1], G[1:]), omegas(connection, x))
        yield off(matrices(group, bundle.reduced(connection, g, x)), sigma)
        again = bundle.reconstructed(connection, at(g, 0), x, evaluate(jax.vmap(group.from_matrix), sigma))
        yield off(matrices(group, again), G)


@row(
    "last Remark",
    "with 𝒜 = e in the section, the equations of the product",
    (
        "theory.principal_bundles.lagrange_poincare_residual",
        "methods.LeftRectangle.equations",
        "methods.LeftRectangle.advance",
    ),
    (POINCARE + "test_with_the_trivial_connection_they_are_the_equations_of_the_core",),
    "M × G with M = ℝᵐ",
    bound=SOLVED,
)
def trivial_connection():
    for name in NAMES:
        (system, start), (g, x, G) = random_system(name), motion(name)
        group, step = system.group, RULES["left"]
        e = co.mechanics.DiscreteConnection(group, SIZE, lambda x, y, group=group: group.identity())
        found = principal_bundles.lagrange_poincare_residual(system, start, dt=H, method=step, connection=e, g=g, x=x)
        F, one = np.linalg.solve(G[:-1], G[1:]), np.eye(len(G[0]))
        halves = (F - one) @ np.linalg.inv(F + one)
        xi = evaluate(jax.vmap(lambda X, group=group: explicit.vee(group, 2 * X) / H), halves)

        def core(xi, x, system=system, start=start, step=step):
            """The equations of the second step at the momenta that the first, solved, leaves."""
            first, second = (start.replace(n=x[k], xi=xi[k], nu=(x[k + 1] - x[k]) / H) for k in (0, 1))
            off = step.equations(system, first, H)
            solved = first.replace(mu=first.mu + off[: len(first.mu)], pi=first.pi + off[len(first.mu) :])
            after = step.advance(system, solved, H)
            moved = system.group.matrix(after.g), after.n
            return -step.equations(system, second.replace(mu=after.mu, pi=after.pi), H), *moved

        placed = evaluate(group.matrix, start.g) @ F[0], x[1]
        yield off_each(evaluate(core, xi, x), (found[0], *placed))
