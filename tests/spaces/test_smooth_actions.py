"""Smooth actions that are not affine: Möbius maps, SL(2) on the projective line, and SE(2) on lines."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint import methods
from coadjoint.errors import ArgumentError, GroupError, StepError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces import Action, Representation, Submanifold
from coadjoint.spaces import action as action_module
from coadjoint.spaces.space import checked_vector
from systems import HALF_PLANE, SL2, moebius


def on_directions(g, x):
    """The angle of gu for u = (cos θ, sin θ): SL(2) on the projective line, in the chart θ."""
    u = jnp.array([jnp.cos(x[0]), jnp.sin(x[0])])
    v = g @ u
    return x + jnp.arctan2(u[0] * v[1] - u[1] * v[0], u @ v)


def on_lines(g, x):
    """SE(2) on the lines {y: y·(cos θ, sin θ) = p}, x = (θ, p)."""
    rotation, shift = g
    theta = x[0] + jnp.arctan2(rotation[1, 0], rotation[0, 0])
    return jnp.stack([theta, x[1] + shift @ jnp.stack([jnp.cos(theta), jnp.sin(theta)])])


PROJECTIVE, LINES = Action(on_directions, dim=1), Action(on_lines, dim=2)


def on_half_plane(e, x):
    """(2ae₀x + e₁ − e₂z²) of z = x + iy for ξ = [[e₀, e₁], [e₂, −e₀]]."""
    z = complex(*x)
    w = 2 * e[0] * z + e[1] - e[2] * z**2
    return [w.real, w.imag]


def of_directions(e, x):
    """−e₀ sin 2θ + e₂ cos²θ − e₁ sin²θ."""
    return [-e[0] * np.sin(2 * x[0]) + e[2] * np.cos(x[0]) ** 2 - e[1] * np.sin(x[0]) ** 2]


def of_lines(e, x):
    """(ω, v·(cos θ, sin θ)) of ξ = (ω, v)."""
    return [e[0], e[1] * np.cos(x[0]) + e[2] * np.sin(x[0])]


CASES = [(SL2, HALF_PLANE, on_half_plane), (SL2, PROJECTIVE, of_directions), (co.SE2(), LINES, of_lines)]


@pytest.mark.parametrize(("group", "space", "closed"), CASES, ids=["half plane", "projective line", "lines"])
def test_infinitesimal_action_and_diamond_are_those_of_the_closed_form(group, space, closed):
    space.require_fit(group)
    random = np.random.default_rng(3)
    for _ in range(3):
        xi, b, x = random.normal(size=group.dim), random.normal(size=space.size), space.sample(group, random)
        found = evaluate(lambda xi, x, b: (space.infinitesimal(group, xi, x), space.diamond(group, b, x)), xi, x, b)
        np.testing.assert_allclose(found[0], closed(xi, x), rtol=1e-13, atol=1e-13)
        expected = [-b @ np.array(closed(e, x)) for e in np.eye(group.dim)]
        np.testing.assert_allclose(found[1], expected, rtol=1e-13, atol=1e-13)


INERTIA = np.array([[1.5, 0.1, 0.2], [0.1, 1.2, -0.1], [0.2, -0.1, 2.0]])


def energy(xi, n, nu, a):
    """A body with the hyperbolic metric beside it, coupled, and an advected point of the half plane."""
    kinetic = 0.5 * xi @ INERTIA @ xi + 0.5 * (nu @ nu) / n[1] ** 2 * (1 + 0.1 * a[0]) + 0.2 * xi[0] * nu[1] / n[1]
    return kinetic - 0.3 * jnp.log(n[1]) ** 2 - 0.2 * n[0] ** 2 - 0.3 * jnp.log(a[1]) ** 2


def system(**more):
    return co.System(SL2, energy, additional=HALF_PLANE, advected=HALF_PLANE, **more)


def start_of(made):
    g = np.array([[1.2, 0.3], [0.1, 1.03 / 1.2]])
    return made.state(g=g, q=[0.3, 1.2], qdot=[0.2, 0.3], xi=[0.2, 0.3, -0.1], a0=[0.1, 0.9])


def numbers(state, row=...):
    leaves = state.g, state.n, state.a, state.mu, state.pi
    return np.concatenate([np.ravel(leaf[row] if row is not ... else leaf) for leaf in leaves])


def errors(made, method, counts=(10, 20)):
    """The largest errors at t = 1 against DOP853, and the balance of Theorem 7 of the last run."""
    start = start_of(made)
    exact = numbers(co.mechanics.continuous.reference(made, start, [1.0]), -1)
    runs = [co.simulate(made, start, dt=1 / n, steps=n, method=method) for n in counts]
    found = [float(np.max(np.abs(numbers(run.final) - exact))) for run in runs]
    return np.log2(np.array(found[:-1]) / found[1:]), runs[-1].summary()["balance_max"]


@pytest.mark.long
def test_midpoint_has_order_two_and_keeps_the_balance_of_momentum():
    slopes, balance = errors(system(), co.Midpoint(co.Exponential()))
    assert abs(slopes[-1] - 2) < 0.1
    assert balance < 1e-14


ORDERS = [
    (co.LeftRectangle(), 1),
    (co.RightRectangle(), 1),
    (co.Midpoint(), 2),
    (methods.LeftRight(), 2),
    (co.Suzuki4(co.Midpoint()), 4),
]


@pytest.mark.long
@pytest.mark.parametrize(("method", "order"), ORDERS, ids=[type(method).__name__ for method, _ in ORDERS])
@pytest.mark.parametrize("forced", [False, True], ids=["free", "forced"])
def test_rules_and_compositions_have_their_orders_and_the_balance_of_momentum(method, order, forced):
    def pull(motion):
        return co.Force(-0.3 * motion.xi + jnp.array([0.1, 0.0, 0.2]), -0.2 * motion.nu + 0.3 * motion.n[1])

    if forced and len(method.substeps) > 1:
        method = co.Suzuki4(co.Midpoint(), negative_substeps="allow")
    slopes, balance = errors(system(forces=pull if forced else None), method, (20, 40))
    assert abs(slopes[-1] - order) < 0.15
    assert balance < 1e-13


def midpoint_action(xi, n, s, a, h):
    """h ℓ at the midpoint in the chart, of H⁻¹n and H⁻¹s."""
    back = SL2.inverse(SL2.exp(0.5 * h * xi))
    x, y = moebius(back, n), moebius(back, s)
    return h * energy(xi, 0.5 * (x + y), (y - x) / h, moebius(back, a))


LEFT, RIGHT, H = co.LeftRectangle(co.Exponential()), co.RightRectangle(co.Exponential()), 0.1


def left_action(xi, n, s, a, h):
    return h * energy(xi, n, (s - n) / h, a)


def right_action(xi, n, s, a, h):
    x, y, b = (moebius(SL2.inverse(SL2.exp(h * xi)), z) for z in (n, s, a))
    return h * energy(xi, y, (y - x) / h, b)


RULES = [
    pytest.param(LEFT, left_action, 0.0, marks=pytest.mark.long),
    pytest.param(RIGHT, right_action, 1.0, marks=pytest.mark.long),
    (co.Midpoint(co.Exponential()), midpoint_action, 0.5),
]


@pytest.mark.long
@pytest.mark.parametrize(("rule", "action", "turn"), RULES, ids=["left", "right", "midpoint"])
def test_a_step_of_a_rule_in_node_form_is_that_of_its_discrete_lagrangian(rule, action, turn):
    made, variational = system(discrete_lagrangian=action), co.Variational(co.Exponential())
    start = start_of(made)
    record = start.replace(xi=np.array([0.7, -0.4, 0.5]), mu=np.zeros(3), pi=np.zeros(2))

    def steps(record):
        left = variational.equations(made, record, H)  # with μ = π = 0 the momenta themselves
        fitting = record.replace(mu=left[:3], pi=-left[3:])
        back = SL2.inverse(SL2.exp(turn * H * record.xi))
        nu = (moebius(back, record.n + H * record.nu) - moebius(back, record.n)) / H
        own = fitting.replace(nu=nu)
        ends = variational.advance(made, fitting, H), rule.advance(made, own, H)
        leaves = [(end.g, end.n, end.a, end.mu, end.pi) for end in ends]
        return rule.equations(made, own, H), *leaves

    rest, expected, found = evaluate(steps, record)
    assert np.max(np.abs(rest)) < 1e-13
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-13)


@pytest.mark.long
def test_a_left_rule_is_the_theorem_in_group_form():
    def discrete(F, n, s, a, h):
        return h * energy(SL2.vee(F - SL2.inverse(F)) / (2 * h), n, (s - n) / h, a)

    made = co.System(SL2, group_lagrangian=discrete, additional=HALF_PLANE, advected=HALF_PLANE)
    start = start_of(made)
    run = co.simulate(made, start, dt=0.05, steps=4, method=methods.GroupVariational(start="velocity"))
    assert co.theory.printed_equations(run).worst.largest < 1e-13


def test_free_motion_is_a_geodesic_of_the_half_plane():
    """With ξ = 0 for all time a point alone moves along a geodesic; here the circle |z| = 1, tanh of time in x."""
    plane = co.System(
        co.Translation(0), lambda xi, z, v: 0.5 * (v @ v) / z[1] ** 2, additional=Action(lambda g, z: z, dim=2)
    )
    run = co.simulate(plane, plane.state(q=[0.0, 1.0], qdot=[1.0, 0.0]), dt=0.01, steps=100)
    np.testing.assert_allclose(run.final.n, [np.tanh(1.0), 1 / np.cosh(1.0)], atol=2e-5)


@pytest.mark.parametrize("rule", ["Trapezoidal", "Simpson", "Galerkin", "EnergyMomentum"])
def test_rules_that_average_positions_say_so(rule):
    made = system()
    with pytest.raises(ArgumentError, match="averages positions and needs an affine action on q, but got Action"):
        getattr(methods, rule)().begin(made, start_of(made), 0.1)


WRONG = [
    (lambda g, x: g.T @ x, 2, None, r"act\(gh, x\) = act\(g, act\(h, x\)\)"),
    (lambda g, x: g @ x + 1, 2, None, r"act\(e, x\) = x"),
    (lambda g, x: jax.lax.stop_gradient(g) @ x, 2, None, r"ξ·x = d/dε act\(exp εξ, x\)"),
    (lambda g, x: jnp.log(x), 2, None, "declare the `domain`"),
    (lambda g, x: x[:1], 2, None, r"must have shape \(2,\)"),
    (lambda g, x: np.linalg.solve(g, x), 2, None, "write it with jax.numpy"),
    (moebius, 2, lambda z: -1.0, "None of 2000 random points"),
]


@pytest.mark.parametrize(("act", "dim", "domain", "says"), WRONG)
def test_what_is_not_a_smooth_action_raises(act, dim, domain, says):
    with pytest.raises(GroupError, match=says):
        co.System(SL2, lambda xi, a: xi @ xi, advected=Action(act, dim=dim, domain=domain))


def test_arguments_starts_and_steps_outside_the_domain_raise():
    with pytest.raises(ArgumentError, match="`dim`"):
        Action(moebius, dim=0)
    with pytest.raises(ArgumentError, match="flat space that it lies in"):
        Submanifold(lambda x: x @ x - 1, HALF_PLANE)
    with pytest.raises(GroupError, match="The space of SemidirectProduct"):
        co.SemidirectProduct(SL2, HALF_PLANE)
    falling = co.System(
        SL2, lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu - 9.0 * n[1], additional=HALF_PLANE, name="falling"
    )
    with pytest.raises(ArgumentError, match="`q` must lie in the domain"):
        falling.state(q=[0.0, -1.0])
    many = co.each([[0.0, 1.0], [0.0, -1.0], [0.0, 1.0]])
    with pytest.raises(ArgumentError, match="`q` must lie in the domain"):
        falling.state(q=many)
    with pytest.raises(StepError, match="numbers that are not finite") as failed:
        co.simulate(falling, falling.state(q=[0.0, 1.0]), dt=0.05, steps=40)
    assert failed.value.run.records.n[:, 1].min() > 0


class Bent(Representation):
    def ambient(self, group):
        return 2

    def act(self, group, g, x):
        return moebius(g, x)


def test_a_representation_that_is_not_linear_is_named_so():
    with pytest.raises(GroupError, match=r"must be linear, because its class is a Representation.*spaces\.Action"):
        co.System(SL2, lambda xi, a: xi @ xi, advected=Bent())


@pytest.mark.parametrize("side", [0, 1])
def test_values_that_are_not_finite_at_a_single_point_are_named(monkeypatch, side):
    points = action_module._points(HALF_PLANE, SL2)[:3]

    def sides(*_):
        both = np.ones((2, 3, 2))
        both[side, 1, 0] = np.nan
        return {"act(e, x) = x": (*both, np.ones(3))}

    monkeypatch.setattr(action_module, "_TESTED", 3)
    monkeypatch.setattr(action_module, "evaluate", sides)
    with pytest.raises(GroupError, match=r"must have finite values .* none at x = ") as raised:
        action_module._require_smooth_action.__wrapped__(HALF_PLANE, SL2)
    assert str(np.round(points[1], 4).tolist()) in str(raised.value)


@pytest.mark.parametrize("value", [[[1.0], [1.0, 2.0]], "ab", [1.0, None], [1.0, 2.0 + 1j], None])
def test_a_vector_of_what_holds_no_numbers_is_refused(value):
    with pytest.raises(ArgumentError, match="Argument `x`"):
        checked_vector(value, 2, "x")
