"""A task of an environment: the start, the reward and the ends of episodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.models.quantities import not_negative, positive
from coadjoint_vehicles.controllers.proposed import own_controller
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.water.water import Water

Function = Callable[..., PyTree]
"""A function of the `Feedback`, or of the `Feedback` and the parameters, in jax.numpy."""


class End(NamedTuple):
    """An end of an episode: `when` is true. reward: added to that of the last period. success: of the task."""

    when: Function
    reward: float = 0.0
    success: bool = False


@dataclass(frozen=True, kw_only=True)
class Task(ABC):
    """A task for a vehicle; all functions of the `Feedback` are traced into the machine code.

    seconds: an episode is truncated after so long, s. effort: c, the reward of a period is `reward` − c mean(a²), a the
    actuators' places between −1 and 1. penalty: subtracted if an episode ends badly or a step fails.
    Raises ArgumentError.
    """

    observed: ClassVar[tuple[str, ...]] = ()
    """The observations that are shown unless others are asked for."""
    seconds: float = 30.0
    effort: float = 0.05
    penalty: float = 50.0

    def __post_init__(self) -> None:
        positive(self.seconds, "seconds")
        not_negative(self.effort, "effort")
        not_negative(self.penalty, "penalty")

    @abstractmethod
    def reward(self, feedback: Feedback) -> Array:
        """The reward of a period from its last node, one number."""

    @abstractmethod
    def start(self, random: np.random.Generator) -> dict[str, PyTree]:
        """Where an episode begins: position, euler_zyx, velocity or speed, and angular_velocity of `Craft.start`."""

    def ends(self) -> dict[str, End]:
        """The ends of an episode before its time, by name."""
        return {}

    def observations(self) -> dict[str, Function]:
        """The observations that the task adds, by name."""
        return {}

    def parameters(self, random: np.random.Generator) -> dict[str, PyTree]:
        """Parameters of the craft that are others in every episode, by paths such as "water.velocity"."""
        return {}

    def goal(self) -> np.ndarray:
        """Points to draw, (k, 3) m, the last of which is where to go."""
        return np.zeros((0, 3))

    def water(self) -> Water | None:
        """The water of the task; None for still water."""
        return None

    def actuators(self, vehicle: Vehicle) -> dict[str, PyTree]:
        """Where the actuators of the vehicle start, by the names of their parts; the others start neutral."""
        return {}

    def helm(self, vehicle: Vehicle) -> Controller:
        """The controller whose set points actions are."""
        return own_controller(vehicle)

    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """The range of set points, by names."""
        return {"heading": (-np.pi, np.pi), "pitch": (-0.5, 0.5), "roll": (-0.5, 0.5), "speed": (0.0, 2.0)}


def towards(feedback: Feedback, place: Array) -> Array:
    """Rᵀ(place − q), (3,) m: where a place in space lies from the vehicle, body axes."""
    return feedback.g.T @ (place - feedback.position)


def length(vector: Array) -> Array:
    """|v|, one number, with a derivative at 0."""
    return jnp.sqrt(vector @ vector + 1e-12)


def misaligned(feedback: Feedback, heading: float) -> Array:
    """½(1 − cos of the angle to level ahead) + ½(1 − cos of the tilt), from 0 to 2: one number."""
    ahead = feedback.north[0] * np.cos(heading) + feedback.g[1, 0] * np.sin(heading)
    return 0.5 * (1.0 - ahead) + 0.5 * (1.0 - feedback.down[2])


def facing(heading: float) -> Function:
    """The observation of where a heading points to, (3,), body axes."""
    return lambda feedback: feedback.g.T @ jnp.array([np.cos(heading), np.sin(heading), 0.0])
