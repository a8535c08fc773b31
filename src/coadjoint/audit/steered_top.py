"""A top with an actuator and a sampled controller, and its motion from command to command."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import jax.numpy as jnp
import numpy as np

from coadjoint.groups import SO3, attitude
from coadjoint.mechanics.continuous import reference
from coadjoint.mechanics.internal import sampled, sampling
from coadjoint.mechanics.internal_state import Course
from coadjoint.mechanics.state import Force, State
from coadjoint.mechanics.system import System
from coadjoint.spaces import Defining

LAG, PERIOD = 0.3, 0.5
"""Of the actuator and of the controller, s."""
PARAMETERS = {"inertia": np.diag([1.0, 1.3, 0.8]), "weight": 1.0, "center": [0.1, 0.2, 0.7], "damping": 0.15}


def _top(xi, a, p):
    return 0.5 * xi @ p.inertia @ xi - p.weight * p.center @ a


def _command(xi, a, t):
    """The torque that the controller asks for."""
    return 0.6 * jnp.sin(2.0 * t) * a - 0.5 * xi


def steered_top() -> tuple[System, State]:
    """The heavy top with damping and a torque that lags behind the commands of a sampled controller.

    τ Ṫ = u − T, u_k = ½(1.2 sin(2t) a − ω) at t = k·0.5 s; against DOP853 that begins anew at every command.
    """

    def rule(motion, h, p):
        def update(last):
            return {"torque": _command(motion.xi, motion.a, motion.t)}

        controller = sampled(motion, h, motion.internal.controller, update, period=PERIOD)
        u, torque, kept = controller["value"].torque, motion.internal.torque, jnp.exp(-h / LAG)
        course = Course(u + (torque - u) * kept, u + (torque - u) * (1 - kept) * LAG / h)
        return {"controller": controller, "torque": course}

    def forces(motion, p):
        return Force(torque=motion.internal.torque - p.damping * motion.xi)

    top = System(SO3(), _top, advected=Defining(), parameters=PARAMETERS, forces=forces, internal=rule)
    internal = {"torque": np.zeros(3), "controller": sampling({"torque": np.zeros(3)})}
    return top, top.state(g=attitude.zyx(0.3, 0.5, -0.4), xi=[0.5, -0.3, 2.5], a0=[0, 0, 1], internal=internal)


@lru_cache(maxsize=8)
def steered_exactly(time: float) -> State:
    """Its motion at a time: from command to command the torque is u + (T − u) exp(−(t − t_k)/τ)."""

    def forces(motion, p):
        torque = p.u + (p.torque - p.u) * jnp.exp(-(motion.t - p.since) / LAG)
        return Force(torque=torque - p.damping * motion.xi)

    start = steered_top()[1]
    known = {**PARAMETERS, "u": np.zeros(3), "torque": np.zeros(3), "since": 0.0}
    top = System(SO3(), _top, advected=Defining(), parameters=known, forces=forces)
    state = top.state(g=start.g, xi=start.xi, a0=[0, 0, 1])
    torque, times = np.zeros(3), np.append(np.arange(0.0, time - 1e-9, PERIOD), time)
    for since, until in pairwise(times):
        u = np.asarray(_command(np.asarray(state.xi), np.asarray(state.a), since), float)
        record = reference(top.replace(u=u, torque=torque, since=since), state, [until])
        state = state.replace(**{name: getattr(record, name)[0] for name in ("t", "g", "a", "xi", "mu")})
        torque = u + (torque - u) * np.exp(-(until - since) / LAG)
    return state
