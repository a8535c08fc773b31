"""The energy of a neutral vehicle over 100 000 s: Runge and Kutta's method against variational integrators.

python docs/figures/when_rk4.py        writes docs/figures/when_rk4.png and prints the table of docs/when_rk4.md
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

DURATION, SAVED = 1e5, 100.0
vehicle = co.models.paper_vehicle().replace(buoyancy=123.8 * 9.81)  # as heavy as its water: its motion stays bounded
start = vehicle.state(q=[0, 0, 1], xi=np.radians([10, 0, 20]), qdot=[0.1, 0.1, 0.8], a0=[0, 0, 1])
p = vehicle.parameters
mass = p.mass * np.eye(3) + p.added_mass


def derivative(y):
    R, w, v = y[:9].reshape(3, 3), y[9:12], y[12:]
    torque = jnp.cross(p.inertia @ w, w) + jnp.cross(mass @ v, v) - p.buoyancy * jnp.cross(p.center_of_buoyancy, R[2])
    turning = R @ jnp.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    rates = jnp.linalg.inv(p.inertia) @ torque, jnp.linalg.inv(mass) @ jnp.cross(mass @ v, w)
    return jnp.concatenate([turning.ravel(), *rates])


def runge_kutta(h):
    """R, ω, ν at the saved times, without the start."""

    def step(_, y):
        k1 = derivative(y)
        k2 = derivative(y + h / 2 * k1)
        k3 = derivative(y + h / 2 * k2)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + derivative(y + h * k3))

    def saved(y, _):
        y = jax.lax.fori_loop(0, round(SAVED / h), step, y)
        return y, y

    with co.float64():
        first = jnp.array([1, 0, 0, 0, 1, 0, 0, 0, 1, *np.radians([10, 0, 20]), 0.1, 0.1, 0.8])
        return np.asarray(jax.lax.scan(saved, first, length=round(DURATION / SAVED))[1])


def curves(name, h):
    """Time, change of energy, and distance from the group."""
    if name == "Runge–Kutta":
        y = runge_kutta(h)
        R, w, v = y[:, :9].reshape(-1, 3, 3), y[:, 9:12], y[:, 12:]
        E = 0.5 * np.sum(v * (v @ mass) + w * (w @ p.inertia), 1) + p.buoyancy * R[:, 2] @ p.center_of_buoyancy
        away = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2))
        E0 = co.simulate(vehicle, start, dt=0.1, steps=1).dataset.energy.values[0]
        return SAVED * np.arange(1, 1 + len(E)), abs(E / E0 - 1), away
    method = {"midpoint": co.Midpoint(), "Munthe-Kaas": co.methods.MuntheKaas()}.get(name, co.Suzuki4(co.Midpoint()))
    data = co.simulate(vehicle, start, dt=h, duration=DURATION, method=method, save_every=round(SAVED / h)).dataset
    E = data.energy.values
    return data.time.values[1:], abs(E[1:] / E[0] - 1), data.group_defect.values[1:]


figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
for name, h, colour in (("Runge–Kutta", 0.1, "C3"), ("Runge–Kutta", 0.02, "C1"), ("Munthe-Kaas", 0.1, "C4"),
                        ("midpoint", 0.1, "C0"), ("Suzuki", 0.5, "C2")):  # fmt: skip
    time, energy, away = curves(name, h)
    print(f"{name:12s}{h:5g} s   energy at 1000 s {energy[:10].max():8.1e}, at 100 000 s {energy.max():8.1e}", end="")
    print(f"   off the group {away.max():8.1e}")
    axes.loglog(time, np.maximum(energy, 1e-12), linewidth=0.8, color=colour, label=f"{name}, {h:g} s")
axes.set(xlabel="time (s)", ylabel="relative change of energy", ylim=(1e-11, 1e-1))
axes.legend(fontsize=8, frameon=False, loc="upper left", ncols=2)
figure.savefig(Path(__file__).with_name("when_rk4.png"), dpi=130)
