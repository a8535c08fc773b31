"""A satellite turns by its three reaction wheels: the total angular momentum stays zero.

Run as: python examples/satellite.py [duration in s: 120]
It prints the certificate, the final attitude and the total momentum, and writes satellite.png: yaw, pitch and roll,
rates of the wheels, and the angular momentum of body and wheels in space.

The wheels turn by angles q about the axes of the body, at rates ν relative to it:

    ℓ = ½ ξ·Jξ + ½ I |ξ + ν|²

A motor acts on a wheel and, by the same torque, on the body, so the motors are forces on q alone.
"""

import sys

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 120.0


def lagrangian(xi, n, nu, p):
    wheels = xi + nu
    return 0.5 * xi @ p.inertia @ xi + 0.5 * p.wheel * wheels @ wheels


def motors(motion, p):
    return co.Force(force=motion.inputs.torque)


def controller(motion):
    """Torques on the wheels (N m) that turn the body to R = 1: proportional to the error of attitude and to ξ."""
    R = motion.g
    error = 0.5 * jnp.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return {"torque": jnp.clip(0.2 * error + 2.0 * motion.xi, -0.05, 0.05)}


p = co.Parameters(inertia=np.diag([10.0, 12.0, 8.0]), wheel=0.05)  # kg m²
satellite = co.System(
    co.SO3(), lagrangian, additional=co.Trivial(3), forces=motors, parameters=p, name="satellite with reaction wheels"
)
start = satellite.state(g=co.attitude.zyx(1.2, 0.3, -0.5), xi=[0, 0, 0], q=[0, 0, 0], qdot=[0, 0, 0])
run = co.simulate(satellite, start, dt=0.05, duration=duration, inputs=controller)
print(run)

data = run.dataset
time, R, rates = data.time.values, data.R.values, data.qdot.values
body = np.einsum("tij,tj->ti", R, data.xi.values @ p.inertia)
wheels = np.einsum("tij,tj->ti", R, p.wheel * (data.xi.values + rates))
error = np.degrees(np.arccos(np.clip(0.5 * (np.trace(R[-1]) - 1), -1, 1)))
total = np.abs(body + wheels).max()
print(f"{error:.2f}° from its goal; the total momentum stays below {total:.0e} of {np.abs(body).max():.2f} N m s")

figure, panels = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
panels[0].plot(time, np.degrees(data.euler_angles.values), label=["yaw", "pitch", "roll"])
panels[0].set(xlabel="t (s)", ylabel="angle (°)")
panels[1].plot(time, rates, label=["wheel x", "wheel y", "wheel z"])
panels[1].set(xlabel="t (s)", ylabel="rate (rad/s)")
panels[2].plot(time, body[:, 2], label="body, z")
panels[2].plot(time, wheels[:, 2], label="wheels, z")
panels[2].plot(time, (body + wheels)[:, 2], "k--", label="sum")
panels[2].set(xlabel="t (s)", ylabel="angular momentum in space (N m s)")
for axes in panels:
    axes.legend()
figure.savefig("satellite.png", dpi=110)
