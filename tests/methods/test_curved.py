"""Curved additional dynamics: a particle on the unit sphere S² ⊂ ℝ³ under SO(3) (mathematics: section 5, Curved Q)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.noether import spatial_momentum
from stepping import Stepper
from systems import RULES

GRAVITY = 9.81
PARAMETERS = {"J": np.diag([2.0, 1.5, 1.2]), "mass": 0.8, "couple": 0.7}


def pendulum(xi, n, nu, a, p):
    """A spherical pendulum on a free carrier: nothing couples them but the frame."""
    return 0.5 * xi @ p.J @ xi + 0.5 * p.mass * nu @ nu + p.mass * GRAVITY * n @ a


def coupled(xi, n, nu, a, p):
    """The bob feels the body: an anisotropic mass in the body frame and a spring to the body's axis."""
    inertia = p.mass * jnp.array([1.0, 1.4, 0.8])
    return pendulum(xi, n, nu, a, p) + 0.5 * nu @ (inertia * nu) + p.couple * jnp.sin(n[2]) * (1 + 0.3 * xi @ nu)


SYSTEMS = {"pendulum": pendulum, "coupled": coupled}


def system_on(space, lagrangian) -> tuple[co.System, co.State]:
    system = co.System(co.SO3(), lagrangian, additional=space, advected=co.Defining(), parameters=PARAMETERS)
    q, push = np.array([0.6, 0.0, 0.8]), np.array([0.3, 0.9, 0.2])
    start = system.state(
        g=co.attitude.zyx(0.3, -0.2, 0.5), q=q, qdot=push - (push @ q) * q, xi=[0.4, -0.3, 0.7], a0=[0, 0, 1]
    )
    return system, start


@dataclass(frozen=True)
class OtherChart(co.Sphere):
    """The same sphere with the exponential as retraction and a frame turned by one radian about the point."""

    def frame(self, group, x):
        frame = super().frame(group, x)
        c, s = np.cos(1.0), np.sin(1.0)
        return frame @ jnp.array([[c, -s], [s, c]])

    def difference(self, group, x, u):
        square = jnp.where(u @ u > 0, u @ u, 1.0)  # at u = 0 the root has no derivative
        angle = jnp.where(u @ u > 0, jnp.sqrt(square), 0.0)
        return jnp.sinc(angle / np.pi) * u - 2 * jnp.sin(angle / 2) ** 2 * x


def end_of(lagrangian, method, steps, duration=0.5, space=None):
    system, start = system_on(space or co.Sphere(), lagrangian)
    return Stepper(system, method, compiled=True).final(start, duration / steps, steps)


def distance(one: co.State, other: co.State) -> float:
    """The largest difference in attitude, place and momenta, of order one all of them."""
    return max(np.max(np.abs(getattr(one, k) - getattr(other, k))) for k in ("g", "n", "a", "mu", "pi"))


@pytest.fixture(scope="module", params=SYSTEMS)
def problem(request):
    """A Lagrangian with its motion, by Suzuki's fourth order over two rules that agree to 1e-10."""
    lagrangian = SYSTEMS[request.param]
    exact = end_of(lagrangian, co.Suzuki4(co.Midpoint()), 400)
    other = end_of(lagrangian, co.Suzuki4(co.Trapezoidal()), 400)
    assert distance(exact, other) < 1e-10
    return lagrangian, exact


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", RULES)
def test_rules_have_their_orders_on_the_sphere(problem, rule):
    lagrangian, exact = problem
    method = RULES[rule](co.Cayley())
    coarse, fine = (distance(end_of(lagrangian, method, steps), exact) for steps in (80, 160))
    assert np.log2(coarse / fine) == pytest.approx(method.order, abs=0.1)


@pytest.mark.long
def test_spherical_pendulum_alone_follows_its_equation():
    """The pendulum does not feel its carrier: q̈ = g e_z − (g e_z·q + |q̇|²) q, integrated by scipy."""
    exact = end_of(pendulum, co.Suzuki4(co.Midpoint()), 400)
    _, start = system_on(co.Sphere(), pendulum)
    down = np.array([0, 0, GRAVITY])

    def rate(t, y):
        q, v = y[:3], y[3:]
        return np.concatenate([v, down - (down @ q + v @ v) * q])

    found = solve_ivp(rate, (0, 0.5), np.concatenate([start.q, start.qdot]), rtol=1e-12, atol=1e-13).y[:3, -1]
    np.testing.assert_allclose(exact.g @ exact.n, found, rtol=0, atol=1e-9)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("name", SYSTEMS)
