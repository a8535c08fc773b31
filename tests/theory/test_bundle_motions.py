"""Hopf's fibration and bundles without a global section: holonomy, curvature, charged particles; wrong uses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from bundles import apart, monopole, skew_bundle, skew_lagrangian
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.bundle import reduced
from coadjoint.models import hopf
from coadjoint.theory import bundle_motion

HOPF = hopf.fibration()
MASS, FIBRE = 1.3, 0.7


def started(lagrangian, charge: float, speed: float, axis=(0.0, 1.0, 0.0), x=(0.6, 0.0, 0.8)):
    """p over x and ṗ, with ẋ along `axis` at this speed and momentum `charge` along the fibre."""
    p = np.asarray(evaluate(HOPF.sections[0].point, np.array(x)))
    ip = np.asarray(evaluate(lambda p: hopf.connection_form(p)[0], p))
    slope = evaluate(jax.jacfwd(hopf.direction), p)
    horizontal = np.linalg.lstsq(np.vstack([slope, p, ip]), np.append(speed * np.array(axis), [0.0, 0.0]))[0]
    return p, horizontal + charge / FIBRE * ip


def latitude(c: float):
    s = np.sqrt(1 - c**2)
    return lambda t: jnp.stack([s * jnp.cos(2 * jnp.pi * t), s * jnp.sin(2 * jnp.pi * t), c + 0 * t])


def angle(R) -> float:
    return float(np.arctan2(R[1, 0], R[0, 0]))


def test_curvature_is_half_the_area_through_every_section():
    x = np.array([[0.6, 0.0, 0.8], [0.48, -0.64, -0.6], [0.0, 0.28, 0.96]])
    u = np.cross(x, [0.3, -0.5, 0.7])
    v = np.cross(x, [0.9, 0.2, -0.4])
    for i in (0, 1):
        bent = HOPF.connection(hopf.connection_form, i).curvature(x)
        found = np.einsum("kgij,ki,kj->kg", bent, u, v)[:, 0]
        assert apart(found, 0.5 * np.sum(x * np.cross(u, v), axis=1)) <= 1e-14


@pytest.mark.long
@pytest.mark.parametrize("c", [0.3, -0.6])
def test_the_holonomy_of_a_circle_is_half_its_solid_angle(c):
    """−½ · 2π(1 − c), as Foucault's pendulum turns by 2π(1 − c) a day; the sections agree modulo 2π."""
    for i in (0, 1):
        found = co.mechanics.holonomy(HOPF.connection(hopf.connection_form, i), latitude(c))
        assert abs(np.exp(1j * angle(found)) - np.exp(-1j * np.pi * (1 - c))) <= 1e-11


def test_the_lift_of_a_loop_through_both_poles_turns_by_half_its_solid_angle():
    """A lune between two meridians, 2δ: phases of ⟨p, p⁺⟩ are parallel transport along great circles, exactly."""
    delta, t = 0.7, np.linspace(0, np.pi, 9)
    down = np.stack([np.sin(t), 0 * t, np.cos(t)], axis=1)
    up = np.stack([np.cos(delta) * np.sin(t), np.sin(delta) * np.sin(t), np.cos(t)], axis=1)[::-1]
    p = HOPF.horizontal_lift(hopf.phase, np.concatenate([down, up[1:]]), [1.0, 0.0, 0.0, 0.0])
    assert abs(p[-1] @ [1, 1j, 0, 0] - np.exp(-1j * delta)) <= 1e-14
    octant = [[0.6, 0.8, 0.0], [0.0, 0.0, 1.0], [-0.8, 0.6, 0.0], [0.6, 0.8, 0.0]]
    turned = co.mechanics.holonomy(HOPF.discrete_connection(hopf.phase, 0), octant)
    assert abs(angle(turned) - np.pi / 4) <= 1e-15


