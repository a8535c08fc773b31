"""A heavy top advected by noise: Casimirs on every path, and strong and weak orders against Heun's method.

Run as: python examples/stochastic_top.py [members, 1000]; it prints the orders and writes stochastic_top.png.
Stochastic advection by Lie transport, ξ dt = ∂ℋ/∂μ dt + Σ σ_i e_i ∘ dW_i; the midpoint rule holds ΔW/h over a step.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

members = 2 * (int(sys.argv[1]) // 2) if len(sys.argv) > 1 else 1000
inverse, center = np.array([1.0, 0.7, 0.4]), np.array([0.2, 0.0, 0.8])
fine, coarse, mu0, a0 = 2048, (4, 8, 16, 32), np.array([0.3, 0.2, 1.0]), np.array([0.6, 0.0, 0.8])


def hamiltonian(mu, a, p, *, t):
    noise = jnp.asarray(p.noise)[jnp.floor(t / p.dt).astype(int)]  # ΔW/h of the step
    return 0.5 * mu @ (inverse * mu) + center @ a + jnp.asarray(p.sigma) * noise @ mu


def heun(sigma, dW):
    """(μ, a) at t = 1: dμ = μ × ω + a-torque, da = a × ω with ω dt = I⁻¹μ dt + σ ∘ dW, by Heun's method."""

    def change(y, dW, h):
        mu, a = y[:, :3], y[:, 3:]
        omega = h * inverse * mu + sigma * dW
        return np.hstack([np.cross(mu, omega) + h * np.cross(a, center), np.cross(a, omega)])

    y, h = np.tile(np.concatenate([mu0, a0]), (members, 1)), 1 / dW.shape[1]
    for k in range(dW.shape[1]):
        first = change(y, dW[:, k], h)
        y = y + 0.5 * (first + change(y + first, dW[:, k], h))
    return y


def fleet(sigma, dW, steps):
    """(μ, a) of all members at t = 1 by the midpoint rule with increments summed over its steps."""
    h, held = 1 / steps, np.zeros((members, coarse[-1] + 1, 3))
    held[:, :steps] = dW.reshape(members, steps, -1, 3).sum(axis=2) / h
    noise = {"noise": co.each(held), "dt": h, "sigma": sigma}
    system = co.System(co.SO3(), hamiltonian=hamiltonian, advected=co.Defining(), parameters=noise)
    run = co.simulate(system, system.state(mu=mu0, a0=a0), dt=h, steps=steps, monitors=False, save_every=steps)
    return np.concatenate([run.dataset[k].transpose("member", "time", ...).values[:, -1] for k in ("mu", "a")], axis=1)


half = np.random.default_rng(5).normal(size=(members // 2, fine, 3)) / np.sqrt(fine)
dW = np.concatenate([half, -half])  # antithetic paths
h, errors = 1 / np.array(coarse), {}
for name, sigma in {"one direction": [0.5, 0, 0], "three directions": [0.5, 0.5, 0.5]}.items():
    exact = heun(np.array(sigma), dW)
    gaps = np.stack([fleet(sigma, dW, steps) - exact for steps in coarse])
    strong, weak = np.mean(np.linalg.norm(gaps, axis=2), axis=1), np.linalg.norm(np.mean(gaps, axis=1), axis=1)
    errors[name] = {"strong": strong, "weak": weak}
orders = {k: {kind: np.polyfit(np.log(h), np.log(e), 1)[0] for kind, e in both.items()} for k, both in errors.items()}
for name, both in orders.items():
    print(f"{name:>16}: strong order {both['strong']:.2f}, weak order {both['weak']:.2f}")
steps, h_long = 4000, 0.025  # one long path: E changes, |a| and μ·a, the Casimirs of SE(3)*, do not
path = np.random.default_rng(6).normal(size=(steps + 1, 3)) / np.sqrt(h_long)
noise = {"noise": path, "dt": h_long, "sigma": [0.2] * 3}
top = co.System(co.SO3(), hamiltonian=hamiltonian, advected=co.Defining(), parameters=noise)
run = co.simulate(top, top.state(mu=mu0, a0=a0), dt=h_long, steps=steps)
mu, a = run.records.mu, run.records.a
casimirs = {"|a|": np.linalg.norm(a, axis=1), "μ·a": np.sum(mu * a, axis=1)}
energy = 0.5 * np.sum(inverse * mu**2, axis=1) + a @ center
print({name: f"changes by {np.ptp(values):.0e}" for name, values in {**casimirs, "energy": energy}.items()})
figure, (left, right), x = *plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained"), np.log2(h)
for name, style in (("one direction", "-"), ("three directions", "--")):
    for kind, mark in (("strong", "o"), ("weak", "s")):
        left.semilogy(x, errors[name][kind], mark + style, ms=4, label=f"{kind}, {name}: {orders[name][kind]:.1f}")
left.set(xlabel="log₂ h", ylabel="error of (μ, a) at t = 1", title="orders of the midpoint rule")
left.legend(fontsize=6)
for name, values in {"energy": energy, **casimirs}.items():
    right.semilogy(run.records.t, np.abs(values - values[0]) + 1e-17, lw=0.7, label=name)
right.set(xlabel="time", ylabel="change along one path", title="coadjoint orbits are kept")
right.legend(fontsize=7)
figure.savefig("stochastic_top.png", dpi=150)
