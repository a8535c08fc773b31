"""Actions between −1 and 1, and the commands that they mean: of actuators, or set points of a controller."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint_vehicles.model.craft import Craft


@dataclass(frozen=True)
class Actions:
    """Commands by names, one after the other: u = middle + a (high − middle) for a ≥ 0, + a (middle − low) for a < 0.

    low, middle, high: (size,), in the units of the commands. shapes, units: of each command.
    """

    shapes: dict[str, tuple[int, ...]]
    units: dict[str, str]
    low: np.ndarray
    middle: np.ndarray
    high: np.ndarray

    @cached_property
    def size(self) -> int:
        return len(self.middle)

    @property
    def starts(self) -> dict[str, np.ndarray]:
        """The command of the action 0, by names."""
        return {name: self.middle[place].reshape(self.shapes[name]) for name, place in self.places.items()}

    @cached_property
    def _scales(self) -> tuple[np.ndarray, np.ndarray]:
        """high − middle, and by how much middle − low is less; () where that is nothing."""
        up, down = self.high - self.middle, self.middle - self.low
        return up, np.zeros(0) if np.array_equal(up, down) else up - down

    @cached_property
    def places(self) -> dict[str, slice]:
        """Which numbers of an action each command is."""
        ends = np.cumsum([int(np.prod(shape)) for shape in self.shapes.values()])
        return {
            name: slice(int(end) - int(np.prod(self.shapes[name])), int(end))
            for name, end in zip(self.shapes, ends, strict=True)
        }

    def commands(self, actions: object, lead: tuple[int, ...]) -> np.ndarray:
        """The commands (*lead, size) of actions (*lead, size), which are cut off at ±1.

        Raises ArgumentError for another shape and for values that are not finite.
        """
        try:
            given = np.asarray(actions, dtype=np.float64)
        except (TypeError, ValueError):
            given = np.asarray(None)
        if given.shape != (*lead, self.size):
            what = shown(actions) if given.shape == () else f"shape {given.shape}"
            raise ArgumentError(f"Argument `action` must be numbers of shape {(*lead, self.size)}, but is {what}.")
        total = np.add.reduce(given, None) if lead else sum(given.tolist())  # not finite where a number is not
        if not math.isfinite(total) and not np.all(np.isfinite(given)):
            raise ArgumentError("Argument `action` must be finite, but has a number that is not.")
        found, (up, uneven) = np.maximum(given, -1.0), self._scales
        np.minimum(found, 1.0, out=found)
        less = np.maximum(-found, 0.0) * uneven if len(uneven) else None
        found *= up
        found += self.middle
        return found if less is None else found + less

    def __str__(self) -> str:
        """A line for each number: its place, command, unit and the meaning of −1, 0 and 1."""
        lines = []
        for name, place in self.places.items():
            for i, k in enumerate(range(place.start, place.stop)):
                index = "" if self.shapes[name] == () else f"[{i + 1}]"
                ends = ", ".join(f"{x[k]:g}" for x in (self.low, self.middle, self.high))
                lines.append(f"{k}: {name}{index} ({self.units[name]}) at −1, 0, 1: {ends}")
        return "\n".join(lines)


def actuator_actions(craft: Craft) -> Actions:
    """Commands of the parts, from one end of their travel to the other; raises ArgumentError for one without ends."""
    shapes, units, ranges = {}, {}, []
    for part in craft.vehicle.commanded:
        command, own = part.command, getattr(craft.parameters, part.name)
        assert command is not None
        ends = part.travel(own)
        if ends is None:
            raise ArgumentError(
                f"The {part.title}` of {craft.vehicle.name} has no limit, so that no action can be scaled to it: give "
                "it one in the vehicle file, or take set points as actions."
            )
        shapes[part.name], units[part.name] = command.shape, command.unit
        low, high = (np.broadcast_to(np.asarray(end, dtype=float), command.shape).ravel() for end in ends)
        inside = (low <= command.start) & (command.start <= high)
        ranges.append((low, np.where(inside, command.start, 0.5 * (low + high)), high))
    if not ranges:
        raise ArgumentError(f"Nothing on {craft.vehicle.name} can be commanded: it has no actuators.")
    low, middle, high = (np.concatenate(ends) for ends in zip(*ranges, strict=True))
    return Actions(shapes, units, low, middle, high)


def set_point_actions(craft: Craft, bounds: Mapping[str, object]) -> Actions:
    """Set points of the craft's controller within bounds; raises ArgumentError for one without bounds."""
    assert craft.controller is not None
    units = craft.controller.inputs
    checks.all_known(bounds, units, "set point", f"Argument `bounds`: {type(craft.controller).__name__}")
    return Actions(dict.fromkeys(units, ()), dict(units), *_bounds(units, bounds))


def _bounds(names: Mapping[str, str], bounds: Mapping[str, PyTree]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    found = []
    for name, unit in names.items():
        if name not in bounds:
            raise ArgumentError(
                f"The set point `{name}` has no bounds to scale actions to: give them in {unit}, as in "
                f"bounds={{'{name}': (-1.0, 1.0)}}."
            )
        try:
            low, high = map(float, bounds[name])
        except (TypeError, ValueError):
            low = high = np.nan
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise ArgumentError(
                f"The bounds of `{name}` must be two numbers, the lower one first, but are {shown(bounds[name])}."
            )
        found.append((low, 0.5 * (low + high), high))
    low, middle, high = np.array(found).T
    return low, middle, high