def test_a_state_that_is_carried_is_the_same_covector_of_the_bundle():
    """⟨μ, ξ⟩ + ⟨π, v⟩ of a velocity of P, whose fibre part through the other section is ξ − θ̇ of χ = R(θ)."""
    x, v = np.array([0.6, 0.0, 0.8]), np.array([0.4, 0.9, -0.3])
    mu, pi, xi, g = (
        np.array([0.7]),
        np.array([0.4, -0.5, -0.3]),
        1.3,
        np.asarray(evaluate(co.SO2().exp, np.array([0.9]))),
    )
    state = co.State(t=0.0, g=g, n=x, nu=v, xi=np.array([xi]), a=np.zeros(0), mu=mu, pi=pi, places=None)
    found = evaluate(lambda s: HOPF.carried(0, 1, s), state)
    ends = [angle(HOPF.transition(0, 1, y / np.linalg.norm(y))) for y in (x - 1e-6 * v, x + 1e-6 * v)]
    turning = (ends[1] - ends[0]) / 2e-6
    before, after = mu[0] * xi + pi @ v, found.mu[0] * (xi - turning) + found.pi @ v
    assert after == pytest.approx(before, abs=1e-9) and abs(turning) > 0.1 and abs(found.pi @ x) < 1e-15
    np.testing.assert_allclose(HOPF.point(1, found.g, x), HOPF.point(0, g, x), atol=1e-14)
    assert found.xi.tolist() == [xi] and found.nu.tolist() == v.tolist()


@cache
def cyclotron(margin: float, charge: float = 0.9, dt: float = 0.05, steps: int = 160):
    lagrangian = monopole(MASS, FIBRE)
    return bundle_motion(HOPF, lagrangian, *started(lagrangian, charge, 0.7), dt=dt, steps=steps, margin=margin)


@pytest.mark.long
def test_a_charged_particle_runs_around_the_cyclotron_circle_through_both_sections():
    """cot ρ = e/(2mv) of the angle ρ about the axis m x × ẋ − ½ex; the momentum e of the fibre is kept."""
    run, charge, speed = cyclotron(0.2), 0.9, 0.7
    assert len(set(run.section)) == 2 and run.x[:, 2].min() < -0.8
    x, v = np.array([0.6, 0.0, 0.8]), np.array([0.0, speed, 0.0])
    axis = MASS * np.cross(x, v) - 0.5 * charge * x
    axis /= np.linalg.norm(axis)
    assert np.max(np.abs(run.x @ axis - x @ axis)) <= 1e-13
    assert abs(abs(x @ axis) - np.cos(np.arctan(2 * MASS * speed / charge))) <= 1e-15
    assert np.max(np.abs(run.momentum - charge)) <= 1e-14


@pytest.mark.long
def test_a_particle_has_the_phase_of_its_momentum_and_of_its_circle():
    """After a turn around the circle p has turned by eT/I − ½ · 2π(1 − cos ρ), of order 2 in dt."""
    charge, speed = 0.9, 0.7
    errors = []
    cot = charge / (2 * MASS * speed)
    rho = np.arctan2(1.0, cot)
    period = 2 * np.pi * np.sin(rho) / speed
    for steps in (200, 400):
        run = cyclotron(0.2, charge, period / steps, steps)
        a, b = (run.p[k, ::2] + 1j * run.p[k, 1::2] for k in (0, -1))
        phase = np.exp(1j * (charge * period / FIBRE + np.pi * (1 - np.cos(rho))))
        errors.append(abs(np.conj(a) @ b - phase))
    print(errors)
    assert errors[1] < 1e-3 and abs(np.log2(errors[0] / errors[1]) - 2) < 0.05


