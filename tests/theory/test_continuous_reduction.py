"""Continuous reduction and its inverse (P10), (P15)–(P17), and how small a loss of symmetry `reduce` sees."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous
from coadjoint.mechanics.copies import replace_parameters
from systems import element, generator, random_system

J, M, ARM = np.array([1.0, 1.7, 2.3]), np.diag([1.5, 1.8, 2.2]), np.array([0.1, 0.05, 0.4])
SPACES = {"additional": co.Defining(), "advected": {"down": co.Defining(), "field": co.Defining()}}


def body(lean=0.0):
    """A top on a moving base in a field: L in the space frame, not quadratic; `lean` breaks the symmetry."""

    def lagrangian(R, R_dot, q, q_dot, a0, *, t):
        omega = co.SO3().vee(R.T @ R_dot)
        v = R.T @ q_dot
        kinetic = 0.5 * omega @ (J * omega) + 0.5 * v @ M @ v + 0.2 * jnp.sin(v @ omega)
        potential = q @ a0.down + (R @ ARM) @ a0.field + 0.3 * jnp.sin(t) * (q @ a0.field)
        return kinetic + 0.1 * (v @ v) ** 2 - potential + lean * jnp.cos(q[2])

    return theory.ContinuousLagrangian(co.SO3(), lagrangian, **SPACES)


def chart(x):
    return (
        co.SO3().exp(x[:1] * np.eye(3)[2] + 0.0) @ co.SO3().exp(x[1] * np.eye(3)[1]) @ co.SO3().exp(x[2] * np.eye(3)[0])
    )


@pytest.mark.long
def test_the_reduced_system_moves_as_euler_and_lagrange_say_in_coordinates():
    """(P15)–(P20): ẍ of L in Euler angles and q, turned into ξ̇ and ν̇ of the body, against the reduced system."""
    L = body()
    system = theory.reduce_continuous(L)
    random = generator("coordinates")
    x, v = random.normal(size=(2, 6))
    a0 = random.normal(size=6)

    def value(x, v):
        g, g_dot = jax.jvp(chart, (x[:3],), (v[:3],))
        return L(theory.Configuration(g, x[3:]), theory.Configuration(g_dot, v[3:]), a0, theory.Instant(0.7))

    def body_frame(x, v):
        g, g_dot = jax.jvp(chart, (x[:3],), (v[:3],))
        return theory.body_velocity(co.SO3(), g, g_dot), g.T @ v[3:]

    def accelerated(x, v):
        mixed = jax.jvp(lambda x: jax.grad(value, argnums=1)(x, v), (x,), (v,))[1]
        force = jax.grad(value)(x, v) - mixed
        return jax.jvp(body_frame, (x, v), (v, jnp.linalg.solve(jax.hessian(value, argnums=1)(x, v), force)))

    (xi, _), (xi_dot, nu_dot) = evaluate(accelerated, x, v)
    g = evaluate(chart, x[:3])
    start = system.state(g=g, q=x[3:], xi=xi, qdot=v[3:], a0={"down": a0[:3], "field": a0[3:]}, t=0.7)
    slope = evaluate(lambda s: continuous.vector_field(system, s), start)
    np.testing.assert_allclose(slope.xi, xi_dot, rtol=0, atol=1e-12 * np.max(np.abs(xi_dot)))
    np.testing.assert_allclose(slope.nu, nu_dot, rtol=0, atol=1e-12 * np.max(np.abs(nu_dot)))


@pytest.mark.cases(1)
@pytest.mark.parametrize("world", ["SO3 alone", "SO3", "SE3", "SL2", "SO3xSE2", "curved and flat"])
def test_reduction_undoes_the_inverse(world):
    """ℓ ↦ L ↦ ℓ on random systems, two advected parameters and a curved Q among them; L is left-invariant."""
    system, start = random_system(world)
    group, Q, V = system.places
    L = theory.unreduce_continuous(system)
    q = None if Q.flat else evaluate(lambda s: s.q, start)
    named = None if q is None else Q.view(group, q).asdict()
    again = theory.reduce_continuous(L, named, theory.Instant(0.3))

    def both(s):
        place = s.xi, s.n, s.nu, s.a, s.t
        velocity = theory.Configuration(theory.space_velocity(group, s.g, s.xi), s.qdot)
        above = L(theory.Configuration(s.g, s.q), velocity, V.act(group, s.g, s.a), theory.Instant(s.t))
        return jnp.stack([system.reduced_lagrangian(*place), again.reduced_lagrangian(*place), above])

    values = evaluate(both, start)
    np.testing.assert_allclose(values, values[0], rtol=1e-13)


def test_a_quaternion_and_a_pair_have_tangents_in_their_own_arrays():
    for group in (co.groups.UnitQuaternion(), co.SE3(), co.DirectProduct(co.SO3(), co.SE2())):
        random = generator("tangent", repr(group))
        g, xi = element(group, random), random.normal(size=group.dim)
        found = evaluate(lambda g, xi, G=group: theory.body_velocity(G, g, theory.space_velocity(G, g, xi)), g, xi)
        np.testing.assert_allclose(found, xi, rtol=0, atol=1e-13)


def test_a_lagrangian_with_a_small_potential_of_the_space_frame_is_refused():
    assert theory.continuous_invariance_defect(body()) < 1e-13
    for lean in (1e-2, 1e-9):
        with pytest.raises(co.errors.LagrangianError, match=r"L\(g̃g, g̃ġ, g̃q, g̃q̇, g̃a₀\) = L\(g, ġ, q, q̇, a₀\)"):
            theory.reduce_continuous(body(lean))


@pytest.mark.cases(1)
@pytest.mark.parametrize("h", [1e-1, 1e-3, 1e-4])
def test_a_discrete_lagrangian_with_a_small_potential_is_refused_at_every_step_size(h):
    """Λ ≈ |d|²/h at far elements hides hU: the potential is seen on steps as short as h, and round-off is not."""

    def unreduced(lean):
        def function(g, q, g_next, q_next, a0, h):
            d = g.T @ (q_next - q)
            rest = jnp.trace((jnp.eye(3) - g.T @ g_next) @ np.diag(J)) / h - h * (q @ a0)
            return 0.5 * d @ M @ d / h + rest - lean * h * jnp.cos(g[2, 2])

        return theory.UnreducedLagrangian(co.SO3(), function, additional=co.Defining(), advected=co.Defining())

    assert theory.invariance_defect(unreduced(0.0), h) < 1e-12
    assert theory.reduce(unreduced(0.0), h).group_lagrangian is not None
    with pytest.raises(co.errors.LagrangianError, match="left-invariant"):
        theory.reduce(unreduced(1e-4), h)


@pytest.mark.parametrize(
    ("function", "spaces", "says"),
    [
        (lambda g, g_dot, q: 0.0, {}, r"must take \(g, g_dot\)"),
        (lambda g, q, g_dot, q_dot: 0.0, {"additional": co.Defining()}, "in this order"),
        (3, {}, "must be a Python function"),
    ],
)
def test_a_continuous_lagrangian_of_other_arguments_is_refused(function, spaces, says):
    with pytest.raises(co.errors.LagrangianError, match=says):
        theory.ContinuousLagrangian(co.SO3(), function, **spaces)


def test_a_curved_space_asks_for_a_point_and_a_discrete_system_for_its_lagrangian():
    system, _ = random_system("SO3 on a sphere")
    with pytest.raises(co.errors.ArgumentError, match="curved"):
        theory.reduce_continuous(theory.unreduce_continuous(system))
    discrete = co.System(co.SO3(), group_lagrangian=lambda F, h: jnp.trace(F) / h)
    with pytest.raises(co.errors.LagrangianError, match="discrete Lagrangian only"):
        theory.unreduce_continuous(discrete)


def test_inputs_and_internal_states_pass_through_both_ways():
    def lagrangian(xi, *, t, inputs, internal):
        return xi @ (J * xi) * (1 + 0.1 * internal.lag) + inputs.push * xi[0] * jnp.cos(t)

    system = co.System(co.SO3(), lagrangian)
    at = theory.Instant(0.4, {"push": 0.7}, {"lag": 2.0})
    L = theory.unreduce_continuous(system)
    again = theory.reduce_continuous(L, at=at)
    xi, nothing = np.array([0.3, -0.2, 0.5]), np.zeros(0)
    place = xi, nothing, nothing, nothing, at.t, at.inputs, at.internal
    values = [evaluate(lambda s=s: s.reduced_lagrangian(*place)) for s in (system, again)]
    np.testing.assert_allclose(*values, rtol=1e-15)
    with pytest.raises(co.errors.ArgumentError, match="takes inputs"):
        theory.reduce_continuous(L)


def parameterised():
    """A continuous and a discrete reduced Lagrangian with all of q, a₀ and parameters, as functions of (system, s)."""
    spaces = {"additional": co.Defining(), "advected": co.Defining()}

    def lagrangian(xi, n, nu, a, p):
        return 0.5 * xi @ (p.J * xi) + 0.5 * p.mass * nu @ nu + 0.1 * (xi @ (p.J * xi)) ** 2 - p.mass * (n @ a)

    def stepped(F, n, s, a, p, h):
        return jnp.trace((jnp.eye(3) - F) @ jnp.diag(p.J)) / h + p.mass * ((s - n) @ (s - n) / h - h * (s @ a))

    parameters = {"J": J, "mass": 1.5}
    smooth = co.System(co.SO3(), lagrangian, **spaces, parameters=parameters)
    discrete = co.System(co.SO3(), group_lagrangian=stepped, **spaces, parameters=parameters)
    vectors = generator("parameters").normal(size=(4, 3))
    turned = evaluate(co.SO3().exp, vectors[0])
    yield smooth, theory.reduce_continuous(theory.unreduce_continuous(smooth)), lambda s: s.reduced_lagrangian(*vectors)
    yield (
        discrete,
        theory.reduce(theory.unreduce(discrete)),
        lambda s: s.reduced_group_lagrangian(turned, *vectors[1:], 0.1),
    )


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", [0, 1], ids=["continuous", "discrete"])
def test_parameters_of_what_was_unreduced_are_replaced_and_differentiated_by(kind):
    system, again, value = list(parameterised())[kind]
    other = {"J": [2.0, 2.5, 3.5], "mass": 4.0}
    found, expected = (evaluate(lambda y=y: value(y)) for y in (again.replace(**other), system.replace(**other)))
    assert abs(found - expected) < 1e-13 * abs(expected)
    assert abs(expected - evaluate(lambda: value(system))) > 0.1
    slopes = [
        evaluate(jax.grad(lambda p, y=y: value(replace_parameters(y, p))), system.parameters) for y in (again, system)
    ]
    for slope, right in zip(*map(jax.tree.leaves, slopes), strict=True):
        assert np.all(right != 0)
        np.testing.assert_allclose(slope, right, rtol=1e-12)