def test_vertical_momentum_is_kept_at_round_off_over_2000_steps(name, rule):
    """Relative to |μ| + |π|; round-off adds up like a random walk, 2000^½ · 2e-16 ≈ 1e-14."""
    system, start = system_on(co.Sphere(), SYSTEMS[name])
    stepper = Stepper(system, RULES[rule](co.Exponential()), compiled=True)
    state, worst, off = stepper.method.begin(system, start, 0.02), 0.0, 0.0
    vertical = tabulate(lambda s: spatial_momentum(system, s)[2], state)
    first = vertical(state)
    for _ in range(20):
        state = stepper.final(state, 0.02, 100)
        worst = max(worst, abs(vertical(state) - first))
        off = max(off, abs(state.n @ state.n - 1), abs(state.n @ state.pi))
    scale = np.linalg.norm(start.mu) + np.linalg.norm(start.pi)
    assert worst <= 1e-13 * scale
    assert off <= 1e-12


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", ["trapezoidal", "pair"])
def test_the_bob_stays_on_the_sphere_over_40000_steps(rule):
    """Round-off in |n| − 1 must not grow from step to step: it would go into π, and so into the vertical momentum."""
    system, start = system_on(co.Sphere(), coupled)
    records = co.trajectory(
        system, start, dt=0.05, steps=40_000, method=RULES[rule](co.Cayley()), save_every=10
    ).records
    assert np.max(np.abs(np.sum(records.n**2, axis=1) - 1)) <= 1e-13
    vertical = evaluate(jax.vmap(lambda s: spatial_momentum(system, s)[2]), records)
    assert np.max(np.abs(vertical - vertical[0])) <= 2e-13 * (np.linalg.norm(start.mu) + np.linalg.norm(start.pi))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", RULES)
def test_result_does_not_depend_on_frame_and_retraction(rule):
    """Newton ends within 1e-14 of the same solution whatever its coordinates."""
    method = RULES[rule](co.Cayley())
    one, other = (end_of(coupled, method, 10, space=space) for space in (co.Sphere(), OtherChart()))
    assert distance(one, other) <= 2e-13 * np.max(np.abs(one.mu))


@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", [rule for rule in RULES if rule != "midpoint"])
def test_result_does_not_depend_on_the_extension_off_the_sphere(rule):
    """ℓ + (|n|² − 1)·(…) is the same Lagrangian for rules with nodes on the sphere; a chord's midpoint lies inside."""

    def extended(xi, n, nu, a, p):
        return coupled(xi, n, nu, a, p) + (n @ n - 1) * (2.0 + xi[0] + jnp.sin(n[1]))

    method = RULES[rule](co.Cayley())
    one, other = (end_of(lagrangian, method, 10) for lagrangian in (coupled, extended))
    assert distance(one, other) <= 2e-13 * np.max(np.abs(one.mu))


def test_another_chart_is_another_chart():
    """The check above compares two things: ρ and E differ."""
    space, other, group = co.Sphere(), OtherChart(), co.SO3()
    x, y = np.array([0.6, 0.0, 0.8]), np.array([0.3, -0.4])
    here, there = (tabulate(partial(s.tangent, group), x, y)(x, y) for s in (space, other))
    assert np.max(np.abs(here - there)) > 0.1
    one, two = (tabulate(partial(s.difference, group), x, here)(x, here) for s in (space, other))
    assert np.max(np.abs(one - two)) > 1e-2
    np.testing.assert_allclose(np.linalg.norm(x + two), 1.0, atol=1e-15)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
@pytest.mark.parametrize(("q", "v"), [([0, 0, 1], [1, 0, 0]), ([0, 1, 0], [1, 0, 0]), ([0, 0, -1], [0.6, 0.8, 0])])
def test_a_point_moves_where_it_is_pushed_also_where_the_frame_of_the_sphere_has_its_seam(q, v, backend):
    """At q₁ = 0 the frame changes sign: it must stay that of n while the equations of a step are solved."""
    body = co.System(
        co.SO3(), lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Sphere(), name="free point"
    )
    run = co.simulate(body, body.state(q=q, qdot=v), dt=0.01, steps=20, backend=backend)
    np.testing.assert_allclose(run.dataset.q[1], np.add(q, np.multiply(0.01, v)), atol=1e-4)
    assert run.largest("newton_residual") < 1e-13