@pytest.mark.long
def test_the_motion_upstairs_is_stationary_and_does_not_know_where_sections_change():
    """D₂L(p, p⁺) + D₁L(p⁺, p⁺⁺) = 0 on T*S³ at every node, of a charged spherical pendulum and of SO(3) × ℝ²."""
    heavy = monopole(MASS, FIBRE, 2.0)
    start = started(heavy, 1.5, 0.8)
    p = np.concatenate([np.ravel(co.SO3().basis[0] @ co.SO3().basis[0] + np.eye(3) + co.SO3().basis[0]), [-0.8, 0.1]])
    skew = (
        p,
        np.concatenate(
            [np.ravel(p[:9].reshape(3, 3) @ np.einsum("kij,k", co.SO3().basis, [0.4, -0.9, 0.6])), [0.9, 0.3]]
        ),
    )
    h = 0.05
    for bundle, lagrangian, begin in ((HOPF, heavy, start), (skew_bundle(), skew_lagrangian, skew)):
        P, group = bundle.total, bundle.group
        runs = [bundle_motion(bundle, lagrangian, *begin, dt=h, steps=60, margin=m) for m in (0.1, 0.5, 0.95)]
        changes = [tuple(np.flatnonzero(np.diff(run.section))) for run in runs]
        assert len(set(changes)) == 3 and all(changes), changes

        def left(before, here, after, P=P, group=group, lagrangian=lagrangian):
            def L(p, q):
                return h * lagrangian(0.5 * (p + q), (q - p) / h)

            return P.project(group, here, jax.grad(L, 1)(before, here) + jax.grad(L)(here, after))

        for run in runs:
            assert apart(run.p, runs[0].p) <= 2e-12
            residual = evaluate(jax.vmap(left), run.p[:-2], run.p[1:-1], run.p[2:])
            assert np.max(np.abs(residual)) <= 1e-12
            assert np.max(np.abs(run.momentum - run.momentum[0])) <= 1e-13


@pytest.mark.long
def test_lagrange_poincares_equations_hold_through_every_section_whatever_the_connection():
    lagrangian, run = monopole(MASS, FIBRE), cyclotron(0.2)
    held = (np.abs(run.x[:, 2]) < 0.8).argmin()
    assert held > 8
    p, x = run.p[:8], run.x[:8]
    for i in (0, 1):
        system = co.theory.local_system(HOPF, lagrangian, i)
        g = evaluate(jax.vmap(lambda p, i=i: HOPF.trivialised(i, p)[0]), p)
        F = evaluate(lambda g, h: g.T @ h, g[0], g[1])
        start = system.state(g=g[0], q=x[0], xi=[angle(F) / 0.05])
        start = start.replace(mu=run.momentum[0], pi=np.zeros(3), from_velocities=False)
        for connection in (HOPF.discrete_connection(hopf.phase, i), bent(HOPF.discrete_connection(hopf.phase, i))):
            residual = co.theory.lagrange_poincare_residual(
                system, start, dt=0.05, method=co.methods.GroupVariational(), connection=connection, g=g, x=x
            )
            assert residual.shape == (6, 3) and np.max(np.abs(residual)) <= 1e-12
            assert reduced(connection, g, x).shape == (7, 2, 2)


def bent(connection):
    """Another connection."""

    def increment(x, y):
        return connection.increment(x, y) @ co.SO2().exp(jnp.stack([0.3 * (y[0] - x[0]) * x[1]]))

    return co.mechanics.DiscreteConnection(connection.group, 3, increment, shapes=connection.shapes)


