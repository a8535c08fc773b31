"""Isospectral steps of right-invariant systems, and of many copies of one group: vortices on a sphere by hundreds."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import point_vortices
from coadjoint.models.point_vortices import sphere_positions
from systems import generator

STEP = co.IsospectralMidpoint()
U3 = co.Un(3)
WEIGHTS = np.linspace(0.5, 1.5, 9)


def coupled(mu, a):
    return 0.5 * mu @ (WEIGHTS * mu) + 0.4 * a @ (WEIGHTS[::-1] * a) + 0.1 * jnp.sin(mu @ a)


def slopes(mu: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    wave = 0.1 * np.cos(mu @ a)
    return WEIGHTS * mu + wave * a, 0.8 * WEIGHTS[::-1] * a + wave * mu


def matrix(x: np.ndarray) -> np.ndarray:
    real, imaginary = evaluate(U3.parts, x)
    return real + 1j * imaginary


MATRICES = np.stack([matrix(e) for e in np.eye(9)])


def bracket(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The coordinates of [X, Y]."""
    X, Y = (np.tensordot(v, MATRICES, axes=1) for v in (x, y))
    return np.real(np.einsum("kij,ij->k", MATRICES.conj(), X @ Y - Y @ X))


def direct(mu: np.ndarray, a: np.ndarray, sign: float, duration: float) -> np.ndarray:
    """μ̇ = ±([W, ξ̂] + [Θ, ∂ℋ/∂a]), ȧ = ±[Θ, ξ̂] by an explicit method: + on the left, − on the right."""

    def slope(t, y):
        xi, along = slopes(y[:9], y[9:])
        return sign * np.concatenate([bracket(y[:9], xi) + bracket(y[9:], along), bracket(y[9:], xi)])

    return solve_ivp(slope, (0, duration), [*mu, *a], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]


@pytest.mark.long
@pytest.mark.parametrize(("invariance", "sign"), [("right", -1.0), ("left", 1.0)])
def test_both_sides_follow_their_equations_at_order_two(invariance, sign):
    system = co.System(U3, hamiltonian=coupled, advected=co.Coadjoint(), invariance=invariance)
    mu, a = 0.6 * generator("sides").normal(size=(2, 9))
    exact, errors = direct(mu, a, sign, 1.0), []
    for steps in (20, 40):
        end = co.trajectory(system, system.state(mu=mu, a0=a), dt=1 / steps, steps=steps, method=STEP).final
        errors.append(np.max(np.abs(np.concatenate([end.mu, end.a]) - exact)))
    assert errors[1] < 2e-3 and errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert np.max(np.abs(exact - np.concatenate([mu, a]))) > 0.1


@pytest.mark.long
def test_casimirs_are_kept_on_the_right():
    system = co.System(U3, hamiltonian=coupled, advected=co.Coadjoint(), invariance="right")
    casimirs = co.mechanics.trace_casimirs(system)
    mu, a = 0.6 * generator("sides").normal(size=(2, 9))
    start = system.state(mu=mu, a0=a)
    run = co.simulate(system.watching(casimirs), start, dt=0.05, steps=40, method=STEP, accuracy=False)
    W, Theta = -1j * matrix(mu), -1j * matrix(a)
    assert run.dataset.trace_mu_a_3.values[0] == pytest.approx(np.trace(W @ Theta @ Theta).real, rel=1e-13)
    assert max(np.ptp(run.dataset[name].values) for name in casimirs) < 2e-14
    assert np.ptp(run.records.mu[:, 0]) > 0.05


