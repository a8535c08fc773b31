"""Rows of Lagrangians that are linear in the velocities: their motion, and the projected midpoint rule."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from theorem_row import Rows, off, off_each

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import phase_space
from coadjoint.methods import projected_midpoint
from systems import generator

ROWS = Rows("flat Q, every V\\*, ℓ linear in (ξ, ν)")
row = ROWS.add

H = 0.2
TESTS = "methods/test_projected_midpoint.py::"


def turning_momenta(n, a):
    """ϑ on SO(3) with turning n and a, all of whose components depend on the place."""
    return n + 0.2 * jnp.cross(n, a) + 0.1 * (n @ n) * a, 0.3 * jnp.sin(n[::-1]) * (a @ n)


def turning_energy(n, a):
    return 0.5 * n @ (n / jnp.array([1.0, 1.3, 0.8])) + 0.4 * jnp.sin(n[0]) * a[2] + 0.2 * a @ a * n[1]


def turning_lagrangian(xi, n, nu, a):
    mu, pi = turning_momenta(n, a)
    return mu @ xi + pi @ nu - turning_energy(n, a)


TURNING = co.System(co.SO3(), turning_lagrangian, additional=co.Defining(), advected=co.Defining())


def predators(x, y):
    """ϑ of Lotka and Volterra's equations, of which one component is that of a total derivative of second degree."""
    return jnp.log(y) / x + y, x


def predation(xi, n, nu):
    return jnp.stack(predators(*n)) @ nu - (n[0] + n[1] - 2 * jnp.log(n[0]) - jnp.log(n[1]))


PREDATORS = co.System(co.Translation(0), predation, additional=co.Trivial(2))


def place(name: str):
    """A random state on SO(3), with the momenta of its place."""
    random = generator("phase space", name)
    g = co.attitude.zyx(*random.normal(size=3))
    q, a0 = random.normal(size=(2, 3))
    return TURNING.state(g=g, q=q, a0=a0), random


@row(
    "(P20)–(P24), first order",
    "(ξ, ν) with ω (ξ, ν) = ∇H, ω = dϑ, of Lagrangians that are linear in them",
    ("mechanics.phase_space.velocities",),
    (TESTS + "test_order_momentum_and_balance_hold_on_a_group_whose_shifts_turn",),
)
def first_order():
    """(P20), (P21) hold along ṅ = ν + n × ξ, ȧ = a × ξ with vector products; and ẋ = x(y − 1), ẏ = y(2 − x)."""
    for k in range(3):
        state, _ = place(f"motion {k}")

        def sides(s):
            xi, nu, _ = phase_space.velocities(TURNING, s)
            moving = nu + jnp.cross(s.n, xi), jnp.cross(s.a, xi)
            (mu, pi), (mu_dot, pi_dot) = jax.jvp(turning_momenta, (s.n, s.a), moving)
            b, c = jax.grad(turning_lagrangian, argnums=(1, 3))(xi, s.n, nu, s.a)
            turned = jnp.cross(mu, xi) + jnp.cross(b, s.n) + jnp.cross(c, s.a) + jnp.cross(pi, nu)
            return (mu_dot, pi_dot), (turned, b + jnp.cross(pi, xi))

        yield off_each(*evaluate(sides, state))
    x, y = 1.3, 0.6
    found = evaluate(lambda s: phase_space.velocities(PREDATORS, s), PREDATORS.state(q=[x, y]))
    yield off(found.nu, np.array([x * (y - 1), y * (2 - x)]))


def cayley(w):
    """(I − ŵ/2)⁻¹(I + ŵ/2)."""
    half = jnp.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]) / 2
    return jnp.linalg.solve(jnp.eye(3) - half, jnp.eye(3) + half)


def lifted(n, a, shift, carried):
    """κ and D of a shift; carried(κ): π + κ."""
    turn, way = shift

    def paired(n, a):
        mu, pi = turning_momenta(n, a)
        return mu @ turn + pi @ way

    b, c = jax.grad(paired, argnums=(0, 1))(n, a)
    return H * b, H * (jnp.cross(c, a) + jnp.cross(b, n)) + jnp.cross(carried(H * b), H * way)