@pytest.mark.long
def test_a_particle_is_a_symmetric_top_whose_run_on_su2_gives_the_same_points():
    """p = a + bj as a unit quaternion, g = p̄: g ↦ hg is a symmetry, too, so that L(p, p⁺) = Λ(F) with F = g⁻¹g⁺."""
    group, lagrangian, h, run = co.groups.UnitQuaternion(), monopole(MASS, FIBRE), 0.05, cyclotron(0.2)
    mirror = np.array([1.0, -1.0, -1.0, -1.0])
    one = np.array([1.0, 0.0, 0.0, 0.0])

    def discrete(F, h):
        return h * lagrangian(0.5 * (F + one), (one - F) / h)

    top = co.System(group, group_lagrangian=discrete)
    p, velocity = started(lagrangian, 0.9, 0.7)

    def local(p, velocity):
        g = mirror * p
        spins = jax.vmap(lambda e: jax.jvp(lambda k: group.compose(g, k), (group.identity(),), (group.tangent(e),))[1])
        columns = spins(jnp.eye(3)) * mirror
        momentum = jax.grad(lagrangian, argnums=1)(p, velocity)
        return columns @ momentum, jnp.linalg.lstsq(columns.T, velocity)[0]

    mu, xi = evaluate(local, p, velocity)
    start = top.state(g=mirror * p, xi=xi).replace(mu=mu, from_velocities=False)
    above = co.simulate(top, start, dt=h, steps=160, method=co.methods.GroupVariational())
    print(apart(above.records.g * mirror, run.p))
    assert apart(above.records.g * mirror, run.p) <= 1e-12


@dataclass(frozen=True)
class Frames(co.spaces.Representation):
    """Matrices R, (9,), that turn about their third axis: g·R = R diag(g, 1)ᵀ."""

    def ambient(self, group) -> int:
        return 9

    def act(self, group, g, x):
        R = jnp.reshape(x, (3, 3))
        return jnp.ravel(jnp.concatenate([R[:, :2] @ g.T, R[:, 2:]], axis=1))


def frames() -> co.mechanics.PrincipalBundle:
    """SO(3) → S², R ↦ Re₃: the frames at a point on the surface of a ball, through the shortest turns to it."""

    def shortest(sign, first):
        def section(x):
            K = co.SO3().hat(jnp.stack([-sign * x[1], sign * x[0], 0 * x[0]]))
            return jnp.ravel((jnp.eye(3) + K + K @ K / (1 + sign * x[2])) @ first)

        return co.mechanics.Section(section, lambda x: 1 + sign * x[2])

    def orthonormal(p):
        R = jnp.reshape(p, (3, 3))
        return (R.T @ R - jnp.eye(3))[np.triu_indices(3)]

    return co.mechanics.PrincipalBundle(
        co.SO2(), co.spaces.Submanifold(orthonormal, Frames()), co.Sphere(co.Trivial(3)), lambda p: p[2::3],
        lambda p, q: (jnp.reshape(q, (3, 3)).T @ jnp.reshape(p, (3, 3)))[:2, :2],
        (shortest(1, np.eye(3)), shortest(-1, np.diag([1.0, -1.0, -1.0]))),
    )  # fmt: skip


def spin(p):
    """𝒜(R)V = −ω₃ as a row (1, 9), for R ↦ R diag(g, 1)ᵀ."""
    R = jnp.reshape(p, (3, 3))
    return -jnp.ravel(jnp.outer(R[:, 1], jnp.array([1.0, 0.0, 0.0])))[None]


@pytest.mark.long
@pytest.mark.parametrize("c", [0.3, -0.6])
def test_a_frame_that_does_not_spin_turns_as_foucaults_pendulum(c):
    """On SO(3) → S² the curvature is the area, and a circle of latitude turns a frame by its solid angle 2π(1 − c)."""
    bundle, x = frames(), np.array([0.48, -0.64, 0.6])
    u, v = np.cross(x, [0.3, -0.5, 0.7]), np.cross(x, [0.9, 0.2, -0.4])
    for i in (0, 1):
        connection = bundle.connection(spin, i)
        assert abs(u @ connection.curvature(x)[0] @ v - x @ np.cross(u, v)) <= 1e-14
        turned = angle(co.mechanics.holonomy(connection, latitude(c)))
        assert abs(np.exp(1j * turned) - np.exp(-2j * np.pi * (1 - c))) <= 1e-11


