"""A cat that falls upside down and lands on its feet, moved by the muscles of its spine alone.

Run as: python examples/falling_cat.py [time for the turn in s]
It prints the certificate, how far the cat has turned, and the momentum that it never had; it writes falling_cat.png.

Muscles bend the spine by 59°, carry the bend once round, and straighten it. They act between front and rear, so that
the momentum stays at zero, and yet the cat turns over: the holonomy of its loop of shapes.
"""

import sys

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import coadjoint as co
from coadjoint.models import catalogue, falling_cat

duration = float(sys.argv[1]) if len(sys.argv) > 1 else 0.5
bend = 2 * np.arccos((np.sqrt(13) - 1) / 3)


def smooth(t, first, last):
    s = jnp.clip((t / duration - first) / (last - first), 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def wanted(t):
    """The shapes that the cat wants to go through: the bend of its spine, forwards and sideways."""
    size = bend * (smooth(t, 0.0, 0.25) - smooth(t, 0.75, 1.0))
    direction = 2 * jnp.pi * smooth(t, 0.25, 0.75)
    return size * jnp.stack([jnp.cos(direction), jnp.sin(direction)])


def muscles(motion, p):
    x, v = jax.jvp(wanted, (motion.t,), (jnp.ones_like(motion.t),))
    return co.Force(force=p.strength * (x - motion.n) + p.damping * (v - motion.nu))


parameters = catalogue["falling_cat"].make(stiffness=0.0).parameters.asdict()
cat = co.System(
    co.SO3(),
    falling_cat.lagrangian,
    additional=co.Trivial(2),
    parameters={**parameters, "strength": 200.0, "damping": 2.5},
    forces=muscles,
    name="falling cat",
)
upside_down = np.diag([1.0, -1.0, -1.0])
run = co.simulate(cat, cat.state(g=upside_down, q=[0, 0]), dt=duration / 500, duration=duration)
print(run)

relative = upside_down.T @ run.records.g
turn = np.degrees(np.unwrap(np.arctan2(relative[:, 2, 1], relative[:, 1, 1])))
momentum = np.max(np.abs(run.records.mu))
print(f"turned by {abs(turn[-1]):.2f}° with a momentum of at most {momentum:.1e} kg m²/s")

t = run.dataset.time.values
figure, (angles, shapes) = plt.subplots(1, 2, figsize=(7.2, 3), layout="constrained")
angles.plot(t, abs(turn), label="turn about the spine")
angles.plot(t, np.degrees(np.hypot(*run.records.n.T)), label="bend of the spine")
angles.set(xlabel="time (s)", ylabel="angle (°)", yticks=[0, 60, 120, 180])
angles.legend(frameon=False, loc="upper left")
shapes.plot(*np.degrees(run.records.n.T))
shapes.set(xlabel="bend towards the belly (°)", ylabel="to the side (°)", aspect="equal", title="the loop of shapes")
figure.savefig("falling_cat.png", dpi=150)