def explicitly(R, n, a, mu, pi, xi, nu, shift):
    """The equations and the end of a step with any unknowns, by matrices."""
    F, half = cayley(H * shift[0]), cayley(H * xi / 2)
    kappa, D = lifted(n, a, shift, lambda k: pi + k)
    R, n, a, mu, pi = R @ F, F.T @ (n + H * shift[1]), F.T @ a, F.T @ (mu + D), F.T @ (pi + kappa)
    middle, held = half.T @ n + H / 2 * nu, half.T @ a
    b, c = jax.grad(turning_lagrangian, argnums=(1, 3))(xi, middle, nu, held)
    theta, rho = turning_momenta(middle, held)
    torque = H * (jnp.cross(c, held) + jnp.cross(b, middle) + jnp.cross(rho, nu))
    w = H * xi / 2
    turned = 2 * (theta + jnp.cross(w, theta) / 2 + w * (w @ theta) / 4)
    rows = turned - mu - half.T @ mu - torque, rho - half.T @ pi - H / 2 * b
    R, n, a = R @ half @ half, half.T @ (middle + H / 2 * nu), half.T @ held
    mu, pi = half.T @ (half.T @ mu + torque), half.T @ (half.T @ pi + H * b)
    R, n, a, mu, pi = R @ F.T, F @ n - H * shift[1], F @ a, F @ mu, F @ pi
    kappa, D = lifted(n, a, shift, lambda _: pi)
    mu, pi = mu - D, pi - kappa
    theta, rho = turning_momenta(n, a)
    return jnp.concatenate([rows[0], mu - theta, rows[1], pi - rho]), (R, n, a, mu, pi)


STEP = co.methods.ProjectedMidpoint()


def solved(system, state):
    """The end of a step from q, and its Jacobian, on a Q alone; by Newton's iteration on the step's own equations."""

    def equations(q, z):
        return STEP.residual(system, begun(q), H, z)

    def begun(q):
        momenta = jnp.concatenate(system.momenta(state.xi, q, jnp.zeros_like(q), state.a, 0.0))
        still = projected_midpoint.Shift(state.xi, jnp.zeros_like(q))
        return state.replace(n=q, pi=momenta, memory=still)

    def end(q, z):
        return STEP.advance(system, STEP.record(system, begun(q), H, z), H).n

    def both(q):
        z = jnp.zeros(2 * len(q))
        for _ in range(8):
            z = z - jnp.linalg.solve(jax.jacfwd(equations, argnums=1)(q, z), equations(q, z))
        by_q, by_z = (jax.jacfwd(equations, argnums=k)(q, z) for k in (0, 1))
        ahead, along = (jax.jacfwd(end, argnums=k)(q, z) for k in (0, 1))
        return end(q, z), ahead - along @ jnp.linalg.solve(by_z, by_q)

    return evaluate(both, state.n)


@row(
    "Symplecticity for ω = dϑ",
    "the projected midpoint rule: its equations and its end; it keeps dϑ where half of ϑ vanishes, up to a total "
    "derivative of at most second degree, and changes it by O(h⁵) elsewhere",
    ("methods.ProjectedMidpoint.equations", "methods.ProjectedMidpoint.advance"),
    (TESTS + "test_the_two_form_is_kept_exactly_in_one_gauge_and_to_order_5_in_others",),
)
def projected():
    for k in range(2):
        state, random = place(f"step {k}")
        xi, nu, *shift = 0.5 * random.normal(size=(4, 3))
        record = state.replace(xi=xi, nu=nu, memory=projected_midpoint.Shift(*shift))
        rows, after = evaluate(lambda s: (STEP.equations(TURNING, s, H), STEP.advance(TURNING, s, H)), record)
        given = record.g, record.n, record.a, record.mu, record.pi, xi, nu, tuple(shift)
        expected, end = evaluate(explicitly, *given)
        yield off(rows, expected)
        yield off_each((after.g, after.n, after.a, after.mu, after.pi), end)
    there, slope = solved(PREDATORS, PREDATORS.state(q=[1.3, 0.7]).replace(xi=np.zeros(0)))
    # dϑ = (∂_y ϑ_x − ∂_x ϑ_y) dy ∧ dx = dy ∧ dx / xy.
    yield off(np.linalg.det(slope) / (there[0] * there[1]), np.float64(1 / (1.3 * 0.7)))
