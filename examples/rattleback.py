"""A rattleback: spun against its sense it rattles, stops and turns back; spun in its sense it keeps turning.

Run as: python examples/rattleback.py [duration in s: 15]
It prints the spins at the start and the end, and writes rattleback.png: spin and rattle over time for both senses.

An ellipsoid rolls without slipping on a table, and its axes of inertia are turned against those of its surface about
the vertical. With a, the direction of up in the body, the point of contact is r = −D²a/|Da| below the centre of the
ellipsoid, and its velocity ν + ξ × r vanishes: three rows on (ξ, ν). Numbers: Kane and Levinson, Int. J. Non-Linear
Mechanics 17 (1982) 175, without friction.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 15.0
mass, gravity, sink = 1.0, 9.81, 0.01  # the centre of mass is `sink` below the centre of the ellipsoid
axes = np.array([0.2, 0.03, 0.02])
inertia = np.array([[2e-4, -2e-5, 0], [-2e-5, 1.6e-3, 0], [0, 0, 1.7e-3]])


def lagrangian(xi, n, nu, a):
    return 0.5 * xi @ inertia @ xi + 0.5 * mass * nu @ nu - mass * gravity * n @ a


def contact(a):
    """The point of the ellipsoid that is lowest, from the centre of mass."""
    return -(axes**2) * a / jnp.sqrt(jnp.sum((axes * a) ** 2)) + np.array([0, 0, sink])


def rolling(n, a):
    return jnp.concatenate([jnp.stack([jnp.cross(e, contact(a)) for e in np.eye(3)], axis=1), np.eye(3)], axis=1)


stone = co.System(
    co.SO3(),
    lagrangian,
    additional=co.Defining(),
    advected=co.Defining(),
    constraints={"rolling": co.Nonholonomic(rolling)},
    name="rattleback",
)


def spun(rate):
    """The stone on the table, leaning by half a degree, with a spin about the vertical."""
    g = co.attitude.zyx(0, 0, np.radians(0.5))
    up = g.T @ [0, 0, 1]
    rates = rate * up
    r = np.asarray(contact(up))
    return stone.project(stone.state(g=g, q=-g @ r, xi=rates, qdot=g @ np.cross(r, rates), a0=[0, 0, 1]))


runs = {rate: co.simulate(stone, spun(rate), dt=0.001, duration=duration, accuracy=False) for rate in (-5.0, 5.0)}
spins = {rate: np.sum(run.dataset.xi.values * run.records.a, axis=1) for rate, run in runs.items()}
for rate, run in runs.items():
    spin = spins[rate]
    print(f"spun at {rate:.0f} rad/s: {spin.min():.2f} to {spin.max():.2f} rad/s, {spin[-1]:.2f} rad/s at the end")
    print(f"  energy within {run.relative_change('energy'):.1e}, slip {run.extrema['constraint_rate'][1]:.0e}")

figure, panels = plt.subplots(2, 1, figsize=(8, 6), sharex=True)
for rate, run in runs.items():
    panels[0].plot(run.dataset.time, spins[rate], label=f"spun at {rate:.0f} rad/s")
    panels[1].plot(run.dataset.time, np.degrees(np.arcsin(run.records.a[:, 0])), lw=0.8)
panels[0].axhline(0, color="grey", lw=0.5)
panels[0].set(ylabel="spin (rad/s)", title="a rattleback")
panels[1].set(xlabel="t (s)", ylabel="pitch (°)")
panels[0].legend()
figure.tight_layout()
figure.savefig("rattleback.png", dpi=110)
