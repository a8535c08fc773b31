"""Hold a station: come to a place, and stay there with a heading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.models.quantities import number, positive, vector
from coadjoint_vehicles.controllers.hover import Hover
from coadjoint_vehicles.environments.task import End, Function, Task, facing, length, misaligned, towards
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class HoldStation(Task):
    """Come to a place and stay there, level, with a heading.

        r = −|q_c − q|/s − ½(1 − cos ψ_e) − ½(1 − cos tilt)

    An episode begins at rest, up to s = `spread` (m) from q_c = `place` (m: north, east, depth) along each axis, level,
    with any heading; it ends badly further than `far` (m) from there, or above the surface. heading: rad. Set points
    are those of `Hover`. Raises ArgumentError.
    """

    observed = ("offset", "facing", "down", "ground_velocity", "omega", "actuators")
    place: PyTree = (0.0, 0.0, 5.0)
    heading: float = 0.0
    spread: float = 2.0
    far: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "place", vector(self.place, "place"))
        number(self.heading, "heading")
        positive(self.spread, "spread")
        positive(self.far, "far")

    def reward(self, feedback: Feedback) -> Array:
        return -length(self.place - feedback.position) / self.spread - misaligned(feedback, self.heading)

    def start(self, random: np.random.Generator) -> dict[str, PyTree]:
        u = random.uniform(-1.0, 1.0, 4)
        return {"position": self.place + self.spread * u[:3], "euler_zyx": (np.pi * u[3], 0.0, 0.0)}

    def ends(self) -> dict[str, End]:
        return {
            "far": End(lambda feedback: length(self.place - feedback.position) > self.far, -self.penalty),
            "surface": End(lambda feedback: feedback.depth < 0.0, -self.penalty),
        }

    def goal(self) -> np.ndarray:
        return self.place[None]

    def observations(self) -> dict[str, Function]:
        return {"offset": lambda feedback: towards(feedback, self.place), "facing": facing(self.heading)}

    def helm(self, vehicle: Vehicle) -> Controller:
        return Hover()

    def bounds(self) -> dict[str, tuple[float, float]]:
        axes = zip(("north", "east", "depth"), self.place, strict=True)
        return {**super().bounds(), **{name: (x - self.spread, x + self.spread) for name, x in axes}}