@pytest.mark.long
def test_a_heavy_symmetric_top_moves_as_in_mechanics_while_its_axis_goes_through_both_sections():
    """ℓ = ½tr(V D Vᵀ) − wR₃₃ with J = tr D − D, of order 2 against co.simulate on SO(3) with an advected vertical."""
    bundle, D, weight, duration = frames(), np.diag([0.6, 0.6, 0.9]), 6.0, 2.0
    J, omega = np.trace(D) - np.diag(D), np.array([0.4, 0.7, 0.8])
    R = np.asarray(evaluate(co.SO3().exp, np.array([0.2, 0.9, -0.1])))
    top = co.System(co.SO3(), lambda xi, a: 0.5 * xi @ (J * xi) - weight * a[2], advected=co.Defining())
    start = top.state(g=R, xi=omega, a0=[0, 0, 1])
    run = co.simulate(top, start, dt=0.002, duration=duration, method=co.Suzuki4(co.Midpoint()), monitors=False)

    def lagrangian(p, v):
        V = jnp.reshape(v, (3, 3))
        return 0.5 * jnp.trace(V @ D @ V.T) - weight * p[8]

    errors = []
    for steps in (200, 400):
        velocity = np.ravel(R @ np.asarray(evaluate(co.SO3().hat, omega)))
        found = co.theory.bundle_motion(bundle, lagrangian, np.ravel(R), velocity, dt=duration / steps, steps=steps)
        errors.append(apart(found.p[-1].reshape(3, 3), run.records.g[-1]))
        assert len(set(found.section)) == 2 and np.max(np.abs(found.momentum + J[2] * omega[2])) <= 1e-12
    print(errors)
    assert errors[1] < 1e-2 and abs(np.log2(errors[0] / errors[1]) - 2) < 0.1


@pytest.mark.long
def test_a_charged_spherical_pendulum_converges_with_order_2_to_an_independent_program():
    """mẍ = −ge₃ − λx + ½e ẋ × x in ℝ³ by DOP853; without charge the pendulum of mechanics."""
    weight, charge, x, v = 2.0, 1.5, np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.8, 0.0])
    lagrangian = monopole(MASS, FIBRE, weight)

    def field(t, z):
        force = np.array([0.0, 0.0, -weight]) + 0.5 * charge * np.cross(z[3:], z[:3])
        return np.concatenate([z[3:], (force - (force @ z[:3]) * z[:3]) / MASS - (z[3:] @ z[3:]) * z[:3]])

    exact = solve_ivp(field, (0, 4), np.concatenate([x, v]), method="DOP853", rtol=1e-12, atol=1e-13).y[:3, -1]
    errors = [
        np.max(
            np.abs(bundle_motion(HOPF, lagrangian, *started(lagrangian, charge, 0.8), dt=4 / n, steps=n).x[-1] - exact)
        )
        for n in (100, 200, 400)
    ]
    print(errors)
    assert errors[-1] < 1e-3 and abs(np.log2(errors[1] / errors[2]) - 2) < 0.05


def across(p):
    """A row (1, 4) that vanishes along the fibre and does not turn with p."""
    along = hopf.connection_form(p)
    return jnp.array([[1.0, 0.0, 0.0, 0.0]]) - along[:, :1] * along