@pytest.mark.long
def test_on_the_right_g_moves_along_and_the_momentum_in_the_body_stays():
    top = co.SOn(4)
    weights = np.linspace(0.5, 2.0, 6)
    system = co.System(top, hamiltonian=lambda mu: 0.5 * mu @ (weights * mu), invariance="right")
    turned = co.System(top, hamiltonian=lambda mu: 0.5 * mu @ (weights * mu), invariance="left")
    mu = np.cos(np.arange(6.0))
    method = co.IsospectralMidpoint(carry_g=True)
    run = co.simulate(system, system.state(mu=mu), dt=0.05, steps=100, method=method, accuracy=False)
    assert run.relative_change("kelvin_noether") < 1e-13 and np.ptp(run.records.mu[:, 0]) > 0.1
    assert np.max(np.abs(run.final.g.T @ run.final.g - np.eye(4))) < 1e-13
    # g ↦ g⁻¹ leads to the left-invariant ℋ(−μ), here ℋ itself, from −μ.
    other = co.simulate(turned, turned.state(mu=-mu), dt=0.05, steps=100, method=method, accuracy=False)
    np.testing.assert_allclose(run.final.mu, -other.final.mu, atol=1e-13)
    np.testing.assert_allclose(run.final.g, other.final.g.T, atol=1e-13)


@pytest.mark.long
def test_a_power_and_a_product_have_the_same_steps():
    def energy(mu):
        rows = jnp.reshape(mu, (3, 3))
        return 0.5 * jnp.sum(rows**2 * np.array([1.0, 2.0, 3.0])) + 0.3 * rows[0] @ rows[1] + 0.2 * rows[1] @ rows[2]

    mu, ends = np.sin(np.arange(9.0)), []
    for group in (co.Power(co.SO3(), 3), co.DirectProduct(*[co.SO3()] * 3)):
        system = co.System(group, hamiltonian=energy)
        for method in (STEP, co.IsospectralMidpoint(carry_g=True)):
            ends.append(co.trajectory(system, system.state(mu=mu), dt=0.05, steps=20, method=method).final)
    for end in ends[1:]:
        np.testing.assert_allclose(end.mu, ends[0].mu, atol=1e-14)
    np.testing.assert_allclose(np.stack(ends[3].g), ends[1].g, atol=1e-14)
    runs = [[co.trajectory(system, system.state(mu=mu), dt=1 / n, steps=n, method=method).final.mu for n in (40, 80)]
            for method in (STEP, co.HamiltonianMidpoint())]  # fmt: skip
    ours, theirs = ((4 * fine - coarse) / 3 for coarse, fine in runs)
    np.testing.assert_allclose(ours, theirs, atol=5e-6)
    sizes = np.linalg.norm(ends[0].mu.reshape(3, 3), axis=1)
    np.testing.assert_allclose(sizes, np.linalg.norm(mu.reshape(3, 3), axis=1), rtol=1e-14)


def ring(count: int, colatitude: float) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count
    flat = np.sin(colatitude) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.column_stack([flat, np.full(count, np.cos(colatitude))])


@pytest.mark.long
def test_a_ring_of_two_hundred_vortices_turns_at_its_rate():
    """ω = Γ(N − 1) cos ϑ/(4πR² sin² ϑ) (Newton, section 4.2), here with NΓ = 4π."""
    count, colatitude = 200, 1.0
    gamma = np.full(count, 4 * np.pi / count)
    system = point_vortices.sphere(circulations=gamma, radius=1.0)
    start = point_vortices.sphere_start(system, positions=ring(count, colatitude))
    rate = (count - 1) / count * np.cos(colatitude) / np.sin(colatitude) ** 2
    off = []
    for steps in (4, 8):  # such a ring falls apart within a second
        end = co.trajectory(system, start, dt=0.05 / steps / rate, steps=steps, method=STEP).final
        x = sphere_positions(end.mu, gamma, 1.0)
        turned = ring(count, colatitude) @ np.asarray(co.attitude.from_rotation_vector([0, 0, 0.05])).T
        off.append(np.max(np.abs(x - turned)))
        assert np.max(np.abs(np.linalg.norm(x, axis=1) - 1)) < 1e-14
        assert np.max(np.abs(gamma @ x - gamma @ ring(count, colatitude))) < 1e-12
    assert off[1] < 1e-5 and off[0] / off[1] == pytest.approx(4, rel=0.05)


def test_products_of_several_groups_are_refused():
    system = co.System(co.DirectProduct(co.SO3(), co.SOn(4)), hamiltonian=lambda mu: mu @ mu)
    with pytest.raises(co.errors.ArgumentError, match="or copies of one, but got DirectProduct"):
        STEP.require_fit(system)
