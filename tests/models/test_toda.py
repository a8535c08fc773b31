"""Toda's lattice: the two-particle motion in closed form, eigenvalues that stay, and their order at the end."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import toda


@pytest.mark.long
def test_two_particles_move_as_in_closed_form():
    """With d = q₁ − q₂: d̈ = −2eᵈ, so eᵈ = κ²/cosh²(κ(t − t₀)) with κ² = ḋ²/4 + eᵈ."""
    q, p = np.array([0.0, 0.3]), np.array([1.0, -0.5])
    system = toda.lattice(particles=2)
    start = toda.start(system, positions=q, momenta=p)
    kappa = np.sqrt((p[0] - p[1]) ** 2 / 4 + np.exp(q[0] - q[1]))
    reached = np.arctanh((p[0] - p[1]) / 2 / kappa) / kappa
    errors = []
    for h in (0.04, 0.02):
        run = co.simulate(system, start, dt=h, duration=4.0, accuracy=False)
        L, t = toda.lax_matrix(run.records.mu), run.dataset.time.values
        errors.append(np.max(np.abs(L[:, 0, 1] - 0.5 * kappa / np.cosh(kappa * (t - reached)))))
        np.testing.assert_allclose(np.trace(L, axis1=1, axis2=2), -0.5 * np.sum(p), atol=1e-14)
    assert errors[1] < 1e-4 and errors[0] / errors[1] == pytest.approx(4, rel=0.05)
    gap = -2 * np.log(2 * L[-1, 0, 1])  # q₂ − q₁
    assert gap == pytest.approx(2 * np.log(np.cosh(kappa * (4.0 - reached)) / kappa), abs=1e-3)


@pytest.mark.cases(1)
@pytest.mark.parametrize("particles", [3, pytest.param(4, marks=pytest.mark.long)])
def test_any_number_moves_as_the_factorisation_says(particles: int):
    """exp(tL₀) = QR with R_ii > 0, L(t) = QᵀL₀Q (Symes, Physica D 4 (1982)), which is Moser's solution."""
    k = np.arange(particles)
    q, p = 0.4 * k + 0.2 * np.sin(3.0 * k), np.cos(2.0 * k)
    system = toda.lattice(particles=particles)
    start = toda.start(system, positions=q, momenta=p)
    L0, duration, errors = toda.lax_matrix(start.mu), 1.5, []
    powers = evaluate(lambda state: [toda.trace(state, power=n) for n in (1, 2, 3)], start)
    np.testing.assert_allclose(powers, [np.sum(np.linalg.eigvalsh(L0) ** n) for n in (1, 2, 3)], rtol=1e-12)
    Q, R = np.linalg.qr(expm(duration * L0))
    Q = Q * np.sign(np.diag(R))
    for h in (0.1, 0.05):
        run = co.trajectory(system, start, dt=h, steps=round(duration / h))
        errors.append(np.max(np.abs(toda.lax_matrix(run.final.mu) - Q.T @ L0 @ Q)))
    assert errors[1] < 2e-3 and errors[0] / errors[1] == pytest.approx(4, rel=0.1)


def test_particles_leave_each_other_with_exchanged_momenta_and_the_shifts_of_moser():
    """q_k ~ p_k^± t + c_k^±: p⁺_k = p⁻_{n+1−k}, and c⁺ of the kth slowest less c⁻ of the same momentum is

    Σ_{j faster} ln(p_j − p_k)² − Σ_{j slower} ln(p_j − p_k)² (Moser 1975).
    """
    far = np.array([0.9, 0.1, -0.7])  # the fastest is behind
    system = toda.lattice(particles=3)
    T, shifts = 14.0, []
    shift = [sum(np.sign(other - one) * np.log((other - one) ** 2) for other in far if other != one) for one in far]
    for h in (0.04, 0.02):
        start = toda.start(system, positions=-T * far, momenta=far)
        run = co.trajectory(system, start, dt=h, steps=round(2 * T / h))
        L = toda.lax_matrix(run.final.mu)
        p, gaps = -2 * np.diag(L), -2 * np.log(2 * np.diag(L, 1))
        np.testing.assert_allclose(p, np.sort(far), atol=1e-3)
        shifts.append(gaps - T * np.diff(np.sort(far)))
    found = shifts[1] + (shifts[1] - shifts[0]) / 3
    np.testing.assert_allclose(found, np.diff(shift[::-1]), atol=1e-3)


@pytest.mark.long
def test_eigenvalues_stay_and_stand_in_order_at_the_end():
    system = toda.lattice(particles=4)
    start = toda.start(system, positions=[0.0, 0.2, 0.1, 0.5], momenta=[1.0, -0.4, 0.7, -0.2])
    L0 = toda.lax_matrix(start.mu)
    values = np.linalg.eigvalsh(L0)
    run = co.simulate(system, start, dt=0.05, duration=60.0, save_every=100, accuracy=False)
    L = toda.lax_matrix(run.records.mu)
    assert np.max(np.abs(np.linalg.eigvalsh(L) - values)) < 2e-3  # a band of order h²
    np.testing.assert_allclose(np.diag(L[-1]), np.linalg.eigvalsh(L[-1])[::-1], atol=1e-6)
    assert np.max(np.abs(np.triu(L, 2))) == 0.0
    for k in (3, 4):
        assert run.monitors[f"trace_{k}"][0] == pytest.approx(np.sum(values**k), rel=1e-14)
        assert run.relative_change(f"trace_{k}") < 1e-2
    # ℋ is the energy of the particles.
    q, p = [0.0, 0.2, 0.1, 0.5], np.array([1.0, -0.4, 0.7, -0.2])
    assert run.monitors["energy"][0] == pytest.approx(0.5 * p @ p + np.sum(np.exp(-np.diff(q))), rel=1e-14)


def test_wrong_lattices_are_refused_in_a_sentence():
    for particles in (1, 2.5, 40, "three", True, np.nan, np.inf):
        with pytest.raises(co.errors.ArgumentError, match="`particles` must be a whole number from 2 to 12"):
            toda.lattice(particles=particles)
    with pytest.raises(co.errors.ArgumentError, match="`momenta` must have shape \\(3,\\)"):
        toda.start(toda.lattice(particles=3), positions=[0, 1, 2], momenta=[1, 2])