P0 = np.array([1.0, 0.0, 0.0, 0.0])
WRONG = {
    "a projection that turns": (
        lambda: replace(HOPF, project=lambda p: p[:3]),
        "must satisfy π(g·p) = π(p), but is off by",
    ),
    "an element that is not between": (
        lambda: replace(HOPF, between=lambda p, q: hopf.phase(q, p)),
        "must satisfy between(p, g·p) = g, but is off by",
    ),
    "a section of another point": (
        lambda: replace(
            HOPF, sections=[co.mechanics.Section(lambda x: HOPF.sections[0].point(-x), lambda x: 2 + x[2])]
        ),
        "must satisfy π(s(x)) = x, but is off by",
    ),
    "shapes that no section holds": (
        lambda: replace(HOPF, sections=[co.mechanics.Section(HOPF.sections[0].point, lambda x: x[2] - 2)]),
        "Some section must be defined at every shape, but none is at",
    ),
    "no section": (lambda: replace(HOPF, sections=()), "must be at least one co.mechanics.Section"),
    "an element in place of a section's number": (
        lambda: HOPF.point(np.eye(2), np.array([0.6, 0.0, 0.8]), 0),
        "`i` must be a whole number from 0 to 1",
    ),
    "a velocity that leaves P": (
        lambda: bundle_motion(HOPF, lambda p, v: v @ v, np.eye(4)[0], np.ones(4), dt=0.1, steps=1),
        "`velocity` must be tangent to the space at `p`, but leaves it by 1",
    ),
    "what is no section": (
        lambda: replace(HOPF, sections=[HOPF.sections[0].point]),
        "must be a tuple of co.mechanics.Section",
    ),
    "what is no space": (lambda: replace(HOPF, shapes="S2"), "must be a space such as"),
    "what is no group": (lambda: replace(HOPF, group="U1"), "must be a Lie group such as"),
    "a section that is not there": (
        lambda: HOPF.connection(hopf.connection_form, 2),
        "must be a whole number from 0 to 1",
    ),
    "a form of another fibre": (
        lambda: HOPF.connection(lambda p: 2 * hopf.connection_form(p)),
        "must satisfy 𝒜(p)(ξ·p) = ξ, but is off by",
    ),
    "a form that is not equivariant": (
        lambda: HOPF.connection(lambda p: hopf.connection_form(p) + across(p)),
        "𝒜(g·p)(g·v) = Ad_g 𝒜(p)v, but is off by",
    ),
    "a discrete form that is not equivariant": (
        lambda: HOPF.discrete_connection(lambda p, q: hopf.phase(q, p)),
        "must satisfy 𝒜(g·p, g⁺·p⁺)",
    ),
    "steps over a half turn": (
        lambda: HOPF.horizontal_lift(hopf.phase, [[0, 0, 1.0], [0, 0, -1.0]], P0),
        "must lie in the domain of one section",
    ),
    "a start over another shape": (
        lambda: HOPF.horizontal_lift(hopf.phase, [[1.0, 0, 0], [0, 1.0, 0]], P0),
        "must satisfy π(p) = x₀",
    ),
    "a start off the space": (
        lambda: bundle_motion(HOPF, monopole(1, 1), 2 * P0, P0, dt=0.1, steps=1),
        "must be a unit vector",
    ),
    "a Lagrangian that turns": (
        lambda: bundle_motion(HOPF, lambda p, v: v @ v + p[0], P0, 0 * P0, dt=0.1, steps=1),
        "must be invariant",
    ),
    "what is no bundle": (
        lambda: bundle_motion("S3", monopole(1, 1), P0, P0, dt=0.1, steps=1),
        "must be a co.mechanics.Prin",
    ),
    "what is no Lagrangian": (
        lambda: bundle_motion(HOPF, 1.0, P0, P0, dt=0.1, steps=1),
        "must be a function (p, velocity)",
    ),
    "no steps": (lambda: bundle_motion(HOPF, monopole(1, 1), P0, P0, dt=0.1, steps=0), "from 1"),
}


def test_points_and_changes_of_section_are_float64_outside_of_traces():
    x = np.array([0.6, 0.0, 0.8])
    g = HOPF.transition(0, 1, x)
    p = HOPF.point(1, np.eye(2), x)
    found, there = HOPF.trivialised(0, p)
    for value in (g, p, found, there):
        assert np.asarray(value).dtype == np.float64
    np.testing.assert_allclose(found, g, rtol=0, atol=1e-15)
    np.testing.assert_allclose(there, x, rtol=0, atol=1e-15)


@pytest.mark.parametrize("case", sorted(WRONG))
def test_what_is_no_bundle_is_refused_in_one_sentence(case):
    call, says = WRONG[case]
    with pytest.raises(co.errors.CoadjointError) as caught:
        call()
    assert says in str(caught.value) and str(caught.value).count(". ") == 0, caught.value
