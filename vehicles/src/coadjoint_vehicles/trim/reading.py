"""The summary of a steady motion: angles, turn rate, and actuators with their limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.extending import named
from coadjoint.stability import SteadyMotion
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.part import Part


@dataclass(frozen=True)
class Trim:
    """The summary of a steady motion; SI, rad."""

    speed: float
    climb: float
    pitch: float
    roll: float
    attack: float
    """atan2(w, u)."""
    sideslip: float
    """asin(v/|v|)."""
    turn_rate: float
    """ω·down, rad/s; positive to starboard."""
    radius: float
    """Of the circle, m; infinite on a straight course."""
    actuators: dict[str, PyTree]
    exceeded: dict[str, tuple[float, float]]
    """Of actuators that would have to go beyond their limits: the value that is furthest beyond, and its limit."""

    @property
    def beyond(self) -> tuple[str, ...]:
        """Actuators that would have to go beyond their limits."""
        return tuple(self.exceeded)


def trim(vehicle: Vehicle, motion: SteadyMotion) -> Trim:
    """Angles, turn rate and actuators of a steady flight."""
    state, system = motion.state, motion.system
    down = system.advected.view(system.group, state.a).down
    u, v, w = map(float, state.nu)
    speed = float(np.linalg.norm(state.nu))
    sink = float(np.clip(state.nu @ down, -speed, speed))
    turn = float(state.xi @ down)
    turn = turn if abs(turn) > 1e-9 * max(speed, 1.0) else 0.0
    actuators = {part.name: getattr(state.internal, part.name) for part in vehicle.commanded}
    return Trim(
        speed=speed,
        climb=float(np.arcsin(-sink / speed)) if speed else 0.0,
        pitch=float(np.arctan2(-down[0], np.hypot(down[1], down[2]))),
        roll=float(np.arctan2(down[1], down[2])) if np.hypot(down[1], down[2]) > 1e-9 else 0.0,
        attack=float(np.arctan2(w, u)) if speed else 0.0,
        sideslip=float(np.arcsin(v / speed)) if speed else 0.0,
        turn_rate=turn,
        radius=float(np.sqrt(max(speed**2 - sink**2, 0.0)) / abs(turn)) if turn else float("inf"),
        actuators=actuators,
        exceeded={part.name: over for part in vehicle.commanded if (over := _over(part, actuators[part.name]))},
    )


def travel(part: Part) -> tuple[PyTree, PyTree] | None:
    """The range of an actuator, (lowest, highest), None without one."""
    return part.travel(named(part.parameters()))


def _over(part: Part, actual: PyTree) -> tuple[float, float] | None:
    """(value, limit) of the component furthest beyond its range, None if all are within."""
    within = travel(part)
    if within is None:
        return None
    place = actual.position if part.units is not None and "position" in actual else actual
    place, low, high = (np.ravel(x) for x in np.broadcast_arrays(place, *within))
    over = np.maximum(place - high, low - place)
    worst = int(np.argmax(over))
    if not over[worst] > 1e-9 * (high - low)[worst]:
        return None
    return float(place[worst]), float((high if place[worst] > high[worst] else low)[worst])
