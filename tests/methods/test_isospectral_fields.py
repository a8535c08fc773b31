"""Isospectral steps with advected parameters that move as the momentum does: Casimirs, orders, a second form."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.newton.fixed_point import FixedPoint
from coadjoint.kernels.trace.evaluate import evaluate
from systems import generator

H = 0.1


def hamiltonian(mu, a, p):
    """No symmetry and not quadratic: W and Θ are coupled, so that ∂ℋ/∂W depends on Θ."""
    w = np.linspace(0.5, 1.5, mu.shape[0])
    v = w[::-1] ** 2
    return p.scale * (0.5 * mu @ (w * mu) + 0.1 * w @ mu**3 + 0.3 * a @ (v * a) + 0.2 * mu @ (v * a) + 0.1 * w @ a**3)


def system_on(group, **more):
    """The system and a start of size 1 and 0.6."""
    system = co.System(group, hamiltonian=hamiltonian, advected=co.Coadjoint(), parameters={"scale": 1.0}, **more)
    mu, a = generator("fields", repr(group)).normal(size=(2, group.dim))
    of_mu, of_a = (np.linalg.norm(evaluate(group.hat, x), 2) for x in (mu, a))
    return system, system.state(mu=mu / of_mu, a0=0.6 * a / of_a)


def matrix(group, x):
    """X, complex (n, n)."""
    found = evaluate(group.hat, x)
    return co.groups.complex_form(found) if isinstance(group, (co.Un, co.SUn)) else found + 0j


def path(system, start, steps, h=H, method=None):
    return co.trajectory(system, start, dt=h, steps=steps, method=method or co.IsospectralMidpoint())


def casimirs(group, state):
    """The spectrum of Θ and tr WΘᵏ, by NumPy."""
    W, Theta = matrix(group, state.mu), matrix(group, state.a)
    traces = [np.trace(W @ np.linalg.matrix_power(1j * Theta, k)) for k in range(5)]
    return np.array([*np.linalg.eigvalsh(1j * Theta), *traces])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "group", [co.SUn(3), co.SO3(), *(pytest.param(group, marks=pytest.mark.long) for group in (co.Un(6), co.SOn(5)))]
)
def test_casimirs_are_kept_to_round_off_whatever_the_tolerance(group):
    system, start = system_on(group)
    for tolerance, steps in ((1e-14, 1000), (1e-5, 100)):
        end = path(system, start, steps, method=co.IsospectralMidpoint(tolerance=tolerance)).final
        assert np.max(np.abs(casimirs(group, end) - casimirs(group, start))) < 5e-14
        assert np.max(np.abs(end.mu - start.mu)) > 0.1
    before, after = (np.linalg.eigvalsh(1j * matrix(group, state.mu)) for state in (start, end))
    assert np.max(np.abs(after - before)) > 1e-3  # the spectrum of W is no Casimir


def exact(system, start, duration):
    """(W, Θ) of Ẇ = [P, W] + [B, Θ], Θ̇ = [P, Θ] with P = −∂ℋ/∂W, B = −∂ℋ/∂Θ by DOP853, as coordinates."""
    group, dim = system.group, system.group.dim
    slopes = jax.jit(jax.grad(lambda y: hamiltonian(y[:dim], y[dim:], system.parameters)))
    hats = [matrix(group, row) for row in np.eye(dim)]
    size = np.array([np.vdot(X, X).real for X in hats])

    def rate(_, y):
        with jax.enable_x64(True):
            along = np.asarray(slopes(y))
        W, Theta, P, B = (np.tensordot(x, hats, 1) for x in (y[:dim], y[dim:], -along[:dim], -along[dim:]))
        of_W, of_Theta = P @ W - W @ P + B @ Theta - Theta @ B, P @ Theta - Theta @ P
        return np.concatenate([[np.vdot(X, M).real for X in hats] / size for M in (of_W, of_Theta)])

    y = np.concatenate([start.mu, start.a])
    return solve_ivp(rate, (0, duration), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


@pytest.mark.long
@pytest.mark.parametrize(
    "group", [co.SUn(2), *(pytest.param(group, marks=pytest.mark.long) for group in (co.Un(3), co.SOn(4)))]
)
def test_steps_come_to_an_independent_integration_of_the_bracket_at_order_two(group):
    system, start = system_on(group)
    expected = exact(system, start, 0.8)
    ends = [path(system, start, n, 0.8 / n).final for n in (16, 32)]
    first, second = (np.concatenate([end.mu, end.a]) for end in ends)
    errors = [np.max(np.abs(found - expected)) for found in (first, second)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05) and errors[1] < 1e-2
    assert np.max(np.abs((4 * second - first) / 3 - expected)) < 0.02 * errors[1]


@pytest.mark.long
def test_a_step_is_that_of_block_matrices():
    """X = [[Θ, W], [0, Θ]], Q = [[P, B], [0, P]]: X_k = (1 − εQ)X̃(1 + εQ), X_{k+1} = (1 + εQ)X̃(1 − εQ) by NumPy."""
    group = co.Un(3)
    system, start = system_on(group)
    after = path(system, start, 1).final
    slopes = jax.grad(hamiltonian, argnums=(0, 1))

    def block(theta, w):
        return np.block([[theta, w], [np.zeros((3, 3)), theta]])

    X = middle = Q = block(matrix(group, start.a), matrix(group, start.mu))
    for _ in range(60):
        mu, a = (evaluate(group.coordinates, (np.real(M), np.imag(M))) for M in (middle[:3, 3:], middle[:3, :3]))
        along = evaluate(slopes, mu, a, system.parameters)
        Q = block(*(-0.5 * H * matrix(group, x) for x in along))
        middle = X + Q @ middle - middle @ Q + Q @ middle @ Q
    expected = (np.eye(6) + Q) @ middle @ (np.eye(6) - Q)
    np.testing.assert_allclose(matrix(group, after.a), expected[:3, :3], rtol=0, atol=4e-15)
    np.testing.assert_allclose(matrix(group, after.mu), expected[:3, 3:], rtol=0, atol=4e-15)


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "order", "steps"),
    [
        pytest.param(co.Suzuki4, 4, 16, marks=pytest.mark.long),
        (co.methods.KahanLi6, 6, 16),
        pytest.param(co.methods.KahanLi8, 8, 16, marks=pytest.mark.long),
    ],
    ids=["4", "6", "8"],
)
def test_orders_of_compositions(method, order, steps):
    system, start = system_on(co.SUn(3))
    best = path(system, start, 96, 3.2 / 96, co.methods.KahanLi8(co.IsospectralMidpoint())).final
    made = method(co.IsospectralMidpoint())
    ends = [path(system, start, n, 3.2 / n, made).final for n in (steps, 2 * steps)]
    errors = [max(np.max(np.abs(end.mu - best.mu)), np.max(np.abs(end.a - best.a))) for end in ends]
    assert errors[1] > 3e-14
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.long
@pytest.mark.parametrize("tolerance", [pytest.param(1e-14, marks=pytest.mark.long), 1e-5])
def test_gradients_equal_differences_whatever_the_tolerance(tolerance):
    """Of W and Θ after 6 steps, along a change of the start and of a parameter, forward and reverse."""
    system, start = system_on(co.Un(2))
    to_mu, to_a, weight, other = generator("along").normal(size=(4, 4))

    def value(e, method):
        begin = start.replace(mu=start.mu + e * to_mu, a=start.a + e * to_a)
        end = path(system.replace(scale=1.0 + e), begin, 6, method=method).final
        return weight @ end.mu + other @ end.a

    method = co.IsospectralMidpoint(tolerance=tolerance)
    with co.float64():
        reverse = jax.grad(value)(0.0, method)
        forward = jax.jvp(lambda e: value(e, method), (0.0,), (1.0,))[1]
    d, fine = 2e-3, co.IsospectralMidpoint()
    first, second = ((value(x, fine) - value(-x, fine)) / (2 * x) for x in (d, 2 * d))
    expected = (4 * first - second) / 3
    # The tangent is exact at the unknowns that were found, which a loose tolerance leaves off.
    close = 1e-8 if tolerance < 1e-13 else 1e-4
    np.testing.assert_allclose([reverse, forward], expected, rtol=close)
    np.testing.assert_allclose(reverse, forward, rtol=1e-11)


@pytest.mark.long
def test_a_run_watches_all_casimirs_and_may_carry_g():
    system, start = system_on(co.Un(3))
    system = system.watching(co.mechanics.trace_casimirs(system, degree=4))
    method = co.IsospectralMidpoint(carry_g=True)
    run = co.simulate(system, start, dt=H, steps=20, method=method, accuracy=False)
    names = [f"trace_a_{k}" for k in range(2, 5)] + [f"trace_mu_a_{k}" for k in range(1, 5)]
    assert [name for name, _ in system.quantities] == names
    W, Theta = -1j * matrix(system.group, start.mu), -1j * matrix(system.group, start.a)
    assert run.dataset.trace_a_3.values[0] == pytest.approx(np.trace(Theta @ Theta @ Theta).real)
    assert run.dataset.trace_mu_a_3.values[0] == pytest.approx(np.trace(W @ Theta @ Theta).real)
    for name in names:
        assert np.ptp(run.dataset[name].values) < 2e-14, name
    assert run.largest("balance") < 1e-14 and run.largest("newton_residual") < 1e-13
    np.testing.assert_allclose(run.final.a, evaluate(system.group.Ad_dual, run.final.g, start.a), atol=1e-14)


@pytest.mark.long
def test_members_of_an_ensemble_run_as_alone():
    """Without g, with an a₀ of each member's own."""
    system, start = system_on(co.SUn(2))
    scales = [1.0, 0.5]
    alone = [path(system.replace(scale=scale), start.replace(a=scale * start.a), 5).final for scale in scales]
    members = system.state(mu=start.mu, a0=co.each([scale * start.a for scale in scales]))
    method = co.IsospectralMidpoint()
    run = co.simulate(system.replace(scale=co.each(scales)), members, dt=H, steps=5, method=method, accuracy=False)
    for k, end in enumerate(alone):
        np.testing.assert_allclose(run.final.mu[k], end.mu, atol=1e-14)
        np.testing.assert_allclose(run.final.a[k], end.a, atol=1e-14)


