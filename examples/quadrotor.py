"""A quadrotor follows a circle that climbs, by geometric tracking control on SE(3).

Run as: python examples/quadrotor.py [duration in s: 20]
It prints the certificate and the distance from the path, and writes quadrotor.png: path, distance, and thrusts.

The state is (R, x) ∈ SE(3), with ξ = (ω, v) in the body frame, and height is an advected parameter. The controller is
that of Lee, Leok and McClamroch, Geometric tracking control of a quadrotor UAV on SE(3), CDC 2010, without feed-forward
of angular velocities.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
GRAVITY, ARM, YAW, RATE = 9.81, 0.2, 0.02, 0.6  # m/s², m, m, rad/s
MIX = np.array([[1, 1, 1, 1], [0, ARM, 0, -ARM], [-ARM, 0, ARM, 0], [YAW, -YAW, YAW, -YAW]])  # thrusts → (f, torque)


def lagrangian(xi, a, p):
    return 0.5 * xi[:3] @ p.inertia @ xi[:3] + 0.5 * p.mass * xi[3:] @ xi[3:] - p.mass * GRAVITY * a[3]


def rotors(motion, p):
    lift, roll, pitch, yaw = jnp.asarray(MIX) @ motion.inputs.thrusts
    return co.Force(torque=jnp.stack([roll, pitch, yaw, 0.0, 0.0, lift]))


def path(t):
    """The wanted position, velocity and acceleration."""
    c, s, one = jnp.cos(RATE * t), jnp.sin(RATE * t), jnp.ones_like(t)
    place = jnp.stack([2 * s, 2 - 2 * c, 0.2 * t])
    return place, jnp.stack([2 * RATE * c, 2 * RATE * s, 0.2 * one]), RATE**2 * jnp.stack([-2 * s, 2 * c, 0 * one])


def vee(m):
    return 0.5 * jnp.stack([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])


def controller(motion):
    R, x = motion.g
    omega, v = motion.xi[:3], R @ motion.xi[3:]
    place, velocity, acceleration = path(motion.t)
    force = p.mass * (acceleration + jnp.array([0, 0, GRAVITY]) - 4.0 * (x - place) - 3.0 * (v - velocity))
    up = force / jnp.linalg.norm(force)
    side = jnp.cross(up, jnp.array([1.0, 0, 0]))
    side /= jnp.linalg.norm(side)
    wanted = jnp.stack([jnp.cross(side, up), side, up], axis=1)
    torque = -2.0 * vee(wanted.T @ R - R.T @ wanted) - 0.3 * omega + jnp.cross(omega, p.inertia @ omega)
    return {"thrusts": jnp.asarray(np.linalg.inv(MIX)) @ jnp.stack([force @ R[:, 2], *torque])}


p = co.Parameters(mass=1.2, inertia=np.diag([0.02, 0.02, 0.04]))
quadrotor = co.System(co.SE3(), lagrangian, advected=co.spaces.Dual(), forces=rotors, parameters=p, name="quadrotor")
start = quadrotor.state(a0=[0, 0, 1, 0])  # a·(r, 1) is the height of a point r of the body
run = co.simulate(quadrotor, start, dt=0.01, duration=duration, inputs=controller)
print(run)

time, x = run.dataset.time.values, run.dataset.x.values
wanted = np.asarray(path(time)[0]).T
distance = np.linalg.norm(x - wanted, axis=1)
print(f"distance from the path at most {distance.max():.2f} m, at the end {distance[-1]:.3f} m")

figure = plt.figure(figsize=(13, 4), layout="constrained")
space = figure.add_subplot(1, 3, 1, projection="3d")
space.plot(*wanted.T, "--", color="0.6", label="wanted")
space.plot(*x.T, label="flown")
space.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
space.set_box_aspect(None, zoom=0.85)
right = [figure.add_subplot(1, 3, k) for k in (2, 3)]
right[0].plot(time, distance)
right[0].set(xlabel="t (s)", ylabel="distance from the path (m)")
right[1].plot(time, run.dataset.inputs_thrusts.values, label=[f"rotor {k}" for k in range(1, 5)])
right[1].set(xlabel="t (s)", ylabel="thrust (N)")
right[1].legend()
figure.savefig("quadrotor.png", dpi=110)
