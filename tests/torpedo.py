"""A torpedo with linear and quadratic damping, thrust, rudder and stern planes, for tests of identification."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.models.general_form import lagrangian

LINEAR, QUADRATIC = (3.0, 30.0, 30.0, 0.3, 4.0, 4.0), (5.0, 100.0, 100.0, 0.1, 10.0, 10.0)
ADDED = (0.84, 29.0, 29.0, 0.03, 3.4, 3.4)
NOISE = {
    **dict.fromkeys(("north", "east"), 0.1), "depth": 0.02,
    **dict.fromkeys(("roll", "pitch"), 0.005), "heading": 0.01,
    **dict.fromkeys(("u", "v", "w"), 0.01), **dict.fromkeys(("p", "q", "r"), 0.003),
}  # fmt: skip


def damping(motion, p):
    both = jnp.concatenate([motion.nu, motion.xi])
    force = -p.linear * both - p.quadratic * jnp.abs(both) * both
    return co.Force(torque=force[3:], force=force[:3])


def fins(motion, p):
    inputs, u = motion.inputs, motion.nu[0]
    lift, zero = 10.0 * u * jnp.abs(u), 0.0 * u
    return co.Force(
        torque=-0.7 * lift * jnp.stack([zero, inputs.planes, inputs.rudder]),
        force=jnp.stack([inputs.thrust, -lift * inputs.rudder, lift * inputs.planes]),
    )


def torpedo():
    base = co.models.general_vehicle(
        mass=31.0, inertia=(0.2, 4.0, 4.0), added_mass=ADDED, center_of_mass=(0.0, 0.0, 0.02)
    )
    assert base.parameters is not None
    return co.System(
        co.SO3(),
        lagrangian,
        additional=co.Defining(),
        advected=co.Defining(),
        parameters=co.Parameters(**base.parameters.asdict(), linear=LINEAR, quadratic=QUADRATIC),
        forces={"damping": damping, "fins": fins},
        name="torpedo",
    )


def start(system):
    inputs = {"thrust": 0.0, "rudder": 0.0, "planes": 0.0}
    return system.state(q=[0, 0, 5.0], qdot=[1.2, 0, 0], a0=[0, 0, 1.0], inputs=inputs)


def zigzags(duration, interval=0.1):
    """Times, and thrust, rudder and stern planes that jump in many rhythms."""
    t = np.arange(0.0, duration, interval)

    def zigzag(period, size, phase=0.0):
        return size * np.sign(np.sin(2 * np.pi * (t + phase) / period) + 1e-12)

    inputs = {
        "thrust": 12 + zigzag(23, 6) + zigzag(9, 3),
        "rudder": zigzag(16, 0.3) + zigzag(7, 0.15),
        "planes": zigzag(11, 0.2, 3) + zigzag(5, 0.1),
    }
    return t, inputs


def guessed(system):
    """The system with parameters that are off by tens of percent."""
    p = system.parameters
    return system.replace(linear=1.5 * p.linear, quadratic=0.6 * p.quadratic, added_mass=1.3 * p.added_mass)
