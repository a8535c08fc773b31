"""The paper's underwater vehicle in a steady current, with quadratic drag.

Run as: python examples/vehicle_in_current.py [duration in s]
It prints the certificate, compares the final velocity with that of the water, and writes vehicle_in_current.png.

The current u is a vector of the world, so in the body frame it is an advected parameter beside the direction of down:
b = R⁻¹u. The kinetic energy, of the body and of the water it carries along, is that of the velocity ν − b relative to
the water; weight and buoyancy never see b.
"""

import sys

import jax.numpy as jnp
import numpy as np

import coadjoint as co

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 300.0

parameters = co.Parameters(
    mass=123.8,  # kg
    added_mass=np.diag([65, 70, 75]),  # kg
    inertia=np.diag([5.46, 5.29, 5.72]),  # kg m²
    net_weight=123.8 * 9.81 - 1215.8,  # N, downwards
    buoyancy=1215.8,  # N
    center_of_buoyancy=[0, 0, -0.007],  # m, from the centre of mass
    drag=[20.0, 60.0, 60.0],  # N s²/m²
    damping=5.0,  # N m s
)


def lagrangian(xi, n, nu, a, p):
    w = nu - a.current
    kinetic = 0.5 * w @ (p.mass * w + p.added_mass @ w) + 0.5 * xi @ p.inertia @ xi
    return kinetic + p.net_weight * n @ a.down - p.buoyancy * p.center_of_buoyancy @ a.down


def forces(motion, p):
    w = motion.nu - motion.a.current
    return co.Force(torque=-p.damping * motion.xi, force=-p.drag * jnp.abs(w) * w)


vehicle = co.System(
    co.SO3(),
    lagrangian,
    additional=co.Defining(),
    advected={"down": co.Defining(), "current": co.Defining()},
    forces=forces,
    parameters=parameters,
    name="vehicle in a current",
    units={"q": "m", "qdot": "m/s", "xi": "rad/s", "energy": "J"},
)
current = np.array([0.3, -0.1, 0.0])
start = vehicle.state(
    q=[0, 0, 1], xi=np.radians([10, 0, 20]), qdot=[0.1, 0.1, 0.8], a0={"down": [0, 0, 1], "current": current}
)
run = co.simulate(vehicle, start, dt=0.02, duration=duration, save_every=10)

print(run)
print(f"velocity at the end {run.dataset.qdot.values[-1].round(4)} m/s, the water's {current} m/s")
rise = np.sqrt(-vehicle.parameters.net_weight / vehicle.parameters.drag[2])
print(
    f"it rises at {-run.dataset.qdot.values[-1, 2]:.4f} m/s; drag equals net buoyancy at {rise:.4f} m/s if it is level"
)
run.plot.trajectory(z_down=True, path="vehicle_in_current.png")
