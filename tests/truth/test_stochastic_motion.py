"""Noise held over steps: closed forms of a rotation, of the mean on a sphere and of a thermostat, and Casimirs."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co

SIGMA, OMEGA, FINE = 0.8, 0.3, 64


def rotating(mu, p, *, t):
    """½|μ|² does not move μ; the rest turns it about e₃ by ωt + σW."""
    noise = jnp.asarray(p.noise)[jnp.floor(t / p.dt).astype(int)]
    return 0.5 * mu @ mu + (OMEGA + SIGMA * noise) * mu[2]


def turned(dW, steps):
    """(members, 3): μ at t = 1 from (1, 0, 0.5) with the increments dW summed over steps."""
    members, h = len(dW), 1 / steps
    held = np.zeros((members, FINE + 1))
    held[:, :steps] = dW.reshape(members, steps, -1).sum(axis=2) / h
    body = co.System(co.SO3(), hamiltonian=rotating, parameters={"noise": co.each(held), "dt": h}, name="rotation")
    start = body.state(mu=[1.0, 0.0, 0.5])
    run = co.simulate(body, start, dt=h, steps=steps, monitors=False, save_every=steps, accuracy=False)
    return run.dataset.mu.transpose("member", "time", ...).values[:, -1]


@pytest.mark.long
def test_a_rotation_about_an_axis_has_strong_and_weak_order_one():
    """μ × e₃ dt turns by −(ωt + σW); antithetic paths."""
    half = np.random.default_rng(11).normal(size=(1000, FINE)) / np.sqrt(FINE)
    dW = np.concatenate([half, -half])
    angle = OMEGA + SIGMA * dW.sum(axis=1)
    exact = np.stack([np.cos(angle), -np.sin(angle), 0.5 + 0 * angle], axis=1)
    gaps = [turned(dW, steps) - exact for steps in (8, 16, 32, 64)]
    strong = [np.mean(np.linalg.norm(gap, axis=1)) for gap in gaps]
    weak = [np.linalg.norm(np.mean(gap, axis=0)) for gap in gaps]
    h = np.log([1 / 8, 1 / 16, 1 / 32, 1 / 64])
    assert np.polyfit(h, np.log(strong), 1)[0] == pytest.approx(1, abs=0.1)
    assert np.polyfit(h, np.log(weak), 1)[0] == pytest.approx(1, abs=0.15)


@pytest.mark.long
def test_the_mean_on_a_sphere_decays_at_its_rate_with_weak_order_one():
    """A step turns by cay(σΔW): the mean of μ shrinks by c(h) = (1 + 2⟨cos θ⟩)/3, tan(θ/2) = σ|ΔW|/2, per step."""
    sigma, members = 0.8, 4000
    x, w = np.polynomial.laguerre.laggauss(60)  # |ΔW|² = 2hx has the density √x e^{−x} of three normal components

    def factor(h):
        square = 0.25 * sigma**2 * h * 2 * x
        cosine = (1 - square) / (1 + square)
        return (1 + 2 * np.sum(w * np.sqrt(x) * cosine) / np.sum(w * np.sqrt(x))) / 3

    errors = [abs(factor(h) ** round(1 / h) - np.exp(-(sigma**2))) for h in (0.05, 0.025)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1, abs=0.1)
    steps, h = 5, 0.2

    def noisy(mu, p, *, t):
        return 0.5 * mu @ mu + sigma * jnp.asarray(p.noise)[jnp.floor(t / h).astype(int)] @ mu

    tables = np.random.default_rng(2).normal(size=(members, steps + 1, 3)) / np.sqrt(h)
    body = co.System(co.SO3(), hamiltonian=noisy, parameters={"noise": co.each(tables)}, name="sphere")
    fleet = co.simulate(body, body.state(mu=[0.0, 0.0, 1.0]), dt=h, steps=steps, monitors=False, accuracy=False)
    last = fleet.dataset.mu.transpose("member", "time", ...).values[:, -1, 2]
    assert abs(np.mean(last) - factor(h) ** steps) < 4 * np.std(last) / np.sqrt(members)


def test_a_thermostat_steps_by_its_linear_recursion():
    """(1 + γh/2)ν₁ = (1 − γh/2)ν₀ + ΔW: its stationary variance is σ²/(2γ) for every h."""
    gamma, h, steps = 0.5, 0.5, 40
    particle = co.System(
        co.Translation(0),
        lambda xi, n, nu: 0.5 * nu @ nu,
        additional=co.Trivial(1),
        forces=lambda motion: co.Force(force=-gamma * motion.nu + motion.inputs),
        name="particle",
    )
    kicks = np.random.default_rng(3).normal(size=(steps, 1)) / np.sqrt(h)
    start = particle.state(q=[0.0], qdot=[0.7], inputs=kicks[0])
    inputs = co.Held(h * np.arange(steps), kicks)
    found = co.simulate(particle, start, dt=h, steps=steps, inputs=inputs, accuracy=False).records.pi[:, 0]
    expected = [0.7]
    for kick in kicks[:, 0]:
        expected.append(((1 - 0.5 * gamma * h) * expected[-1] + h * kick) / (1 + 0.5 * gamma * h))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
    shrink, gain = (1 - 0.5 * gamma * h) / (1 + 0.5 * gamma * h), np.sqrt(h) / (1 + 0.5 * gamma * h)
    assert gain**2 / (1 - shrink**2) == pytest.approx(1 / (2 * gamma), rel=1e-14)


@pytest.mark.long
def test_casimirs_of_a_top_advected_by_noise_stay_at_round_off_on_a_path():
    def top(mu, a, *, inputs):
        return 0.5 * mu @ (np.array([1.0, 0.7, 0.4]) * mu) + a[2] + 0.3 * inputs @ mu + 0.2 * inputs[0] * a[1]

    system, h, steps = co.System(co.SO3(), hamiltonian=top, advected=co.Defining(), name="top"), 0.02, 2000
    noise = np.random.default_rng(4).normal(size=(steps, 3)) / np.sqrt(h)
    start = system.state(mu=[0.3, 0.2, 1.0], a0=[0.6, 0.0, 0.8], inputs=noise[0])
    run = co.simulate(system, start, dt=h, steps=steps, inputs=co.Held(h * np.arange(steps), noise), accuracy=False)
    mu, a = run.records.mu, run.records.a
    assert np.ptp(np.sum(mu * a, axis=1)) < 1e-12 and np.ptp(np.linalg.norm(a, axis=1)) < 1e-13
    assert np.ptp(np.linalg.norm(mu, axis=1)) > 0.5
