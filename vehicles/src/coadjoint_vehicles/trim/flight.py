"""Steady flight of underwater vehicles: straight ahead or on a slope, in a circle, at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate
from coadjoint.mechanics import State
from coadjoint.models.quantities import number
from coadjoint.stability import Search, SteadyMotion
from coadjoint_vehicles.model.craft import Craft
from coadjoint_vehicles.model.loads import loads
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.thrusters import Thrusters
from coadjoint_vehicles.trim.reading import travel, trim
from coadjoint_vehicles.trim.turning import turns

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
    A held actuator comes to its place in steps, from a straight course; a turn to which none leads, or one beyond the
    limits of the actuators that move, is looked for from a few starts that turn already.
    Raises ArgumentError for names that are not actuators.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        climb: float = 0.0,
        hold: Mapping[str, object] | None = None,
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
            checks.known(name, [part.name for part in vehicle.commanded], "actuator", vehicle.name)
        self._searches: dict[str, Search] = {}
        self._last = "path"

    def at(self, speed: float, near: SteadyMotion | None = None) -> SteadyMotion:
        """The steady motion at a speed through the water, m/s, near one that was found at another speed.

        Raises ArgumentError where none is found, and where a held value has another shape than its actuator's command.
        """
        speed = checks.not_negative(speed, "speed")
        self._held(self.craft.start(), 1.0)
        last = self._searches.get(self._last)
        if near is not None and speed > 0 and last is not None:
            with suppress(ArgumentError):
                found = last.find(near.state, speed)
                if not self.looks_for_turns or self._is_within(found):
                    return found
        try:
            return self._found(speed)
        except ArgumentError as error:
            extra = loads(self.vehicle).net_weight
            if abs(extra) < 1e-6 * self.vehicle.buoyancy:
                raise
            raise ArgumentError(f"{error} {_of_buoyancy(extra)}") from error

    def _found(self, speed: float) -> SteadyMotion:
        if speed == 0:
            guess = self._guess(0.0, 1.0)
            return self._search("rest", guess).find(guess, 0.0)
        if not (self.turning and self.hold):
            return self._ahead(speed, (1,))
        return self._turn(speed) if self.looks_for_turns else self._ahead(speed, STEPS)

    @property
    def looks_for_turns(self) -> bool:
        """Whether turns are looked for where the straight course leads to none within the limits."""
        return bool(self.turning and self.hold) and not self._vertical

    def _turn(self, speed: float) -> SteadyMotion:
        """The turn that a straight course leads to; where it has none within all limits, another one if there is."""
        found: list[tuple[SteadyMotion, str]] = []
        failure = None
        try:
            found.append((self._ahead(speed, STEPS), self._last))
        except ArgumentError as error:
            failure = error
        if not any(self._is_within(motion) for motion, _ in found):
            guess = self._guess(speed, 1.0)
            search = self._search("path", guess)
            for other in turns(self._awake(guess, search, speed), search, speed, self.vehicle):
                found.append((other, "path"))
                if self._is_within(other):
                    break
        if not found:
            raise failure or AssertionError
        motion, self._last = next((pair for pair in found if self._is_within(pair[0])), found[0])
        return motion

    def _is_within(self, motion: SteadyMotion) -> bool:
        """Whether no actuator that is free has to go beyond its limits."""
        return set(trim(self.vehicle, motion).beyond) <= set(self.hold)

    def _ahead(self, speed: float, steps: Sequence[int]) -> SteadyMotion:
        """From a straight course, in the first number of steps that leads to a motion."""
        kinds = ["upright", "path"] if self._holds_attitude else ["path"]
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
        """Idle actuators where they have an effect: thrusters with the missing wrench, others a part of their range."""
        values = {}
        for name in search.idle(guess, speed):
            if "." in name:
                continue
            part, rest = self.vehicle.part(name), getattr(guess.internal, name)
            if isinstance(part, Thrusters):
                rate = search.reduced.slopes(guess).rate
                values[name] = evaluate(part.allocate, -np.concatenate([rate[6:9], rate[:3]]))
            else:
                within = travel(part)
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
        """Unit changes of the free actuators, large compared with angles, so that the attitude changes last."""
        ranges = {path: travel(self.vehicle.part(path.partition(".")[0])) for path in self.free}
        return {
            path: 1.0 if within is None else EAGER * float(np.max(within[1] - within[0]))
            for path, within in ranges.items()
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
        """The remedy if no motion is found, in terms of the actuators that move and of those that do not."""
        moving = [path.partition(".")[0] for path in self.free]
        staying = [part.name for part in self.vehicle.commanded if part.name not in moving]
        moved = f"To hold it moved {', '.join(moving) or 'no actuator'}"
        rest = f", and not {', '.join(staying)}: free one of these" if staying else ", all that it has: give it more"
        return f"{moved}{rest}, or take another speed or climb."

    def _conditions(self, state: State, speed: Any) -> Array:
        down = self.craft.system.advected.view(self.craft.system.group, state.a).down
        if self._vertical:
            return state.nu + np.sign(self.climb) * speed * down
        path = jnp.stack([(state.nu @ state.nu - speed**2) / speed, state.nu @ down + speed * np.sin(self.climb)])
        return path if self.turning else jnp.concatenate([path, state.xi])

    @property
    def _vertical(self) -> bool:
        return bool(abs(np.cos(self.climb)) < 1e-9)

    @property
    def _names(self) -> tuple[str, ...]:
        """The conditions, in words."""
        if self._vertical:
            return ("the surge", "the sway", "the heave")
        return ("the speed", "the rate of climb", "the roll rate", "the pitch rate", "the yaw rate")


def _of_buoyancy(extra: float) -> str:
    """A weight less its buoyancy, N, in words."""
    word, sign = ("heavier", "negatively") if extra > 0 else ("lighter", "positively")
    return f"The vehicle is {abs(extra):.3g} N {word} than the water that it displaces ({sign} buoyant)."


def _at_rest(state: State, _: object) -> PyTree:
    return jnp.concatenate([state.nu, state.xi])


def _between(rest: PyTree, wanted: Any, part: float) -> PyTree:
    if isinstance(wanted, Mapping):
        return type(rest)(**{key: _between(getattr(rest, key), wanted[key], part) for key in wanted})
    if np.shape(rest) != np.shape(wanted) and not np.size(rest) == np.size(wanted) == 1:
        raise ArgumentError(f"A held actuator takes shape {np.shape(rest)}, but got {np.shape(wanted)}.")
    return np.asarray(rest) + part * (np.reshape(wanted, np.shape(rest)) - np.asarray(rest))
