"""Systems as a user writes them beside a run file."""

import jax.numpy as jnp
import numpy as np

import coadjoint as co


def lagrangian(xi, a, p):
    return 0.5 * xi @ p.inertia @ xi - p.weight * p.center @ a


def top(weight=20.0, center=(0, 0, 1)):
    parameters = {"inertia": np.diag([5.0, 5.0, 1.0]), "weight": weight, "center": np.asarray(center, dtype=float)}
    return co.System(co.SO3(), lagrangian, advected=co.Defining(), parameters=parameters, name="top")


def damped():
    """A top in a viscous fluid."""
    held = top()
    return co.System(
        co.SO3(),
        lagrangian,
        advected=co.Defining(),
        parameters=held.parameters,
        forces=lambda motion, p: co.Force(torque=-0.1 * motion.xi),
        name="damped top",
    )


def with_start(weight):
    system = top(weight)
    return system, system.state(xi=[0, 0, 50], a0=[0, 0, 1])


def square_root():
    """A motion that leaves the domain of its Lagrangian when q_z reaches 0."""
    return co.System(
        co.SO3(),
        lambda xi, n, nu: 0.5 * xi @ xi + 0.5 * nu @ nu + jnp.sqrt(n[2]),
        additional=co.Trivial(3),
        name="a fall",
    )


def rigid_motion():
    return co.System(co.SE3(), lambda xi: 0.5 * xi @ xi, name="rigid motion")


def raises():
    return {}["mass"]


def number():
    return 3
