"""The range of an actuator, beyond which it cannot start and to which its commands are clipped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate, traced
from coadjoint.mechanics import Held, Linear, Signal
from coadjoint.mechanics.members import Each, count_members
from coadjoint.spaces import Named
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.part import Part

SAMPLES = 1001
"""At how many times a command that is a function of time is looked at."""


def require_in_range(part: Part, value: object, own: Named) -> None:
    """Raise ArgumentError for a start that the actuator cannot reach, as of degrees for radians.

    A range that is another for each member, or that is being differentiated, is not looked at.
    """
    value = value.values if isinstance(value, Each) else value
    ends = None if traced(value) else command_range(part, own)
    if ends is None:
        return
    found = np.asarray(value, dtype=float)
    if np.any(wrong := _outside(found, *ends)):
        low, high, unit = *_first(wrong, ends), _unit(part)
        raise ArgumentError(
            f"`{part.name}` cannot start at {found[wrong].flat[0]:g}{unit}: it goes from {low:g} to {high:g}{unit}."
        )


def clipped(vehicle: Vehicle, given: Mapping[str, object], begin: float, end: float, p: Named) -> Iterator[str]:
    """A sentence for each part whose commands go beyond its range in a run from `begin` to `end`, s.

    given: signals and functions by name; functions of the motion are not looked at.
    """
    for part in vehicle.commanded:
        source, own = given.get(part.name), getattr(p, part.name)
        ends = command_range(part, own) if isinstance(source, Signal) else None
        if ends is None or part.command is None or not isinstance(source, Signal):
            continue
        times, values = values_of(source, begin, end)
        silent = values == part.no_signal
        if np.any(silent):
            when, unit = times[int(np.argmax(silent.reshape(len(times), -1).any(axis=1)))], _unit(part)
            yield (
                f"The command of `{part.name}` is 0{unit} at t = {when:g} s, no pulse: the motor stops, as at "
                f"{part.command.start:g}{unit}."
            )
        wrong = _outside(values, *ends) & ~silent
        if np.any(wrong):
            first = int(np.argmax(wrong.reshape(len(times), -1).any(axis=1)))
            worst = values[first][wrong[first]].flat[0]
            low, high, unit = *_first(wrong[first], ends), _unit(part)
            yield (
                f"The command of `{part.name}` is clipped to its limits, {low:g} to {high:g}{unit}: it is "
                f"{worst:g}{unit} at t = {times[first]:g} s, the first time beyond them; at rest it is "
                f"{part.command.start:g}{unit}."
            )


def _first(wrong: np.ndarray, ends: tuple[PyTree, PyTree]) -> tuple[float, float]:
    """The lowest and the highest command where one is wrong first."""
    low, high = (np.broadcast_to(end, np.shape(wrong))[wrong].flat[0] for end in ends)
    return float(low), float(high)


def command_range(part: Part, own: Named) -> tuple[PyTree, PyTree] | None:
    """Lowest and highest command, or those of each thruster; None without limits, or if they differ between members."""
    if count_members(own) is not None or traced(own):
        return None
    return part.travel(own)


def _outside(values: np.ndarray, low: PyTree, high: PyTree) -> np.ndarray:
    slack = 1e-9 * (high - low)
    return (values < low - slack) | (values > high + slack)


def _unit(part: Part) -> str:
    return "" if part.command is None or part.command.unit == "1" else f" {part.command.unit}"


def values_of(source: Signal, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Times of a run (k,), its start and those of a table or spread over it, and the values there (k, …)."""
    if not isinstance(source, (Held, Linear)):
        times = np.linspace(begin, end, SAMPLES)
        return times, np.asarray(evaluate(jax.vmap(source), times))
    times, values = np.asarray(source.times, dtype=float), np.asarray(source.values, dtype=float)
    some = np.concatenate([[begin], times[(times > begin) & (times < end)]])
    if isinstance(source, Held):
        return some, values[np.maximum(np.searchsorted(times, some, side="right") - 1, 0)]
    some = np.append(some, end) if times[-1] >= end else some
    columns = values.reshape(len(times), -1).T
    return some, np.stack([np.interp(some, times, one) for one in columns], axis=1).reshape(-1, *values.shape[1:])
