"""A spherical pendulum hung in a free rotating carrier, such as a spacecraft with a swinging tank or a gondola.

Run as: python examples/spherical_pendulum.py [duration in s]
It prints the certificate, compares the energy band of two rules, and writes spherical_pendulum.png.

The carrier turns by R ∈ SO(3). The bob is a point q of the sphere S² about its centre, n = R⁻¹q seen from the carrier;
the direction of gravity is the advected parameter a = R⁻¹e_z. A spring in the carrier pulls the bob towards the
carrier's axis e₃, so that bob and carrier exchange momentum; only the vertical component of the total is kept.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 40.0


def lagrangian(xi, n, nu, a, p):
    kinetic = 0.5 * xi @ p.inertia @ xi + 0.5 * p.mass * p.length**2 * nu @ nu
    spring = 0.5 * p.spring * jnp.sum((n - jnp.array([0.0, 0.0, 1.0])) ** 2)
    return kinetic + p.mass * p.gravity * p.length * n @ a - spring  # e_z points down


pendulum = co.System(
    co.SO3(),
    lagrangian,
    additional=co.Sphere(),
    advected=co.Defining(),
    parameters={"inertia": np.diag([2.0, 1.6, 1.2]), "mass": 0.8, "length": 0.7, "gravity": 9.81, "spring": 3.0},
    name="spherical pendulum in a carrier",
    units={"energy": "J"},
)
start = pendulum.state(q=[0.6, 0.0, 0.8], qdot=[0.0, 1.5, 0.0], xi=[0.3, 0.1, 2.0], a0=[0, 0, 1])
runs = {
    "midpoint": co.simulate(pendulum, start, dt=0.01, duration=duration, method=co.Midpoint()),
    "Suzuki 4": co.simulate(pendulum, start, dt=0.05, duration=duration, method=co.Suzuki4(co.Midpoint())),
}
run = runs["midpoint"]
print(run)

off_sphere = float(np.max(np.abs(np.sum(run.dataset.q.values**2, axis=1) - 1)))
print(f"|q| = 1 within {off_sphere:.1e}; vertical momentum within {run.relative_change('kelvin_noether'):.1e}")

figure, (path, band) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
q, n = run.dataset.q.values[:800], run.dataset.n.values[:800]
path.plot(q[:, 0], q[:, 1], linewidth=0.8, label="space")
path.plot(n[:, 0], n[:, 1], linewidth=0.8, label="carrier")
path.set(aspect="equal", xlabel="first component", ylabel="second component", title="path of the bob, first 8 s")
path.set(xlim=(-0.95, 0.95), ylim=(-0.95, 1.3))
path.legend(loc="upper center", ncols=2)
for name, found in runs.items():
    energy = found.dataset.energy.values
    band.plot(found.dataset.time, np.abs(energy / energy[0] - 1), linewidth=0.8, label=f"{name}, dt = {found.dt:g} s")
band.set(yscale="log", ylim=(1e-10, 1e-2), xlabel="time (s)", ylabel="|E/E₀ − 1|", title="energy band")
band.legend(loc="lower right")
figure.savefig("spherical_pendulum.png", dpi=150)
