"""The rule of a craft's internal state: its controller looks and speaks, its actuators follow, its water changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.extending import named, starting_values, traced
from coadjoint.mechanics import InternalRule, NodeMotion, sampled, sampling
from coadjoint.mechanics.members import Each, count_members, stacked
from coadjoint.spaces import Named
from coadjoint_vehicles.model.command_limits import clipped, command_range, require_in_range
from coadjoint_vehicles.model.controller import Controller, Feedback, require_declared
from coadjoint_vehicles.model.controller_mistakes import called, steer
from coadjoint_vehicles.model.energies import Surroundings
from coadjoint_vehicles.model.faults import Fault, latched, remembered
from coadjoint_vehicles.model.function_controller import FunctionController
from coadjoint_vehicles.model.saturation import saturated
from coadjoint_vehicles.model.set_points import doubts_of_set_points
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.part import Part, Passing
from coadjoint_vehicles.water.water import UniformWater, Water

MEMORY = "memory"


@dataclass(frozen=True, eq=False)
class Rule(InternalRule):
    """(motion, h, p) → the internal state over h: {part: actuator, "controller": its samples, "water": its memory}.

    Over the step from the node, actuators follow the commands that are in force from there. Without a controller, and
    for parts that it does not command, an input of a part's name commands it, by its value halfway through the step.
    Others stay.
    """

    vehicle: Vehicle
    controller: Controller | None
    water: Water
    faults: tuple[Fault, ...] = ()

    jumping = ("water",)
    """States not refined within a step in estimates of accuracy: a random current is drawn once a step."""

    @property
    def title(self) -> str:
        """Its description, at the beginning of a sentence."""
        others = f"an actuator or the water of `{self.vehicle.name}`"
        return f"A{others[1:]}" if self.controller is None else f"{called(self.controller)}, {others}"

    def __post_init__(self) -> None:
        if self.controller is not None:
            require_declared(self.controller)

    def start(self, actuators: Mapping[str, object], t: float) -> dict[str, PyTree]:
        """The internal state at the start, with these actuators."""
        found: dict[str, PyTree] = {part.name: part.at_rest(actuators[part.name]) for part in self.vehicle.commanded}
        if self.controller is not None:
            memory = self.controller.memory()
            found["controller"] = sampling({**actuators, **({MEMORY: memory} if memory else {})}, t)
        if self.faults:
            found["faults"] = {fault.name: 0.0 for fault in self.faults}
        remembered = self.water.start()
        return {**found, "water": remembered} if remembered else found

    def __call__(self, motion: NodeMotion, h: Scalar, p: PyTree) -> dict[str, PyTree]:
        inputs, ahead = self.inputs(motion), self.inputs(motion._replace(inputs=motion.ahead))
        after: dict[str, PyTree] = {}
        wanted = {} if self.controller is None else self.controller.inputs
        commands = {name: value for name, value in ahead.items() if name in self._shapes and name not in wanted}
        if self.controller is not None:
            after["controller"], steered = self._sample(self.controller, motion, h, p, Named(**inputs))
            if twice := [name for name in commands if name in steered]:
                raise ArgumentError(f"The controller commands `{twice[0]}` already: leave the input of that name out.")
            commands.update({name: getattr(after["controller"]["value"], name) for name in steered})
        there = latched(self.faults, motion, p) if self.faults else {}
        for part in self.vehicle.commanded:
            after[part.name] = self._followed(part, commands.get(part.name), motion, h, p, there)
        if there:
            after["faults"] = remembered(there)
        if self.water.start():
            after["water"] = self.water.advance(motion.internal.water, h, p.water)
        return after

    def _followed(
        self, part: Part, command: PyTree, motion: NodeMotion, h: Scalar, p: Named, there: dict[str, Array]
    ) -> PyTree:
        """The course of a part under its command and its faults; None stays."""
        now, own = getattr(motion.internal, part.name), getattr(p, part.name)
        faults = [fault for fault in self.faults if fault.part == part.name]
        if part.units is not None:
            if faults and command is None:
                command = self._unmoved(part)
            for fault in faults:
                command = fault.command(command, there[fault.name])
        course = now
        if command is not None:
            around = Surroundings(self.water, motion.n, motion.a, motion.t, motion.internal, p)
            carried = self.water.uniform and self.water.steady
            velocity = motion.nu - around.current() if carried else motion.nu
            course = part.follow(now, jnp.asarray(command), h, own, Passing(velocity, motion.xi, around.back.T))
        if part.units is None:
            for fault in faults:
                course = fault.stands(course, now, there[fault.name])
        return course

    def _unmoved(self, part: Part) -> PyTree:
        """The command, before its fault, of a part without an input: the command's starting value."""
        if part.command is None or part.travel(named(part.parameters())) is not None:
            raise ArgumentError(f"The fault of the {part.title}` needs a command that it replaces: give an input.")
        return part.command.start

    def seeded(self, internal: Named, seeds: np.ndarray) -> Named:
        """Internal states (k, …) whose water has random numbers of these seeds (k,)."""
        checks.leave_out(not self.water.start(), "`seed`", f"Nothing around `{self.vehicle.name}` is random")
        begun, _ = stacked(starting_values(self.water.seeded(Each(seeds)).start()))
        water = jax.tree.map(lambda new, old: np.broadcast_to(new, np.shape(old)), begun, internal.water)
        return internal.replace(water=water)

    def failure(self, t: Scalar, h: Scalar) -> str | None:
        """Why the step of length h from t has failed, if its controller knows."""
        return self.controller.failure(t, h) if isinstance(self.controller, FunctionController) else None

    def warnings(self, h: Scalar, p: PyTree) -> list[str]:
        """A sentence where a step is longer than the period of the controller, and its doubts about the vehicle."""
        if self.controller is None:
            return []
        found = self.controller.doubts(self.vehicle)
        given = p.controller.period
        period = float(np.min(given.values if isinstance(given, Each) else given))
        step = float(np.abs(h))
        if step <= period * (1 + 1e-9):
            return found
        return [
            *found,
            f"{called(self.controller)} looks every {period:g} s, but a step takes {step:g} s: it acts once a "
            f"step. Take dt "
            f"of {period:g} s or less.",
        ]

    def driven(self, inputs: PyTree, begin: float, end: float, p: PyTree) -> list[str]:
        """A sentence for each part whose commands are clipped, and for each set point that looks wrong.

        Raises ArgumentError for a set point that the controller cannot follow.
        """
        given = {} if inputs.names is None else dict(zip(inputs.names, inputs.sources, strict=True))
        found = [] if self.controller is None else doubts_of_set_points(self.controller, given, begin, end)
        return found if traced(p) else [*found, *clipped(self.vehicle, given, begin, end, p)]

    def concluded(self, stretches: Sequence[PyTree], p: PyTree) -> list[str]:
        """A sentence for each part that the controller keeps at its limits for more than a tenth of the time."""
        if self.controller is None or traced(p):
            return []
        parts = [part for part in self.vehicle.commanded if part.name not in self.controller.ordered_to_limits]
        return list(saturated(parts, self.command_limits(p), stretches))

    def report(self, motion: NodeMotion, p: PyTree) -> dict[str, PyTree]:
        """`current`, the velocity of the water where the craft is, space axes; nothing in still water.

        Nor for an ensemble whose members have waters of their own, since p is theirs together.
        """
        if count_members(p.water) is not None or (
            isinstance(self.water, UniformWater) and not np.any(p.water.velocity)
        ):
            return {}
        around = Surroundings(self.water, motion.n, motion.a, motion.t, motion.internal, p)
        return {"current": self.water.current(around.place(), motion.t, around.memory, p.water)}

    def command_limits(self, p: PyTree) -> dict[str, tuple[PyTree, PyTree]]:
        """The range of each part that has one, the same for all members."""
        ranges = {part.name: command_range(part, getattr(p, part.name)) for part in self.vehicle.commanded}
        return {name: ends for name, ends in ranges.items() if ends is not None}

    def limits(self, p: PyTree) -> dict[str, tuple[PyTree, PyTree]]:
        """The lowest and highest values of the actuators that have them, the same for all members."""
        return {name: (_plain(low), _plain(high)) for name, (low, high) in self.command_limits(p).items()}

    @property
    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """The shape of the command of each part."""
        return {part.name: part.command.shape for part in self.vehicle.commanded if part.command is not None}

    def _sample(
        self, controller: Controller, motion: NodeMotion, h: Scalar, p: PyTree, inputs: Named
    ) -> tuple[Any, set[str]]:
        """The controller's samples after h, and the names of the parts that it steers."""
        steered: set[str] = set()
        feedback = seen(self.water, self.vehicle, motion, p, inputs)
        own = p if isinstance(controller, FunctionController) else p.controller

        def update(last: PyTree) -> dict[str, PyTree]:
            memory = getattr(last, MEMORY) if MEMORY in last else Named()
            commands, remembered = steer(controller, feedback, memory, own, self.vehicle)
            commands = self._checked(commands)
            steered.update(commands)
            found = {**last.asdict(), **{name: jnp.asarray(value, dtype=float) for name, value in commands.items()}}
            return {**found, MEMORY: remembered} if MEMORY in last else found

        held = motion.internal.controller
        samples = sampled(motion, h, held, update, period=p.controller.period, delay=p.controller.delay)
        return samples, steered

    def _checked(self, commands: PyTree) -> dict[str, PyTree]:
        """The commands of a controller; raises ArgumentError for commands that the vehicle cannot follow."""
        if not isinstance(commands, dict):
            raise ArgumentError(
                f"A controller must return a dictionary of commands by the names of parts, but returned "
                f"{type(commands).__name__}."
            )
        for name, value in commands.items():
            try:
                jnp.asarray(value, dtype=float)
            except (TypeError, ValueError):
                raise ArgumentError(f"The controller commands `{name}` by {value!r}, which is not a number.") from None
            self._require_command(name, value, "The controller commands")
        return {name: self._shaped(name, value) for name, value in commands.items()}

    def _shaped(self, name: str, value: Any) -> PyTree:
        """A command in the shape of its part: one number for a single thruster is that of a row of one."""
        return jnp.reshape(value, self._shapes[name]) if name in self._shapes and jnp.shape(value) == () else value

    def _require_command(self, name: str, value: Any, who: str) -> None:
        shapes = self._shapes
        checks.known(name, shapes, "actuator", f"{who} `{name}`, but {self.vehicle.name}")
        if jnp.shape(value) not in (shapes[name], () if shapes[name] == (1,) else shapes[name]):
            raise ArgumentError(
                f"{who} `{name}` with {_shape(jnp.shape(value))}, but it takes {_shape(shapes[name])}"
                f"{_columns(name, shapes[name])}."
            )

    def inputs(self, motion: NodeMotion) -> dict[str, PyTree]:
        """The inputs of the run by name; raises ArgumentError for an unknown or missing one."""
        given = motion.inputs.asdict() if isinstance(motion.inputs, Named) else {}
        if motion.inputs is not None and not isinstance(motion.inputs, Named):
            raise ArgumentError("The inputs of a craft have names, as in inputs={'rudder': signal}.")
        wanted = {} if self.controller is None else self.controller.inputs
        for name, unit in wanted.items():
            if name not in given:
                raise ArgumentError(
                    f"The controller of `{self.vehicle.name}` needs the input `{name}` ({unit}): give it to "
                    f"co.simulate, as "
                    f"in inputs={{'{name}': 0.5}}."
                )
        for name, value in given.items():
            if name in wanted or (isinstance(self.controller, FunctionController) and name not in self._shapes):
                continue
            if name not in self._shapes:
                known = ", ".join([*wanted, *self._shapes]) or "none"
                raise ArgumentError(
                    f"Nobody on `{self.vehicle.name}` knows the input `{name}`: controller and actuators take {known}."
                )
            self._require_command(name, value, "An input commands")
        return {name: value if name in wanted else self._shaped(name, value) for name, value in given.items()}


