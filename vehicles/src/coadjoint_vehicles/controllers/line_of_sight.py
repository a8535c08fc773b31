"""Line-of-sight guidance: which course, and which pitch, leads on to the straight line between two way points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.mechanics import Held
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.controllers.proposed import own_controller
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative


class Leg(NamedTuple):
    """The place of a point relative to a straight leg: `course` and `climb` of the leg (rad), distances in m.

    climb: positive upwards. length: of the leg over ground. along: over ground, from its start; beside: to starboard of
    it; beneath: under it, across it in the vertical plane.
    """

    course: Array
    climb: Array
    length: Array
    along: Array
    beside: Array
    beneath: Array


def leg(position: Array, start: Array, end: Array) -> Leg:
    """(along, beside) = (cos χ (n − n₀) + sin χ (e − e₀), −sin χ (n − n₀) + cos χ (e − e₀)), χ = atan2(Δe, Δn).

    beneath = cos γ (d − d₀) + sin γ · along, γ = −atan2(Δd, √(Δn² + Δe²)). position, start, end: (north, east, depth).
    """
    way, off = end - start, position - start
    length = jnp.sqrt(way[0] ** 2 + way[1] ** 2 + 1e-300)
    course, climb = jnp.arctan2(way[1], way[0]), -jnp.arctan2(way[2], length)
    along = jnp.cos(course) * off[0] + jnp.sin(course) * off[1]
    beside = jnp.cos(course) * off[1] - jnp.sin(course) * off[0]
    return Leg(course, climb, length, along, beside, jnp.cos(climb) * off[2] + jnp.sin(climb) * along)


def line_of_sight(across: Array, integral: Array, look_ahead: Any, gain: Any, period: Any) -> tuple[Array, Array]:
    """(χ, I): the angle χ = −atan((y + σI)/Δ) to the leg, and I ← I + T Δy/(Δ² + (y + σI)²).

    across: y, m, to starboard of the leg (or beneath it). look_ahead: Δ, m. gain: σ, m/s: of the integral, which moves
    the aim; 0 for plain line of sight. In a current across, or with sideslip, y goes to 0 and σI to Δ tan of the angle
    that holds against it. The integral grows slowly far from the path, so that it hardly winds up.
    Source: Børhaug, Pavlov, Pettersen (2008), (9)–(10); Fossen (2021), 12.4.
    """
    aim = across + gain * integral
    following = integral + period * look_ahead * across / (look_ahead**2 + aim**2)
    return -jnp.arctan((across + gain * following) / look_ahead), following


def arrived(position: Array, here: Leg, end: Array, acceptance: Any) -> Array:
    """Whether a way point is within the circle of acceptance (m, over ground), or its leg is behind."""
    gap = position[:2] - end[:2]
    return (gap @ gap < acceptance**2) | (here.along > here.length)


@dataclass(frozen=True, eq=False, kw_only=True)
class LineOfSight(Controller):
    """Follows the straight legs between way points, by the controller at the helm, whose heading it sets.

        ψ_c = χ − atan((y + σI)/Δ);    θ_c = γ + atan((z + σI_z)/Δ) where the helm takes `pitch`, or the depth of the
        way point ahead where it takes `depth`

    with the course χ and the climb γ of the leg, y to starboard of it and z beneath it (`leg`, `line_of_sight`). The
    next leg begins within `acceptance` of a way point, or abreast of it; the last leg is followed without end.

    way_points: (n, 3) m, north, east, depth; n ≥ 2. look_ahead: Δ, m, by default four lengths of the vehicle. gain: σ,
    m/s, 0.2 by default; 0 follows without integral. acceptance: m over ground, by default two lengths. helm: a
    controller with the set points `heading` and `depth` or `pitch`, by default the vehicle's own or one that is
    proposed; its gains are `p.controller.helm.…`, and its period and delay those of the path. Its other set
    points, such as `speed`, are those of the run. Raises ArgumentError.
    """

    way_points: Measured = measured(u.LENGTH, None)
    look_ahead: Measured = measured(u.LENGTH, positive, default=None)
    gain: Measured = measured(u.SPEED, not_negative, default=0.2)
    acceptance: Measured = measured(u.LENGTH, positive, default=None)
    helm: Controller | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        points = checks.array(self.way_points, "way_points", "(n, 3)")
        if len(points) < 2:
            raise ArgumentError("Argument `way_points` must hold two points or more, north, east, depth.")
        if not traced(points) and np.any(np.all(np.diff(points[:, :2], axis=0) == 0, axis=1)):
            raise ArgumentError("Two way points in turn are at one place over ground: a leg needs a course.")
        object.__setattr__(self, "way_points", points)

    def fitted(self, vehicle: Any) -> LineOfSight:
        length = vehicle.length if vehicle.length is not None else 10 * np.cbrt(vehicle.volume)
        helm = own_controller(vehicle) if self.helm is None else self.helm
        helm = replace(helm, period=self.period, delay=self.delay).fitted(vehicle)
        if "heading" not in helm.inputs or not {"depth", "pitch"} & set(helm.inputs):
            raise ArgumentError(
                f"The controller at the helm must take the set points `heading` and `depth` or `pitch`, but takes: "
                f"{', '.join(helm.inputs) or 'none'}."
            )
        return replace(
            self,
            helm=helm,
            look_ahead=4.0 * length if self.look_ahead is None else self.look_ahead,
            acceptance=2.0 * length if self.acceptance is None else self.acceptance,
        )

    def parameters(self) -> dict[str, PyTree]:
        return {**super().parameters(), **({} if self.helm is None else {"helm": self.helm.parameters()})}

    @property
    def inputs(self) -> dict[str, str]:
        taken = {} if self.helm is None else self.helm.inputs
        return {name: unit for name, unit in taken.items() if name not in ("heading", "depth", "pitch")}

    @property
    def ahead_only(self) -> bool:
        return self.helm is not None and self.helm.ahead_only

    @property
    def keeps_level(self) -> bool:
        return self.helm is not None and self.helm.keeps_level

    def doubts(self, vehicle: object) -> list[str]:
        found = [] if self.helm is None else self.helm.doubts(vehicle)
        if not traced(self.way_points) and (least := np.min(np.asarray(self.way_points)[:, 2])) < 0:
            found = [
                *found,
                f"A way point is at a depth of {least:g} m, above the surface: depth is positive downwards.",
            ]
        return found

    def memory(self) -> dict[str, PyTree]:
        assert self.helm is not None
        wanted = dict.fromkeys(self._wanted(), 0.0)
        return {"leg": 0.0, "beside": 0.0, "beneath": 0.0, "helm": self.helm.memory(), "wanted": wanted}

    def _wanted(self) -> tuple[str, ...]:
        """The set points that it gives the helm."""
        assert self.helm is not None
        return tuple(name for name in ("heading", "depth", "pitch") if name in self.helm.inputs)

    def steer(
        self, feedback: Feedback, memory: Named, own: Named, vehicle: Vehicle
    ) -> tuple[dict[str, PyTree], dict[str, PyTree]]:
        assert self.helm is not None
        count = len(self.way_points) - 1
        places = Held(np.arange(count), jnp.concatenate([own.way_points[:-1], own.way_points[1:]], axis=1))

        def at(number: Array) -> tuple[Leg, Array]:
            both = places(number)
            return leg(feedback.position, both[:3], both[3:]), both[3:]

        here, end = at(memory.leg)
        onwards = arrived(feedback.position, here, end, own.acceptance) & (memory.leg < count - 1)
        number = memory.leg + jnp.where(onwards, 1.0, 0.0)
        here, end = at(number)
        before = [jnp.where(onwards, 0.0, memory.beside), jnp.where(onwards, 0.0, memory.beneath)]
        turned, beside = line_of_sight(here.beside, before[0], own.look_ahead, own.gain, own.period)
        sunk, beneath = line_of_sight(here.beneath, before[1], own.look_ahead, own.gain, own.period)
        wanted = {
            **feedback.inputs.asdict(),
            "heading": here.course + turned,
            "depth": end[2],
            "pitch": here.climb - sunk,
        }
        set_points = feedback._replace(inputs=Named(**wanted))
        commands, remembered = self.helm.steer(set_points, memory.helm, own.helm, vehicle)
        given = {name: wanted[name] for name in self._wanted()}
        return commands, {"leg": number, "beside": beside, "beneath": beneath, "helm": remembered, "wanted": given}
