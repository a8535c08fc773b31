"""The columns of logs of vehicles, as functions of the simulated state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree
from coadjoint.groups import SE3, SO3
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.spaces import Defining
from coadjoint.spaces.charts import roll_pitch_yaw

POSITION, ATTITUDE = ("north", "east", "depth"), ("roll", "pitch", "heading")
VELOCITY, RATES = ("u", "v", "w"), ("p", "q", "r")
VEHICLE = (*POSITION, *ATTITUDE, *VELOCITY, *RATES)
"""The columns of a vehicle's log: of O in space; Euler angles ZYX; of O over ground, and ω, in body axes."""

UNITS = {
    **dict.fromkeys(POSITION, "m"),
    **dict.fromkeys(ATTITUDE, "rad"),
    **dict.fromkeys(VELOCITY, "m/s"),
    **dict.fromkeys(RATES, "rad/s"),
}


@dataclass(frozen=True)
class Channels:
    """Numbers that a log holds, in their order: those of a vehicle by name, others by functions of the state.

    `own`: pairs of name and function (state) → number. `vehicle`: names of `VEHICLE`. With `rotation` the nine numbers
    of the attitude matrix follow. `levers`: pairs of such a name and r, m, the place of the sensor in the body: it
    measures the position q + Rr and the velocity ν + ω × r.
    """

    vehicle: tuple[str, ...]
    own: tuple[tuple[str, Callable[[State], PyTree]], ...] = ()
    rotation: bool = False
    levers: tuple[tuple[str, tuple[float, float, float]], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return (*self.vehicle, *(name for name, _ in self.own))

    def of(self, system: System, state: State) -> Array:
        """The simulated measurements at a node."""
        known = dict(vehicle(system, state)) if self.vehicle else {}
        known |= self._elsewhere(system, state, known)
        node = at_node(system, state) if self.own else state
        values = [known[name] for name in self.vehicle] + [jnp.asarray(f(node), float) for _, f in self.own]
        if self.rotation:
            values += list(jnp.ravel(_rotation(system, state)))
        return jnp.stack(values)

    def _elsewhere(self, system: System, state: State, known: Mapping[str, Array]) -> dict[str, Array]:
        """The measurements of sensors away from O, by name."""
        found = {}
        for name, r in self.levers:
            if name in POSITION:
                found[name] = known[name] + _rotation(system, state)[POSITION.index(name)] @ jnp.asarray(r)
            else:
                omega = jnp.stack([known[rate] for rate in RATES])
                found[name] = known[name] + jnp.cross(omega, jnp.asarray(r))[VELOCITY.index(name)]
        return found


def _rotation(system: System, state: State) -> Array:
    return state.g if isinstance(system.group, SO3) else state.g[0]


def is_vehicle(system: System) -> bool:
    """Whether a pose and a body velocity can be read from the states of a system."""
    on_rotations = isinstance(system.group, SO3) and system.additional == Defining()
    return on_rotations or (isinstance(system.group, SE3) and system.additional.ambient(system.group) == 0)


def vehicle(system: System, state: State) -> Mapping[str, Array]:
    """Position, Euler angles ZYX, body velocity and rates at a node, by their names."""
    node = at_node(system, state)
    xi, nu = node.xi, node.nu
    if isinstance(system.group, SO3):
        R, q, omega, v = state.g, system.additional.act(system.group, state.g, state.n), xi, nu
    else:
        (R, q), omega, v = state.g, xi[:3], xi[3:]
    return dict(zip(VEHICLE, (*q, *roll_pitch_yaw(R), *v, *omega), strict=True))


def seen(system: System, records: State, names: tuple[str, ...]) -> dict[str, PyTree]:
    """The channels of records (with a leading axis) by their names, as arrays."""
    channels = Channels(names)
    values = evaluate(jax.vmap(lambda state: channels.of(system, state)), records)
    return {name: values[:, i] for i, name in enumerate(names)}
