"""Steady flight of underwater vehicles: straight ahead or on a slope, in a circle, at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import State
from coadjoint.models.quantities import number
from coadjoint.models.underwater.vehicles.craft import Craft
from coadjoint.models.underwater.vehicles.vehicle import Vehicle
from coadjoint.stability.steady import Search, SteadyMotion

STEPS = (2, 6, 15)
"""In so many steps held actuators come to their places, so that a hard turn is reached from a straight course."""


class SteadyFlight:
    """Steady flight of a vehicle through still water, at many speeds: `at(speed)`.

    Straight: ω = 0, |v| = speed, v·down = −speed sin(climb). Vertical: v = ∓speed down, and the vehicle may spin as
    its propeller makes it. Turning: |v| and v·down as on a straight path, with ω ∥ down, on a circle of radius
    |v_horizontal|/|ω|. At rest: v = 0 and ω = 0, actuators as they start.

    vehicle: its parts are fixed fins and actuators; a pilot takes no part. climb: angle of the path above the horizon,
    rad; π/2 is vertical ascent. hold: actuators by name that stay at a value. free: those that may move to hold the
    motion, by default all others. turning: whether it may turn, as a held rudder makes it. depth: m.
    Raises ArgumentError for names that are no actuators.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        climb: float = 0.0,
        hold: Mapping[str, Any] | None = None,
        free: Sequence[str] | None = None,
        turning: bool = False,
        depth: float = 0.0,
    ):
        self.craft = Craft(vehicle)
        self.vehicle, self.turning = vehicle, turning
        self.climb, self.depth = number(climb, "climb"), number(depth, "depth")
        self.hold = dict(hold or {})
        self.free = tuple(self._movable() if free is None else free)
        for name in (*self.hold, *self.free):
            if name not in {part.name for part in vehicle.commanded}:
                known = ", ".join(part.name for part in vehicle.commanded) or "none"
                raise ArgumentError(f"`{name}` is no actuator of `{vehicle.name}`; its actuators are: {known}.")
        self._searches: dict[bool, Search] = {}

    def at(self, speed: float, near: SteadyMotion | None = None) -> SteadyMotion:
        """The steady motion at a speed through the water, m/s, near one that was found at another speed.

        Raises ArgumentError where none is found.
        """
        speed = number(speed, "speed", at_least=0.0)
        if near is not None and speed > 0 and self._searches.get(True) is not None:
            with suppress(ArgumentError):
                return self._searches[True].find(near.state, speed)
        if speed == 0:
            return self._search(False, self._guess(0.0, 1.0)).find(self._guess(0.0, 1.0), 0.0)
        *first, last = STEPS if self.turning and self.hold else (1,)
        for steps in first:
            with suppress(ArgumentError):
                return self._reached(speed, steps)
        return self._reached(speed, last)

    def _reached(self, speed: float, steps: int) -> SteadyMotion:
        """From no deflection of held actuators to all of it, in steps."""
        guess = self._guess(speed, 1.0 / steps)
        search = self._search(True, guess)
        found = search.find(self._awake(guess, search.idle(guess, speed)), speed)
        for k in range(2, steps + 1):
            found = search.find(self._held(found.state, k / steps), speed)
        return found

    def _awake(self, guess: State, idle: Sequence[str]) -> State:
        """Idle actuators at a part of their limits, so that a small change tells."""
        values = {}
        for name in idle:
            limit = getattr(self.vehicle.part(name), "limit", None)
            values[name] = getattr(guess.internal, name) + 0.3 * (1.0 if limit is None else np.asarray(limit))
        return guess.replace(internal=guess.internal.replace(**values)) if values else guess

    def _movable(self) -> list[str]:
        """All actuators that are not held and are one number or an array."""
        return [p.name for p in self.vehicle.commanded if p.name not in self.hold and p.units is None]

    def _guess(self, speed: float, part: float) -> State:
        """On the path's slope, nose ahead, with held actuators a `part` of the way."""
        pitch = self.climb if self._nose_first else 0.0
        velocity = (speed * np.cos(self.climb - pitch), 0.0, -speed * np.sin(self.climb - pitch))
        start = self.craft.start(position=(0, 0, self.depth), velocity=velocity, euler_zyx=(0.0, pitch, 0.0))
        return self._held(start, part)

    @property
    def _nose_first(self) -> bool:
        length, width = self.vehicle.length, self.vehicle.diameter
        return length is None or width is None or bool(length > 2 * width)

    def _held(self, state: State, part: float) -> State:
        if not self.hold:
            return state
        begun = self.craft.start().internal
        values = {}
        for name, value in self.hold.items():
            rest = getattr(begun, name)
            wanted = self.vehicle.part(name).at_rest(np.asarray(value, dtype=float))
            values[name] = _between(rest, wanted, part)
        return state.replace(internal=state.internal.replace(**values))

    def _search(self, moving: bool, near: State) -> Search:
        if moving not in self._searches:
            conditions = self._conditions if moving else _at_rest
            free, names = (self.free, self._names) if moving else ((), ("the velocity",) * 3 + ("a rate",) * 3)
            self._searches[moving] = Search(self.craft.system, near, conditions, free, names=names)
        return self._searches[moving]

    def _conditions(self, state: State, speed: Any) -> Any:
        down = self.craft.system.advected.view(self.craft.system.group, state.a).down
        if self._vertical:
            return state.nu + np.sign(self.climb) * speed * down
        path = jnp.stack([(state.nu @ state.nu - speed**2) / speed, state.nu @ down + speed * np.sin(self.climb)])
        return path if self.turning else jnp.concatenate([path, state.xi])

    @property
    def _vertical(self) -> bool:
        return abs(np.cos(self.climb)) < 1e-9

    @property
    def _names(self) -> tuple[str, ...]:
        """What the conditions are about."""
        if self._vertical:
            return ("the surge", "the sway", "the heave")
        return ("the speed", "the rate of climb", "the roll rate", "the pitch rate", "the yaw rate")


def _at_rest(state: State, _: Any) -> Any:
    return jnp.concatenate([state.nu, state.xi])


def _between(rest: Any, wanted: Any, part: float) -> Any:
    if isinstance(wanted, Mapping):
        return type(rest)(**{key: _between(getattr(rest, key), wanted[key], part) for key in wanted})
    if np.shape(rest) != np.shape(wanted):
        raise ArgumentError(f"A held actuator takes shape {np.shape(rest)}, but got {np.shape(wanted)}.")
    return np.asarray(rest) + part * (np.asarray(wanted) - np.asarray(rest))


@dataclass(frozen=True)
class Trim:
    """What an engineer reads of a steady motion; SI, rad."""

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
    actuators: dict[str, Any]
    beyond: tuple[str, ...]
    """Actuators that would have to go beyond their limits."""


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
        beyond=tuple(part.name for part in vehicle.commanded if _is_beyond(part, actuators[part.name])),
    )


def _is_beyond(part: Any, actual: Any) -> bool:
    if part.units is not None:
        return False
    limit = getattr(part, "limit", None)
    low, high = getattr(part, "low", None), getattr(part, "high", None)
    over = limit is not None and bool(np.any(np.abs(actual) > np.asarray(limit) * (1 + 1e-9)))
    return over or (low is not None and bool(np.any((actual < low) | (actual > high))))
