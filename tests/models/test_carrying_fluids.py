"""Fluids that carry a function: published equations by NumPy, waves in closed form, balances, Casimirs, energies."""

from __future__ import annotations

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import fluids
from coadjoint.models.fluids.laplacian import laplacian


def parts(fluid, state):
    """W and Θ, complex (N, N)."""
    return [A + 1j * B for A, B in (evaluate(fluid.group.parts, x) for x in (state.mu, state.a))]


def diagonals(M):
    """The Laplacian of Hoppe and Yau, (N², N²), entry by entry, on matrices by rows."""
    N = len(M)
    found = np.zeros((N * N, N * N))
    for i in range(N):
        for j in range(N):
            a, m = min(i, j), abs(i - j)
            found[i * N + j, i * N + j] = -((N - 1) * (2 * a + 1 + m) - 2 * a * (a + m))
            if max(i, j) + 1 < N:
                k = a + 1
                off = np.sqrt((k + m) * (N - k - m) * k * (N - k))
                found[i * N + j, (i + 1) * N + j + 1] = found[(i + 1) * N + j + 1, i * N + j] = off
    return found


@pytest.mark.long
@pytest.mark.parametrize("rotation", [0.7, 0.0])
def test_a_step_of_a_magnetic_fluid_is_that_of_the_published_equations(rotation):
    """P = Δ⁻¹(W − F), B = ΔΘ, ε = h/(2ħ); W̃ and Θ̃ by iteration, W_{k+1} = W_k + 2ε([P̃, W̃] + [B̃, Θ̃]), in NumPy."""
    N, h = 3, 0.05
    fluid = fluids.magnetohydrodynamics(N, rotation)
    nothing = np.zeros((2, 2))
    F, _ = parts(fluid, fluids.carrying_start(fluid, nothing, nothing))
    start = fluids.carrying_start(fluid, fluids.random_vorticity(1, 2), fluids.random_vorticity(2, 2))
    end = co.trajectory(fluid, start, dt=h, steps=1, method=co.IsospectralMidpoint()).final
    W, Theta = parts(fluid, start)
    Delta, epsilon = diagonals(W), 0.5 * h * np.sqrt(N * N - 1) / 2
    inverse = np.linalg.pinv(Delta)
    c = lambda X, Y: X @ Y - Y @ X  # noqa: E731
    w, theta, P, B = W, Theta, W, Theta
    for _ in range(80):
        P, B = ((D @ X.ravel()).reshape(N, N) for D, X in ((inverse, w - F), (Delta, theta)))
        of_w = epsilon * (c(P, w) + c(B, theta)) + epsilon**2 * (P @ w @ P + B @ theta @ P + P @ theta @ B)
        w, theta = W + of_w, Theta + epsilon * c(P, theta) + epsilon**2 * P @ theta @ P
    expected = W + 2 * epsilon * (c(P, w) + c(B, theta)), Theta + 2 * epsilon * c(P, theta)
    for found, wanted in zip(parts(fluid, end), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13)


@pytest.mark.long
@pytest.mark.parametrize("model", [fluids.magnetohydrodynamics, fluids.boussinesq])
def test_what_carries_nothing_moves_as_a_fluid_on_a_sphere_that_turns(model):
    """θ = 0 or b = 0: Euler's equations with the same Ω, whose waves turn at the rate of Rossby and Haurwitz."""
    c, ends = fluids.random_vorticity(1, 2), []
    for fluid, start in (
        (fluids.euler(3, rotation=0.7), fluids.start),
        (model(3, rotation=0.7), lambda fluid, c: fluids.carrying_start(fluid, c, np.zeros((2, 2)))),
    ):
        path = co.trajectory(fluid, start(fluid, c), dt=0.1, steps=10, method=co.IsospectralMidpoint())
        ends.append(fluids.vorticity(fluid, path.final))
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=1e-13)
    assert np.max(np.abs(ends[0][:3, :3] - c)) > 0.1


