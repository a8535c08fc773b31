"""A craft that another program steps: commands in, measurements and log out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.mechanics import State
from coadjoint.models.quantities import vector
from coadjoint.simulation import Stepper
from coadjoint.spaces import Named
from coadjoint_vehicles.model.craft import Craft
from coadjoint_vehicles.serving.inertial import inertial

_ACTUATOR = "actuator_"


class Reading(NamedTuple):
    """The reading at a node, SI, axes north, east, down and forward, starboard, down.

    t: s. position, velocity: of the body origin in space, (3,) m and m/s. rotation: R, (3, 3), from body to space.
    body_velocity: Rᵀ of the velocity over ground, (3,). angular_velocity, specific_force: as a gyroscope and an
    accelerometer would read them, (3,) rad/s and m/s². actuators: their actual values, by the names of their parts.
    """

    t: float
    position: np.ndarray
    velocity: np.ndarray
    rotation: np.ndarray
    body_velocity: np.ndarray
    angular_velocity: np.ndarray
    specific_force: np.ndarray
    actuators: dict[str, np.ndarray]


class Served:
    """A craft that is stepped from outside, by `dt`, and read.

        served = Served(craft, craft.start(position=(0, 0, 2)), dt=1 / 400)
        served.advance({"thrusters": [1500] * 8}, steps=4)
        served.reading().specific_force

    start: of the craft. imu: r, where the inertial unit sits, body axes, (3,) m. accuracy: as of `co.Stepper`. Without
    a controller the commands are those of the parts, which begin neutral; with one they are its set points, which the
    first call must give.
    Raises ArgumentError for arguments that do not fit.
    """

    def __init__(self, craft: Craft, start: State, dt: float, imu: Any = (0.0, 0.0, 0.0), accuracy: bool = True):
        self.craft, self.dt = craft, dt
        self.place = vector(imu, "imu", 3)
        self.commands = _commands(craft)
        self._missing = self._needed
        more: dict[str, PyTree] = {"inputs": self.commands, "observe": self._observe(), "accuracy": accuracy}
        self.stepper = Stepper(craft.system, start, dt=dt, **more)

    def _observe(self) -> dict[str, PyTree]:
        system, group = self.craft.system, self.craft.system.group
        measured = partial(inertial, system, self.place)
        commanded = [part.name for part in self.craft.vehicle.commanded]
        return {
            "velocity": lambda s: s.qdot,
            "position": lambda s: s.q,
            "rotation": lambda s: group.matrix(s.g),
            "body_velocity": lambda s: group.matrix(s.g).T @ s.qdot,
            "angular_velocity": lambda s, p: measured(s, p).angular_velocity,
            "specific_force": lambda s, p: measured(s, p).specific_force,
            **{_ACTUATOR + name: partial(standing, name) for name in commanded},
        }

    @property
    def _needed(self) -> set[str]:
        return set(self.commands) if self.craft.controller is not None else set()

    def advance(self, commands: Mapping[str, PyTree], steps: int) -> None:
        """`steps` steps with commands held over them; those that are left out stay as they are.

        Raises ArgumentError for commands that there are not, and StepError where a step fails: the craft stays at the
        last good node.
        """
        missing = self._missing - set(commands)
        if missing:
            raise ArgumentError(
                f"The set points {', '.join(sorted(missing))} have no value yet: the first commands must give them."
            )
        self.stepper.step(commands, n=steps)
        self._missing = set()

    def reset(self, start: State | None = None) -> None:
        """Back to the start, or to another one; commands go back to where they began, set points must be given."""
        self._missing = self._needed
        self.stepper.reset() if start is None else self.stepper.reset(start)

    @contextmanager
    def intact(self) -> Iterator[None]:
        """Go back to where the craft is now if an error leaves this context."""
        kept, missing = self.stepper.clone(), self._missing
        try:
            yield
        except Exception:
            self.stepper.restore(kept)
            self._missing = missing
            raise

    def reading(self) -> Reading:
        """The current reading."""
        seen = {key: value.copy() for key, value in self.stepper.observation.items()}
        actuators = {key.removeprefix(_ACTUATOR): value for key, value in seen.items() if key.startswith(_ACTUATOR)}
        measured = {key: value for key, value in seen.items() if not key.startswith(_ACTUATOR)}
        return Reading(t=float(self.stepper.t), actuators=actuators, **measured)


def _commands(craft: Craft) -> dict[str, PyTree]:
    """The names of the commands, with where they start."""
    if craft.controller is not None:
        return dict.fromkeys(craft.controller.inputs, 0.0)
    found: dict[str, PyTree] = {}
    for part in craft.vehicle.commanded:
        if part.command is not None:
            found[part.name] = np.full(part.command.shape, part.command.start)
    return found


def standing(name: str, state: State) -> PyTree:
    """The actual value of an actuator: a number, an array, or the numbers of its state one after another."""
    found = getattr(state.internal, name)
    leaves: Sequence[PyTree] = list(found.asdict().values()) if isinstance(found, Named) else [found]
    return leaves[0] if len(leaves) == 1 else jnp.concatenate([jnp.ravel(leaf) for leaf in leaves])
