"""The feedback of a controller, and its base class."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, check_fields, measured, not_negative
from coadjoint_vehicles.parts.numbers import Numbers


class Feedback(NamedTuple):
    """A craft as its controller sees it.

    position: (3,) m, north, east, down. velocity: v, of O through the water, ground_velocity: ν, omega: ω, (3,) each,
    body axes. down, north: directions in the body frame. roll, pitch, heading: rad. depth: m; sink: its rate, m/s.
    t: s. inputs: set points by name. actual: actuators by the names of their parts. q and g are the position and
    the rotation from the body to space, as a State has them.
    """

    position: Array
    velocity: Array
    ground_velocity: Array
    omega: Array
    down: Array
    north: Array
    roll: Array
    pitch: Array
    heading: Array
    depth: Array
    sink: Array
    t: Scalar
    inputs: Any
    actual: PyTree

    @property
    def q(self) -> Array:
        """Its position, as `State.q`."""
        return self.position

    @property
    def g(self) -> Array:
        """The rotation from the body to space, (3, 3), as `State.g`: north, east and down in the body frame."""
        numbers = np if isinstance(self.down, np.ndarray) else jnp
        return numbers.stack([self.north, numbers.cross(self.down, self.north), self.down])


@dataclass(frozen=True, eq=False, kw_only=True)
class Controller(Numbers, ABC):
    """A digital controller: it looks every `period` (s), and its commands are in force `delay` (s) later.

    period: from one look to the next, s. delay: until its commands are in force, s. Fields that hold numbers are
    parameters: `p.controller.gains` of the system, and `steer` gets `p.controller` as `own`.
    """

    kind: ClassVar[str] = ""
    """Its word in vehicle and mission files."""
    period: Measured = measured(u.TIME, positive, default=0.1)
    delay: Measured = measured(u.TIME, not_negative, default=0.0)

    def __post_init__(self) -> None:
        check_fields(self, f"controller `{type(self).__name__}")
        if not traced(self.delay, self.period) and self.delay > self.period:
            raise ArgumentError(
                f"Argument `delay` of the controller `{type(self).__name__}` must be at most the period, "
                f"{self.period:g} s, "
                f"but is {self.delay:g} s."
            )

    @property
    def keeps_level(self) -> bool:
        """Whether it keeps roll and pitch small, so that a run warns of a craft that turns over; by default not."""
        return False

    @property
    def ahead_only(self) -> bool:
        """Whether it never drives astern, so that a set point `speed` below 0 is an error; by default not."""
        return False

    @property
    def inputs(self) -> dict[str, str]:
        """The set points that a run must give, and their units."""
        return {}

    def memory(self) -> dict[str, PyTree]:
        """Its internal state, such as integrals, at the start."""
        return {}

    @property
    def ordered_to_limits(self) -> tuple[str, ...]:
        """The parts that it keeps at their limits on purpose, of which no run warns; by default none."""
        return ()

    def attributes(self) -> dict[str, str]:
        """Attributes of the datasets of its missions, by name; by default none."""
        return {}

    def fitted(self, vehicle: object) -> Controller:
        """The controller for this vehicle, with values derived from its parts and mass; by default unchanged."""
        return self

    def doubts(self, vehicle: object) -> list[str]:
        """A sentence for each thing about the vehicle that a run with it warns of; by default none."""
        return []

    @abstractmethod
    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Any
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        """Commands by the names of the parts, and the next internal state; jax.numpy only."""


def require_declared(controller: Controller) -> None:
    """Raise ArgumentError unless a controller declares its set points and its memory by name."""
    name, inputs, memory = type(controller).__name__, controller.inputs, controller.memory
    fits = isinstance(inputs, Mapping) and all(isinstance(text, str) for pair in inputs.items() for text in pair)
    checks.expect(
        fits,
        inputs,
        f"`inputs` of the controller `{name}`",
        "a dictionary of units by name, such as {'heading': 'rad'}",
    )
    if not callable(memory) or not isinstance(memory(), Mapping):
        raise ArgumentError(
            f"`memory` of the controller `{name}` must be a method that returns a dictionary, such as {{'total': 0.0}}."
        )