def wave(fluid, degree, order, background, frequency):
    """Of a small wave cos(ωt) Y_lm after a quarter of a period: the error by Richardson, and how it falls with h/2."""
    small = np.zeros((degree + 1, degree + 1), complex)
    small[degree, order] = 1e-7
    still = np.zeros((2, 2), complex)
    still[1, 0] = background * np.sqrt(4 * np.pi / 3)
    start, duration, ends = fluids.carrying_start(fluid, small, still), 0.5 * np.pi / frequency, []
    for steps in (12, 24):
        path = co.trajectory(fluid, start, dt=duration / steps, steps=steps, method=co.IsospectralMidpoint())
        ends.append(fluids.vorticity(fluid, path.final)[degree, order] / 1e-7)
    return abs((4 * ends[1] - ends[0]) / 3), abs(ends[0]) / abs(ends[1])


@pytest.mark.long
def test_waves_of_alfven_have_their_frequency():
    """Over θ = b cos ϑ: ω = mb√(1 − 2/(l(l + 1))), at every N > l."""
    degree, order, strength = 2, 1, 0.8
    frequency = order * strength * np.sqrt(1 - 2 / (degree * (degree + 1)))
    error, ratio = wave(fluids.magnetohydrodynamics(3), degree, order, strength, frequency)
    assert error < 1e-4 and ratio == pytest.approx(4, abs=0.2)


@pytest.mark.long
def test_waves_of_gravity_have_their_frequency():
    """Over b = n² cos ϑ: ω = mn/√(l(l + 1)), at every N > l."""
    degree, order, n = 2, 1, 1.5
    frequency = order * n / np.sqrt(degree * (degree + 1))
    error, ratio = wave(fluids.boussinesq(3), degree, order, n**2, frequency)
    assert error < 1e-4 and ratio == pytest.approx(4, abs=0.2)


@pytest.mark.long
@pytest.mark.parametrize("sign", [1, pytest.param(-1, marks=pytest.mark.long)])
def test_a_flow_along_its_field_stands(sign):
    """ψ = ±θ balances at any amplitude, so that what moves is the error of steps, of order h²."""
    fluid = fluids.magnetohydrodynamics(6)
    theta = fluids.random_vorticity(3, 5)
    a = fluids.from_coefficients(6, theta)
    start = fluid.state(mu=sign * evaluate(lambda a: laplacian(6, a), a), a0=a)
    off = []
    for steps in (20, 40):
        end = co.trajectory(fluid, start, dt=0.2 / steps, steps=steps, method=co.IsospectralMidpoint()).final
        off.append(np.max(np.abs(np.concatenate([end.mu - start.mu, end.a - start.a]))))
    assert off[0] < 1e-2 and np.log2(off[0] / off[1]) == pytest.approx(2, abs=0.05)


@pytest.mark.long
def test_a_magnetic_fluid_keeps_its_casimirs_and_exchanges_energy():
    fluid = fluids.magnetohydrodynamics(7, rotation=0.4)
    vorticity, theta = fluids.random_vorticity(4, 4), 0.5 * fluids.random_vorticity(5, 4)
    start = fluids.carrying_start(fluid, vorticity, theta)
    run = co.simulate(fluid, start, dt=0.02, steps=100, method=co.IsospectralMidpoint(), accuracy=False)
    l = np.arange(1, 5)
    of = lambda c: np.sum(np.abs(c) ** 2 * np.array([1, 2, 2, 2, 2]), axis=-1)[1:]  # noqa: E731
    assert run.dataset.kinetic_energy.values[0] == pytest.approx(0.5 * np.sum(of(vorticity) / (l * (l + 1))))
    assert run.dataset.magnetic_energy.values[0] == pytest.approx(0.5 * np.sum(of(theta) * l * (l + 1)))
    assert run.dataset.mean_square_potential.values[0] == pytest.approx(0.5 * np.sum(of(theta)))
    absolute = vorticity.copy()
    absolute[1, 0] += 2 * 0.4 * np.sqrt(4 * np.pi / 3)  # of 2Ω cos ϑ
    both = np.sum((absolute * theta.conj()).real * np.array([1, 2, 2, 2, 2]))  # ∫(ω + 2Ω cos ϑ)θ
    assert run.dataset.cross_helicity.values[0] == pytest.approx(-both) and abs(both) > 0.05
    total = run.dataset.kinetic_energy.values + run.dataset.magnetic_energy.values
    assert np.ptp(run.dataset.kinetic_energy.values) > 0.1 * total[0] and np.ptp(total) < 1e-3 * total[0]
    for name in ("cross_helicity", "mean_square_potential"):
        assert np.ptp(run.dataset[name].values) < 1e-13
    (_, Theta), (_, moved) = parts(fluid, start), parts(fluid, run.final)
    np.testing.assert_allclose(np.linalg.eigvalsh(1j * moved), np.linalg.eigvalsh(1j * Theta), atol=5e-14)
    np.testing.assert_allclose(fluids.carried(fluid, start)[:5, :5], theta, atol=1e-14)
    assert run.dataset.magnetic_energy.attrs["units"] == "1/s^2"


