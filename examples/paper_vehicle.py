"""The underwater vehicle of Ono, Fiori and Peng (2025), section 5: from ℓ to figures and residuals.

Run as: python examples/paper_vehicle.py [duration in s]
It prints the residuals of the paper's equations on a run, compares three methods with Runge and Kutta's, and writes
paper_vehicle.png. Seen from the body, n = Rᵀq is the place of the mass centre, ν = Rᵀq̇, and a = Rᵀe_z; z points down.
"""

import sys

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 500.0
p = co.Parameters(mass=123.8, added_mass=np.diag([65, 70, 75]), inertia=np.diag([5.46, 5.29, 5.72]),
                  net_weight=123.8 * 9.81 - 1215.8, buoyancy=1215.8, center_of_buoyancy=[0, 0, -0.007])  # fmt: skip


def lagrangian(xi, n, nu, a, p):  # (P57)–(P62)
    kinetic = 0.5 * nu @ (p.mass * nu + p.added_mass @ nu) + 0.5 * xi @ p.inertia @ xi
    return kinetic + p.net_weight * n @ a - p.buoyancy * p.center_of_buoyancy @ a


vehicle = co.System(co.SO3(), lagrangian, additional=co.Defining(), advected=co.Defining(), parameters=p)
start = vehicle.state(q=[0, 0, 1], xi=np.radians([10, 0, 20]), qdot=[0.1, 0.1, 0.8], a0=[0, 0, 1])  # Table 2
short = co.simulate(vehicle, start, dt=0.01, steps=200, method=co.LeftRectangle(start="velocity"))
print(co.theory.printed_equations(short))


def derivative(y):  # (P63)–(P65) for R, q, ω, ν: what the integrators above need nobody to write
    R, w, v = y[:9].reshape(3, 3), y[12:15], y[15:]
    cross, mass = jnp.cross, p.mass * jnp.eye(3) + p.added_mass
    torque = cross(p.inertia @ w, w) + cross(mass @ v, v) - p.buoyancy * cross(p.center_of_buoyancy, R[2])
    force = cross(mass @ v, w) + p.net_weight * R[2]
    turning = R @ jnp.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    return jnp.concatenate([turning.ravel(), R @ v, jnp.linalg.solve(p.inertia, torque), jnp.linalg.solve(mass, force)])


def runge_kutta(y, _, h=0.01):
    k1 = derivative(y)
    k2 = derivative(y + h / 2 * k1)
    k3 = derivative(y + h / 2 * k2)
    y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + derivative(y + h * k3))
    return y, y


with co.float64():
    first = jnp.array([1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, *np.radians([10, 0, 20]), 0.1, 0.1, 0.8])
    y = np.asarray(jax.lax.scan(runge_kutta, first, length=round(duration / 0.01))[1])[49::50]
R, q, w, v = y[:, :9].reshape(-1, 3, 3), y[:, 9:12], y[:, 12:15], y[:, 15:]
mv, Jw = v @ (p.mass * np.eye(3) + p.added_mass), w @ p.inertia
potential = p.buoyancy * R[:, 2] @ p.center_of_buoyancy - p.net_weight * q[:, 2]
vertical = np.sum(R[:, 2] * Jw, 1) + np.cross(q, np.einsum("tij,tj->ti", R, mv))[:, 2]  # momentum about the origin
curves = {"Runge–Kutta, order 4": (np.sum(v * mv + w * Jw, 1) / 2 + potential, vertical)}

methods = {
    "left rectangle: the paper's": (co.LeftRectangle(start="velocity"), 0.01),
    "midpoint": (co.Midpoint(), 0.01),
    "Suzuki, order 4": (co.Suzuki4(co.Midpoint()), 0.05),
}
for name, (method, dt) in methods.items():
    data = co.simulate(vehicle, start, dt=dt, duration=duration, method=method, save_every=round(0.5 / dt)).dataset
    E = data.discrete_energy if name.startswith("left") else data.energy  # the paper's energy is that of its rule
    curves[name] = E.values[1:], data.kelvin_noether.values[1:, 0]

figure = plt.figure(figsize=(10, 3), layout="constrained")
space, energy, momentum = (figure.add_subplot(1, 3, i, projection="3d" if i == 1 else None) for i in (1, 2, 3))
space.plot(data.q[:, 0], data.q[:, 1], -data.q[:, 2])
space.set(xlabel="x (m)", ylabel="y (m)", title="path, height in m", xticks=[0, 25, 50], yticks=[0, 25, 50])
for name, (E, m) in curves.items():
    energy.semilogy(data.time[1:], np.maximum(abs(E / E[0] - 1), 1e-16), linewidth=0.8, label=name)
    momentum.semilogy(data.time[1:], np.maximum(abs(m / m[0] - 1), 1e-16), linewidth=0.8)
energy.set(xlabel="time (s)", title="energy, |E/E₀ − 1|", ylim=(1e-16, 1e3))
energy.legend(fontsize=7, frameon=False, loc="upper left")
momentum.set(xlabel="time (s)", title="vertical momentum, |m/m₀ − 1|", ylim=(1e-16, 1e3))
figure.savefig("paper_vehicle.png", dpi=100)
