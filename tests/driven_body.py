"""A driven body with a brake and a motor, for tests of steppers."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

import coadjoint as co

H, STEPS, SEED = 0.02, 40, 15


def lagrangian(xi, p, *, inputs):
    return 0.5 * p.inertia @ xi**2 + 0.3 * inputs.spin * xi[2] + 0.1 * inputs.spin * xi[0] ** 2


def motor(motion, p):
    return co.Force(torque=p.power * motion.inputs.torque - motion.internal.brake * motion.xi)


def rule(motion, h, p):
    """A brake that follows the spin with a lag, and a random number generator's worth of memory."""
    brake = motion.internal.brake  # one product that may fuse, so that every program has the same bits
    return {"brake": brake + (1 - jnp.exp(-h / p.lag)) * (jnp.abs(motion.inputs.spin) - brake)}


BODY = co.System(
    co.SO3(),
    lagrangian,
    parameters=co.Parameters(inertia=[1.0, 1.5, 2.0], power=1.3, lag=0.3),
    forces=motor,
    internal=rule,
    name="driven body",
)
REST = {"spin": 0.1, "torque": np.zeros(3)}
START = BODY.state(xi=[0.3, -0.4, 1.0], inputs=REST, internal={"brake": 0.1})
OBSERVE = {"xi": lambda s: s.xi, "energy": lambda s, p: 0.5 * p.inertia @ s.xi**2, "t": lambda s: s.t}


def commands(count: int = STEPS) -> list[dict]:
    random = np.random.default_rng(SEED)
    return [{"spin": random.normal(), "torque": random.normal(size=3)} for _ in range(count)]


def tables(given: list[dict]) -> dict:
    times = H * np.arange(len(given))
    return {name: co.Held(times, [command[name] for command in given]) for name in REST}


def stepper(**options) -> co.Stepper:
    return co.Stepper(BODY, START, **{"dt": H, "inputs": REST, "observe": OBSERVE, **options})


def same(state: co.State, other: co.State) -> bool:
    names = ("t", "g", "mu", "t_rest")
    held = np.array_equal(state.internal.brake, other.internal.brake)
    return held and all(np.array_equal(getattr(state, name), getattr(other, name)) for name in names)