@pytest.mark.long
def test_two_fields_of_one_momentum():
    """Each has its spectrum, the traces of products of both stay, and the order is two."""
    group = co.SUn(3)
    w = np.linspace(0.5, 1.5, group.dim)
    system = co.System(
        group,
        hamiltonian=lambda mu, a: 0.5 * mu @ (w * mu) + 0.3 * a.b @ (w * mu) + 0.5 * a.b @ (w[::-1] * a.c) + w @ a.c**2,
        advected={"b": co.Coadjoint(), "c": co.spaces.Adjoint()},
    )
    mu, b, c = 0.4 * generator("two").normal(size=(3, group.dim))
    start = system.state(mu=mu, a0={"b": b, "c": c})
    fine, ends = path(system, start, 128, 0.8 / 128).final, [path(system, start, n, 0.8 / n).final for n in (8, 16)]
    errors = [np.max(np.abs(np.concatenate([end.mu - fine.mu, end.a - fine.a]))) for end in ends]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)

    def kept(state):
        B, C = (matrix(group, x) for x in np.split(state.a, 2))
        return np.array([*np.linalg.eigvalsh(1j * B), *np.linalg.eigvalsh(1j * C), np.trace(B @ C @ B @ C)])

    np.testing.assert_allclose(kept(fine), kept(start), atol=2e-14)
    assert list(co.mechanics.trace_casimirs(system, 2)) == ["trace_b_2", "trace_c_2"]