def seen(water: Water, vehicle: Vehicle, motion: NodeMotion, p: PyTree, inputs: Named) -> Feedback:
    """The craft as its controller sees it."""
    around = Surroundings(water, motion.n, motion.a, motion.t, motion.internal, p)
    roll, pitch, heading = attitude_angles(motion.a.down, motion.a.north)
    return Feedback(
        position=around.place(),
        velocity=motion.nu - around.current(),
        ground_velocity=motion.nu,
        omega=motion.xi,
        down=motion.a.down,
        north=motion.a.north,
        roll=roll,
        pitch=pitch,
        heading=heading,
        depth=around.depth(),
        sink=motion.nu @ motion.a.down,
        t=motion.t,
        inputs=inputs,
        actual=Named(**{part.name: getattr(motion.internal, part.name) for part in vehicle.commanded}),
    )


def attitude_angles(down: Array, north: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and heading (rad) from the directions of down and north in the body frame, forward-starboard-down."""
    east = jnp.cross(down, north)
    pitch = jnp.arctan2(-down[0], jnp.sqrt(down[1] ** 2 + down[2] ** 2 + 1e-300))
    return jnp.arctan2(down[1], down[2]), pitch, jnp.arctan2(east[0], north[0])


def _plain(end: PyTree) -> PyTree:
    return np.asarray(end, dtype=float).tolist()


def _shape(shape: tuple[int, ...]) -> str:
    return "one number" if shape == () else f"shape {shape}"


def _columns(name: str, shape: tuple[int, ...]) -> str:
    """How numbers of a command are called in a log or table."""
    if len(shape) != 1:
        return f"; in a log or table it is the one column `{name}`" if shape == () else ""
    return f"; in a log or table these are the columns `{name}[1]`" + (
        f" to `{name}[{shape[0]}]`" if shape[0] > 1 else ""
    )


def starting_actuators(vehicle: Vehicle, given: PyTree, p: PyTree) -> dict[str, PyTree]:
    """The start of each actuator; raises ArgumentError for an unknown name, wrong shapes, and values out of range."""
    if given is not None:
        checks.instance(given, "actuators", Mapping, "name → where it starts")
    values = dict(given or {})
    known = {part.name: part.command for part in vehicle.commanded if part.command is not None}
    for name, value in values.items():
        checks.known(name, known, "actuator", f"`actuators` names `{name}`, but {vehicle.name}")
        each = isinstance(value, Each)
        shape = np.shape(value.values)[1:] if each else np.shape(float64(value, f"`{name}` in `actuators`"))
        if shape != known[name].shape:
            raise ArgumentError(f"`{name}` in `actuators` must be {_shape(known[name].shape)}, but has shape {shape}.")
        part = vehicle.part(name)
        require_in_range(part, value, getattr(p, name))
    return {name: values.get(name, np.full(command.shape, command.start)) for name, command in known.items()}
