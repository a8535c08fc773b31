"""A disk that rolls without slipping: a steady circle against its closed form, and a disk that wobbles on its way.

Run as: python examples/rolling_disk.py [duration in s: 12]
It prints the error of the centre on the steady circle for two methods, and writes rolling_disk.png: the paths of the
contact points, and the force that the table puts under the wobbling disk.

The point of contact r = −R(a − (a·e₃)e₃)/|…| in the body, with a the direction of up there, has the velocity of the
table, ν + ξ × r = 0: three rows on (ξ, ν). Steady: (C + mR²)nΩ sin θ = (AΩ² sin θ − mgR) cos θ, with the lean θ of the
axis against the vertical, its precession Ω and the spin n about it.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 12.0
mass, R, gravity, lean, turning = 2.0, 0.3, 9.81, 1.2, 1.5
A, C = mass * R**2 / 4, mass * R**2 / 2
across = np.array([1.0, 1.0, 0.0])


def lagrangian(xi, n, nu, a):
    return 0.5 * A * (xi[0] ** 2 + xi[1] ** 2) + 0.5 * C * xi[2] ** 2 + 0.5 * mass * nu @ nu - mass * gravity * n @ a


def contact(a):
    return -R * a * across / jnp.sqrt(a[0] ** 2 + a[1] ** 2)


def rolling(n, a):
    return jnp.concatenate([jnp.stack([jnp.cross(e, contact(a)) for e in np.eye(3)], axis=1), np.eye(3)], axis=1)


disk = co.System(
    co.SO3(),
    lagrangian,
    additional=co.Defining(),
    advected=co.Defining(),
    constraints={"rolling": co.Nonholonomic(rolling)},
    name="rolling disk",
)


def start(rates):
    """Leaning by `lean`, touching the origin of the table, with the body's rates."""
    g = co.attitude.zyx(0, 0, lean)
    q, speed = g @ [0, R, 0], -np.cross(rates, [0, -R, 0])
    return disk.state(g=g, q=q, xi=rates, qdot=g @ speed, a0=[0, 0, 1])


spin = (A * turning * np.cos(lean) - mass * gravity * R / (turning * np.tan(lean))) / (C + mass * R**2)
steady = start([0, turning * np.sin(lean), spin])
arm = R * spin / turning
errors = {}
for method in (co.Midpoint(), co.Suzuki4(co.Midpoint())):
    for dt in (0.02, 0.01):
        run = co.simulate(disk, steady, dt=dt, duration=duration, method=method)
        angle = turning * run.final.t
        circle = [-arm * np.sin(angle), steady.q[1] - arm + arm * np.cos(angle), steady.q[2]]
        errors[method.title, dt] = np.linalg.norm(run.final.q - circle)
        slip = run.extrema["constraint_rate"][1]
        print(f"{method.title:<28} dt = {dt}  off the circle by {errors[method.title, dt]:.1e} m, slips {slip:.0e} m/s")

wobbling = co.simulate(disk, start([0.8, turning * np.sin(lean), spin]), dt=0.005, duration=duration)
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2))
for name, shown in (("steady", run), ("wobbling", wobbling)):
    touching = shown.dataset.q.values + np.einsum("tij,tj->ti", shown.records.g, [contact(a) for a in shown.records.a])
    left.plot(*touching[:, :2].T, label=name)
left.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="contact points")
left.legend()
force = np.sum(wobbling.dataset.reaction_rolling.values * wobbling.records.a, axis=1)
right.plot(wobbling.dataset.time, force)
right.axhline(mass * gravity, color="grey", linewidth=0.8)
right.set(xlabel="t (s)", ylabel="normal force (N)", title="reaction of the table")
figure.tight_layout()
figure.savefig("rolling_disk.png", dpi=110)
