"""Dock: come to a place slowly, level, from behind, facing the right way."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.models.quantities import number, positive, vector
from coadjoint_vehicles.controllers.hover import Hover
from coadjoint_vehicles.environments.task import End, Function, Task, facing, length, misaligned, towards
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Dock(Task):
    """Come into a dock: to a place, level, with a heading, and slowly.

        r = −|e|/s − ½(½(1 − cos ψ_e) + ½(1 − cos tilt)) − max(0, |ν| − v − ½|e|)/v

    with e = `place` − q, s = `distance` (m), v = `slow` (m/s). An episode begins at rest, s behind the dock and up to
    s/2 from there along each axis, level, within ±0.5 rad of the heading. It ends well with |e| < `within` (m), |ν| < v
    and the sum in the bracket, 0 to 2, below `aligned`; badly with |e| < `within` and |ν| > 2v, further than 3s away,
    or above the surface. heading: rad. Set points are those of `Hover`. Raises ArgumentError.
    """

    observed = ("offset", "facing", "down", "ground_velocity", "omega", "actuators")
    seconds: float = 60.0
    place: PyTree = (0.0, 0.0, 5.0)
    heading: float = 0.0
    distance: float = 3.0
    within: float = 0.25
    slow: float = 0.2
    aligned: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "place", vector(self.place, "place"))
        number(self.heading, "heading")
        for name in ("distance", "within", "slow", "aligned"):
            positive(getattr(self, name), name)

    def reward(self, feedback: Feedback) -> Array:
        off, speed = length(self.place - feedback.position), length(feedback.ground_velocity)
        hasty = jnp.maximum(0.0, speed - self.slow - 0.5 * off) / self.slow
        return -off / self.distance - 0.5 * misaligned(feedback, self.heading) - hasty

    def start(self, random: np.random.Generator) -> dict[str, PyTree]:
        u = random.uniform(-1.0, 1.0, 4)
        behind = self.place - self.distance * np.array([np.cos(self.heading), np.sin(self.heading), 0.0])
        return {
            "position": behind + 0.5 * self.distance * u[:3],
            "euler_zyx": (self.heading + 0.5 * u[3], 0.0, 0.0),
        }

    def ends(self) -> dict[str, End]:
        def inside(feedback: Feedback) -> Array:
            return length(self.place - feedback.position) < self.within

        def docked(feedback: Feedback) -> Array:
            slow = length(feedback.ground_velocity) < self.slow
            return inside(feedback) & slow & (misaligned(feedback, self.heading) < self.aligned)

        def struck(feedback: Feedback) -> Array:
            return inside(feedback) & (length(feedback.ground_velocity) > 2.0 * self.slow)

        return {
            "docked": End(docked, self.penalty, True),
            "struck": End(struck, -self.penalty),
            "far": End(lambda feedback: length(self.place - feedback.position) > 3.0 * self.distance, -self.penalty),
            "surface": End(lambda feedback: feedback.depth < 0.0, -self.penalty),
        }

    def observations(self) -> dict[str, Function]:
        return {"offset": lambda feedback: towards(feedback, self.place), "facing": facing(self.heading)}

    def goal(self) -> np.ndarray:
        return self.place[None]

    def helm(self, vehicle: Vehicle) -> Controller:
        return Hover()

    def bounds(self) -> dict[str, tuple[float, float]]:
        axes = zip(("north", "east", "depth"), self.place, strict=True)
        return {**super().bounds(), **{name: (x - self.distance, x + self.distance) for name, x in axes}}
