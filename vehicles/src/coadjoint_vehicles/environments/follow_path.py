"""Follow a path of straight legs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.models.quantities import not_negative, positive
from coadjoint_vehicles.environments.task import End, Function, Task, length, towards
from coadjoint_vehicles.model.controller import Feedback


class Nearest(NamedTuple):
    """The point of a path nearest to a place, (3,) m, the direction of the path there, and the end of its leg."""

    point: Array
    along: Array
    end: Array


@dataclass(frozen=True, kw_only=True)
class FollowPath(Task):
    """Go along straight legs between points at a speed.

        r = min(q̇·t, U)/U − d/D

    t: the direction of the leg nearest by, d: the distance to it; U = `speed` (m/s), D = `far` (m). An episode begins
    up to `spread` (m) from the first point along each axis, along the first leg within ±0.3 rad, at `speed` through the
    water. It ends well within `within` (m) of the last point, and badly with d > D or above the surface. points: (k, 3)
    m, north, east, depth. Set points are those of the vehicle's own controller. Raises ArgumentError.
    """

    observed = ("offset", "along", "ahead", "down", "ground_velocity", "omega", "actuators")
    seconds: float = 120.0
    points: Any = ((0.0, 0.0, 5.0), (20.0, 0.0, 5.0), (20.0, 20.0, 5.0))
    speed: float = 0.5
    spread: float = 1.0
    within: float = 1.0
    far: float = 5.0

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            points = np.asarray(self.points, dtype=float)
        except (TypeError, ValueError):
            points = np.zeros(0)
        fits = points.ndim == 2 and points.shape[1:] == (3,) and (len(points) >= 2) and np.all(np.isfinite(points))
        checks.expect(fits, self.points, "points", "at least two points (north, east, depth)")
        if np.any(np.all(points[1:] == points[:-1], axis=1)):
            raise ArgumentError("Argument `points` must differ from one to the next, but two of them are the same.")
        object.__setattr__(self, "points", points)
        for name in ("speed", "within", "far"):
            positive(getattr(self, name), name)
        not_negative(self.spread, "spread")

    def nearest(self, position: Array) -> Nearest:
        """Where the path is nearest to a place, (3,) m; of two legs equally near the earlier one."""
        best, found = jnp.inf, None
        for start, end in zip(self.points[:-1], self.points[1:], strict=True):
            way = end - start
            share = jnp.clip((position - start) @ way / (way @ way), 0.0, 1.0)
            here = Nearest(start + share * way, jnp.asarray(way / np.linalg.norm(way)), jnp.asarray(end))
            off = position - here.point
            nearer = off @ off < best
            pairs = [] if found is None else list(zip(here, found, strict=True))
            found = here if found is None else Nearest(*(jnp.where(nearer, new, old) for new, old in pairs))
            best = jnp.where(nearer, off @ off, best)
        assert found is not None
        return found

    def reward(self, feedback: Feedback) -> Array:
        near = self.nearest(feedback.position)
        made_good = (feedback.g @ feedback.ground_velocity) @ near.along
        off = length(near.point - feedback.position)
        return jnp.minimum(made_good, self.speed) / self.speed - off / self.far

    def start(self, random: np.random.Generator) -> dict[str, PyTree]:
        u, way = random.uniform(-1.0, 1.0, 4), self.points[1] - self.points[0]
        course = np.arctan2(way[1], way[0]) + 0.3 * u[3]
        return {
            "position": self.points[0] + self.spread * u[:3],
            "euler_zyx": (course, 0.0, 0.0),
            "speed": self.speed,
        }

    def ends(self) -> dict[str, End]:
        def off(feedback: Feedback) -> Array:
            return length(self.nearest(feedback.position).point - feedback.position)

        last = self.points[-1]
        return {
            "arrived": End(lambda feedback: length(last - feedback.position) < self.within, self.penalty, True),
            "far": End(lambda feedback: off(feedback) > self.far, -self.penalty),
            "surface": End(lambda feedback: feedback.depth < 0.0, -self.penalty),
        }

    def observations(self) -> dict[str, Function]:
        return {
            "offset": lambda feedback: towards(feedback, self.nearest(feedback.position).point),
            "along": lambda feedback: feedback.g.T @ self.nearest(feedback.position).along,
            "ahead": lambda feedback: towards(feedback, self.nearest(feedback.position).end),
        }

    def goal(self) -> np.ndarray:
        return self.points

    def bounds(self) -> dict[str, tuple[float, float]]:
        lowest, highest = self.points.min(axis=0) - self.far, self.points.max(axis=0) + self.far
        places = {name: (lowest[i], highest[i]) for i, name in enumerate(("north", "east", "depth"))}
        return {**super().bounds(), **places, "speed": (0.0, 2.0 * self.speed)}