def test_what_does_not_move_as_the_momentum_is_refused():
    one = lambda group, **more: co.System(group, hamiltonian=lambda mu, *rest: mu @ mu, **more)  # noqa: E731
    method = co.IsospectralMidpoint()
    with pytest.raises(ArgumentError, match=r"advected=co.Coadjoint\(\), but got Defining\(\): use co.Hamil"):
        method.require_fit(one(co.SO3(), advected=co.Defining()))
    with pytest.raises(ArgumentError, match="`degree` must be a whole number from 2, but is 1"):
        co.mechanics.trace_casimirs(one(co.SO3()), degree=1)
    with pytest.raises(ArgumentError, match=r"needs a system on co.Un, co.SUn, co.SOn or co.SO3, but got SE3"):
        co.mechanics.trace_casimirs(one(co.SE3()))
    with pytest.raises(ArgumentError, match=r"needs advected parameters in co.Coadjoint\(\), but got Defining"):
        co.mechanics.trace_casimirs(one(co.SO3(), advected=co.Defining()))


@pytest.mark.cases(1)
@pytest.mark.parametrize("slope", [0.8, -0.8])
def test_a_slow_contraction_is_followed_to_its_tolerance(slope):
    """It is not taken for round-off at 1e-11, nor are its derivatives left at a loose tolerance of the equations."""

    def root(z0, tolerance):
        near = jnp.full(1, (1 + 1e-6) / (1 - slope))
        return FixedPoint(tolerance).root(lambda z: z - slope * z - z0, near, jnp.asarray(0.1), (1,)).unknowns[0]

    assert abs(evaluate(lambda z0: root(z0, 1e-14), 1.0) * (1 - slope) - 1) < 1e-13
    derivative = evaluate(jax.grad(lambda z0: root(z0, 1e-4)), 1.0)
    assert abs(derivative * (1 - slope) - 1) < 1e-12
    unstable = lambda z: FixedPoint().root(lambda x: 3.0 * x - z, jnp.zeros(1), jnp.asarray(0.1), (1,))[0][0]  # noqa: E731
    assert np.isnan(evaluate(jax.grad(unstable), 1.0))