@pytest.mark.long
def test_heavy_fluid_over_light_turns_over():
    """Buoyancy that falls with height: potential energy becomes motion, and their sum stays."""
    fluid = fluids.boussinesq(6)
    b = np.zeros((3, 3), complex)
    b[1, 0], b[2, 1] = -2.0, 0.05
    start = fluids.carrying_start(fluid, np.zeros((2, 2)), b)
    run = co.simulate(fluid, start, dt=0.05, steps=80, method=co.IsospectralMidpoint(), accuracy=False)
    kinetic, potential = run.dataset.kinetic_energy.values, run.dataset.potential_energy.values
    assert potential[0] == pytest.approx(2.0 * np.sqrt(4 * np.pi / 3))
    assert kinetic[0] == 0 and kinetic[-1] > 0.01
    assert np.ptp(kinetic + potential) < 1e-2 * kinetic[-1]


def test_what_carries_nothing_is_refused():
    fluid = fluids.magnetohydrodynamics(4)
    for call, sentence in (
        (lambda: fluids.magnetohydrodynamics(1), "`size` must be a whole number from 2, but is 1"),
        (lambda: fluids.boussinesq(4, rotation=np.inf), "`rotation` must be a finite number, but is inf"),
        (lambda: fluids.carrying_start(fluids.euler(4), np.zeros((2, 2)), np.zeros((2, 2))), "that carries a function"),
        (lambda: fluids.carrying_start(fluid, np.eye(2), np.zeros((2, 2))), "must have mean 0, but c_00 is 1.0"),
        (lambda: fluids.DampedMidpoint(drag=0.1).require_fit(fluid), "damps vorticity alone: take a fluid"),
        (lambda: fluids.carried(fluids.euler(4), None), r"fluids.magnetohydrodynamics\(N\) or"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            call()


def test_energies_and_helicity_of_a_magnetic_fluid_are_sums_over_harmonics():
    """½ Σ l(l + 1)|θ_l|², −Σ ω_l·θ_l and ½ Σ |θ_l|², where c_lm of m > 0 stand for two, and θ and ω come back."""
    random = np.random.default_rng(6)
    L, m = 4, np.arange(4)
    omega, theta = random.normal(size=(2, L, L)) + 1j * random.normal(size=(2, L, L)) * (m > 0)
    for c in (omega, theta):
        c[m[None] > m[:, None]] = 0
        c[0] = 0
    fluid = fluids.magnetohydrodynamics(6)
    state = fluids.carrying_start(fluid, omega, theta)
    twice, degree = np.where(m > 0, 2.0, 1.0), (m * (m + 1))[:, None]
    expected = {
        "magnetic_energy": 0.5 * np.sum(degree * twice * np.abs(theta) ** 2),
        "cross_helicity": -np.sum(twice * (omega * theta.conj()).real),
        "mean_square_potential": 0.5 * np.sum(twice * np.abs(theta) ** 2),
    }
    found = evaluate(lambda s: {name: f(s) for name, f in fluid.quantities if name in expected}, state)
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-12), name
    np.testing.assert_allclose(fluids.carried(fluid, state)[:L, :L], theta, atol=1e-13)
    slope = evaluate(jax.grad(lambda a: dict(fluid.quantities)["magnetic_energy"](state.replace(a=a))), state.a)
    assert slope @ state.a == pytest.approx(2 * expected["magnetic_energy"], rel=1e-12)
