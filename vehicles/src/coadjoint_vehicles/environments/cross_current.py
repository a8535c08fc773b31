"""Cross a current that is not observed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.models.quantities import not_negative, positive, vector
from coadjoint_vehicles.environments.task import End, Function, Task, length, towards
from coadjoint_vehicles.model.controller import Feedback
from coadjoint_vehicles.water.water import StillWater, Water


@dataclass(frozen=True, kw_only=True)
class CrossCurrent(Task):
    """Go straight from one place to another through a uniform current across the way.

        r = min(q̇·t, U)/U − d/D

    t: the direction from `origin` to `place` (m), d: the distance to the line between them, U = `speed` (m/s),
    D = `far` (m). The current is level, across the way, and in every episode another one between ±`current` (m/s). An
    episode begins at the origin, drifting with the current, with the heading of the way. It ends well within `within`
    (m) of the place, badly with d > D or above the surface. Set points are those of the vehicle's own controller. With
    a user's water no current is drawn. Raises ArgumentError.
    """

    observed = ("offset", "line", "along", "down", "ground_velocity", "omega", "actuators")
    seconds: float = 60.0
    origin: Any = (0.0, 0.0, 5.0)
    place: PyTree = (10.0, 0.0, 5.0)
    speed: float = 0.5
    current: float = 0.4
    within: float = 0.5
    far: float = 5.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("origin", "place"):
            object.__setattr__(self, name, vector(getattr(self, name), name))
        for name in ("speed", "within", "far"):
            positive(getattr(self, name), name)
        not_negative(self.current, "current")
        if np.hypot(*(self.place - self.origin)[:2]) < 1e-6:
            raise ArgumentError(
                "Argument `place` must not lie above or below `origin`: the way between them has a course."
            )

    @property
    def along(self) -> np.ndarray:
        """The direction of the way, (3,)."""
        way = self.place - self.origin
        return way / np.linalg.norm(way)

    def beside(self, position: Array) -> Array:
        """From a place to the nearest point of the way's line, (3,) m, space axes."""
        off = position - self.origin
        return (off @ self.along) * self.along - off

    def reward(self, feedback: Feedback) -> Array:
        made_good = (feedback.g @ feedback.ground_velocity) @ self.along
        return jnp.minimum(made_good, self.speed) / self.speed - length(self.beside(feedback.position)) / self.far

    def start(self, random: np.random.Generator) -> dict[str, PyTree]:
        return {"position": self.origin, "euler_zyx": (np.arctan2(self.along[1], self.along[0]), 0.0, 0.0)}

    def parameters(self, random: np.random.Generator) -> dict[str, PyTree]:
        north, east = self.along[:2] / np.hypot(*self.along[:2])
        return {"water.velocity": self.current * random.uniform(-1.0, 1.0) * np.array([-east, north, 0.0])}

    def water(self) -> Water:
        return StillWater()

    def ends(self) -> dict[str, End]:
        return {
            "arrived": End(lambda feedback: length(self.place - feedback.position) < self.within, self.penalty, True),
            "far": End(lambda feedback: length(self.beside(feedback.position)) > self.far, -self.penalty),
            "surface": End(lambda feedback: feedback.depth < 0.0, -self.penalty),
        }

    def observations(self) -> dict[str, Function]:
        return {
            "offset": lambda feedback: towards(feedback, self.place),
            "line": lambda feedback: feedback.g.T @ self.beside(feedback.position),
            "along": lambda feedback: feedback.g.T @ jnp.asarray(self.along),
        }

    def goal(self) -> np.ndarray:
        return np.stack([self.origin, self.place])

    def bounds(self) -> dict[str, tuple[float, float]]:
        lowest, highest = (
            find(self.origin, self.place) + sign * self.far for find, sign in ((np.minimum, -1), (np.maximum, 1))
        )
        places = {name: (lowest[i], highest[i]) for i, name in enumerate(("north", "east", "depth"))}
        return {**super().bounds(), **places, "speed": (0.0, 2.0 * self.speed)}
