"""Set points of a run that its controller cannot follow, or whose sign or unit looks wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics import Held, Signal
from coadjoint.models.quantities import angles
from coadjoint_vehicles.model.command_limits import values_of
from coadjoint_vehicles.model.controller import Controller

ROTATION = 1e-6
"""How far RᵀR of a set point may be from 1."""


class TimedValues(NamedTuple):
    """The values (k, …) of a set point at times (k,), s; continuous: whether it takes all values between them."""

    name: str
    unit: str
    times: np.ndarray
    values: np.ndarray
    continuous: bool

    def at(self, wrong: np.ndarray) -> str:
        """Its name with the first value that is `wrong` (k,), and when."""
        first = int(np.argmax(wrong))
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"The set point `{self.name}` is {self.values[first]:g}{unit} at t = {self.times[first]:g} s"


def doubts_of_set_points(
    controller: Controller, given: Mapping[str, object], begin: float = 0.0, end: float = np.inf
) -> list[str]:
    """A sentence for each set point of a run from `begin` to `end`, s, whose sign or unit looks wrong.

    given: numbers, signals and functions by name; functions of the motion are not looked at. Raises ArgumentError for
    a set point that the controller cannot follow.
    """
    points = {}
    for name, unit in controller.inputs.items():
        source = given.get(name)
        if isinstance(source, (int, float, np.ndarray)):
            source = Held([0.0], [source])
        if isinstance(source, Signal):
            points[name] = TimedValues(name, unit, *values_of(source, begin, end), not isinstance(source, Held))
    found = [doubt for point in points.values() for doubt in _doubts(controller, point)]
    _require_teeth(points)
    return found


def _doubts(controller: Controller, point: TimedValues) -> Iterator[str]:
    kind = point.name, point.unit
    if np.ndim(point.values) == 1 and point.unit == "rad":
        angles(point.values, point.name)
    if kind in REQUIRED and np.ndim(point.values) == 1:
        wrong, remedy = REQUIRED[kind](controller, point.values)
        if np.any(wrong):
            raise ArgumentError(f"{point.at(wrong)}, but {remedy}")
    if kind == ("attitude", "1") and np.shape(point.values)[1:] == (3, 3):
        _require_rotation(point)
    if kind in DOUBTED and np.any(wrong := DOUBTED[kind][0](point)):
        yield f"{point.at(wrong)}{DOUBTED[kind][1]}"


def _require_rotation(point: TimedValues) -> None:
    """Raise ArgumentError unless each value is a rotation."""
    R = point.values
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2))
    if np.any(wrong := (off > ROTATION) | (np.linalg.det(R) < 0)):
        raise ArgumentError(
            f"The set point `{point.name}` must be a rotation, (3, 3) with RᵀR = 1 and det R = 1, but is "
            f"{R[int(np.argmax(wrong))].tolist()}: co.attitude.zyx(yaw, pitch, roll) gives one."
        )


def _require_teeth(points: Mapping[str, TimedValues]) -> None:
    """Raise ArgumentError for a sawtooth whose upper depth, at some time for a constant one, is below the lower."""
    if {"shallow", "deep"} <= points.keys():
        shallow, deep = np.max(points["shallow"].values), np.min(points["deep"].values)
        if shallow >= deep and min(len(points["shallow"].values), len(points["deep"].values)) == 1:
            raise ArgumentError(f"The set point `shallow` must be less than `deep`, {deep:g} m, but is {shallow:g} m.")


def _turned(point: TimedValues) -> np.ndarray:
    """Where an angle begins or jumps by more than a turn."""
    begun = np.concatenate([[0.0], point.values[:-1]])
    jumps = np.abs(point.values - begun) > 2 * np.pi + 1e-9
    return jumps & (np.arange(len(jumps)) == 0) if point.continuous else jumps


REQUIRED: dict[tuple[str, str], Callable[[Controller, np.ndarray], tuple[np.ndarray, str]]] = {
    ("speed", "m/s"): lambda controller, values: (
        (values < 0) & controller.ahead_only,
        f"the controller `{type(controller).__name__}` drives ahead only: give 0 or more, or command the actuators.",
    ),
    ("pitch", "rad"): lambda controller, values: (
        np.abs(values) > np.pi / 2 + 1e-9,
        "must be from -π/2 to π/2, up positive: is its unit right?",
    ),
    ("altitude", "m"): lambda controller, values: (values < 0, "must be 0 or more, from the bottom up."),
}
"""Where set points of this name and unit cannot be followed, and what to say then."""

_DEPTH = (lambda point: point.values < 0, ", above the surface: depth is positive downwards.")

DOUBTED: dict[tuple[str, str], tuple[Callable[[TimedValues], np.ndarray], str]] = {
    ("depth", "m"): _DEPTH,
    ("shallow", "m"): _DEPTH,
    ("deep", "m"): _DEPTH,
    ("heading", "rad"): (_turned, ", more than a turn away: is its unit right? Angles are in rad."),
}
"""Where set points of this name and unit look wrong, and what to say then."""
