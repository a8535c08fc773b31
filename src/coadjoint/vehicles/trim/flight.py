"""Steady flight of underwater vehicles: straight ahead or on a slope, in a circle, at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.models.quantities import number
from coadjoint.spaces.named import named
from coadjoint.stability.steady import Search, SteadyMotion
from coadjoint.vehicles.model.craft import Craft
from coadjoint.vehicles.model.loads import loads
from coadjoint.vehicles.model.vehicle import Vehicle
from coadjoint.vehicles.parts.thrusters import Thrusters

STEPS = (2, 6, 15)
"""In so many steps held actuators come to their places, so that a hard turn is reached from a straight course."""

AWAKE, EAGER = 0.1, 5.0
"""Parts of its range: where an idle actuator starts, and which change of it counts as much as that of 1 rad."""


class SteadyFlight:
    """Steady flight of a vehicle through still water, at many speeds: `at(speed)`.

    Straight: ω = 0, |v| = speed, v·down = −speed sin(climb). Vertical: v = ∓speed down, and the vehicle may spin as
    its propeller makes it. Turning: |v| and v·down as on a straight path, with ω ∥ down, on a circle of radius
    |v_horizontal|/|ω|. At rest: v = 0 and ω = 0, actuators as they start.

    vehicle: its parts are fixed fins and actuators; a controller takes no part. climb: angle of the path above the
    horizon, rad; π/2 is vertical ascent. hold: actuators by name that stay at a value. free: those that may move to
    hold the motion, by default all others; where six or more do, first on an even keel. turning: whether it may turn,
    as a held rudder makes it. depth: m.
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
        for name in (*self.hold, *(path.partition(".")[0] for path in self.free)):
            if name not in {part.name for part in vehicle.commanded}:
                known = ", ".join(part.name for part in vehicle.commanded) or "none"
                raise ArgumentError(f"`{name}` is no actuator of `{vehicle.name}`; its actuators are: {known}.")
        self._searches: dict[str, Search] = {}
        self._last = "path"

    def at(self, speed: float, near: SteadyMotion | None = None) -> SteadyMotion:
        """The steady motion at a speed through the water, m/s, near one that was found at another speed.

        Raises ArgumentError where none is found.
        """
        speed = number(speed, "speed", at_least=0.0)
        last = self._searches.get(self._last)
        if near is not None and speed > 0 and last is not None:
            with suppress(ArgumentError):
                return last.find(near.state, speed)
        try:
            return self._found(speed)
        except ArgumentError as error:
            extra = loads(self.vehicle).net_weight
            if abs(extra) < 1e-6 * self.vehicle.buoyancy:
                raise
            raise ArgumentError(f"{error} Its weight is its buoyancy {extra:+.3g} N.") from error

    def _found(self, speed: float) -> SteadyMotion:
        if speed == 0:
            guess = self._guess(0.0, 1.0)
            return self._search("rest", guess).find(guess, 0.0)
        kinds = ["upright", "path"] if self._holds_attitude else ["path"]
        steps = STEPS if self.turning and self.hold else (1,)
        *first, last = [(kind, n) for kind in kinds for n in steps]
        for kind, n in first:
            with suppress(ArgumentError):
                return self._reached(kind, speed, n)
        return self._reached(last[0], speed, last[1])

    @property
    def _holds_attitude(self) -> bool:
        """Whether there are actuators enough to fly on an even keel."""
        commands = [self.vehicle.part(path.partition(".")[0]).command for path in self.free]
        return sum(int(np.prod(command.shape)) for command in commands if command is not None) >= 6

    def _reached(self, kind: str, speed: float, steps: int) -> SteadyMotion:
        """From no deflection of held actuators to all of it, in steps."""
        guess = self._guess(speed, 1.0 / steps)
        search = self._search(kind, guess)
        found = search.find(self._awake(guess, search, speed), speed)
        for k in range(2, steps + 1):
            found = search.find(self._held(found.state, k / steps), speed)
        self._last = kind
        return found

    def _awake(self, guess: State, search: Search, speed: float) -> State:
        """Idle actuators where they tell: thrusters with the wrench that is missing, others a part of their range."""
        values = {}
        for name in search.idle(guess, speed):
            if "." in name:
                continue
            part, rest = self.vehicle.part(name), getattr(guess.internal, name)
            if isinstance(part, Thrusters):
                rate = search.reduced.slopes(guess).rate
                values[name] = evaluate(part.allocate, -np.concatenate([rate[6:9], rate[:3]]))
            else:
                within = _travel(part)
                values[name] = rest + AWAKE * ((1.0 if within is None else within[1]) - rest)
        return guess.replace(internal=guess.internal.replace(**values)) if values else guess

    def _movable(self) -> list[str]:
        """All actuators that are not held: of one whose state is a dictionary, the key that its command sets."""
        found = []
        for part in self.vehicle.commanded:
            if part.name not in self.hold and part.command is not None:
                at, away = part.at_rest(np.zeros(part.command.shape)), part.at_rest(np.ones(part.command.shape))
                keys = [key for key in at if np.any(at[key] != away[key])] if isinstance(at, Mapping) else [""]
                found += [f"{part.name}.{key}".rstrip(".") for key in keys]
        return found

    def _sizes(self) -> dict[str, float]:
        """Free actuators with changes that count as one, large beside angles, so that the attitude changes last."""
        ranges = {path: _travel(self.vehicle.part(path.partition(".")[0])) for path in self.free}
        return {
            path: 1.0 if within is None else EAGER * float(within[1] - within[0]) for path, within in ranges.items()
        }

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

    def _search(self, kind: str, near: State) -> Search:
        if kind not in self._searches:
            free, names = self._sizes(), self._names
            if kind == "rest":
                conditions, free, names = _at_rest, {}, ("the velocity",) * 3 + ("a rate",) * 3
            elif kind == "upright":
                down = np.array(near.a[:3])
                conditions = lambda s, v: jnp.concatenate([self._conditions(s, v), s.a[:3] - down])  # noqa: E731
            else:
                conditions = self._conditions
            remedy = "At rest no actuator moves: change its balance." if kind == "rest" else self._remedy
            self._searches[kind] = Search(self.craft.system, near, conditions, free, names=names, remedy=remedy)
        return self._searches[kind]

    @property
    def _remedy(self) -> str:
        """What to do where no motion is found, in terms of the actuators that move and of those that do not."""
        moving = [path.partition(".")[0] for path in self.free]
        staying = [part.name for part in self.vehicle.commanded if part.name not in moving]
        moved = f"To hold it moved {', '.join(moving) or 'no actuator'}"
        rest = f", and not {', '.join(staying)}: free one of these" if staying else ", all that it has: give it more"
        return f"{moved}{rest}, or take another speed or climb."

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


def _travel(part: Any) -> tuple[Any, Any] | None:
    return part.travel(named(part.parameters()))


def _is_beyond(part: Any, actual: Any) -> bool:
    within = _travel(part)
    if within is None:
        return False
    place = actual.position if part.units is not None and "position" in actual else actual
    slack = 1e-9 * (within[1] - within[0])
    return bool(np.any((place < within[0] - slack) | (place > within[1] + slack)))
