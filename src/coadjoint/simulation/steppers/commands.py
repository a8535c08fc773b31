"""What a stepper is driven by: commands that are set before each step, signals, and functions of the motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.inputs import Command, Inputs, inputs_from
from coadjoint.mechanics.internal_rule import declared
from coadjoint.mechanics.signals import Signal
from coadjoint.simulation.steppers.fields import Fields
from coadjoint.spaces.named import Named
from coadjoint.spaces.numbers import float64

ALONE = "input"
"""The name of a command that ℓ and forces read as `inputs` itself."""

ROUND_OFF = 1e-9
"""By how much of its range a command may lie beyond a limit."""


class Commands(NamedTuple):
    """The inputs of the system, where the commands among them start, and their names and shapes."""

    inputs: Inputs | None
    start: Any
    fields: Fields


def commands_from(given: Any) -> Commands:
    """From names, of numbers that start at 0, or name → start, or one start; raises ArgumentError.

    Signals and functions of the motion stay what they are for `co.simulate`.
    """
    if given is None or (isinstance(given, (tuple, list, Mapping)) and not given):
        return Commands(None, None, Fields.of({}))
    given = (given,) if isinstance(given, str) else given
    if isinstance(given, (tuple, list)) and all(isinstance(name, str) for name in given):
        if len(set(given)) < len(given):
            raise ArgumentError(f"Argument `inputs` must name each command once, but is {given!r}.")
        given = dict.fromkeys(given, 0.0)
    if not isinstance(given, Mapping):
        value = _start(ALONE, given)
        if _known(value):
            return Commands(inputs_from(value), None, Fields.of({}))
        return Commands(inputs_from(Command(value.shape)), value, Fields.of({ALONE: value.shape}))
    values = {name: _start(name, value) for name, value in given.items()}
    inputs = inputs_from({name: value if _known(value) else Command(value.shape) for name, value in values.items()})
    starts = {name: value for name, value in values.items() if not _known(value)}
    return Commands(inputs, Named(**starts), Fields.of({name: value.shape for name, value in starts.items()}))


def limits_of(rule: Any, parameters: Any, fields: Fields) -> np.ndarray:
    """The lowest and highest commands (2, size) that the rule of the internal state declares, with room for round-off;
    infinite of others."""
    found = np.broadcast_to(np.array([-np.inf, np.inf])[:, None], (2, fields.size)).copy()
    if fields.size:
        for name, ends in declared(rule).command_limits(parameters).items():
            if name in fields.names:
                low, high = np.asarray(ends, dtype=float)
                room = ROUND_OFF * (high - low)
                found[:, fields.place(name)] = np.reshape([low - room, high + room], (2, -1))
    return found


def _known(value: Any) -> bool:
    """Whether this is no command, but known beforehand or computed from the motion."""
    return isinstance(value, Signal) or callable(value)


def _start(name: str, value: Any) -> Any:
    if _known(value):
        return value
    try:
        return float64(value, f"The start of command `{name}`")
    except (TypeError, ValueError) as error:
        if isinstance(error, ArgumentError) and not isinstance(value, (str, type(None))):
            raise
        raise ArgumentError(
            f"Argument `inputs` must be names, or name → where a command starts, a signal, or a function of the "
            f"motion, but `{name}` is {value!r}."
        ) from None


def places_of(paths: list[tuple[str, tuple[int, ...]]], commands: Commands) -> tuple[int, ...]:
    """Which numbers of a state the commands are, from the names and shapes of its leaves."""
    starts, place = {}, 0
    for name, shape in paths:
        starts[name] = place
        place += math.prod(shape)
    found: list[int] = []
    for name, shape in commands.fields.shapes:
        key = "inputs" if isinstance(commands.start, np.ndarray) else f"inputs.{name}"
        found += range(starts[key], starts[key] + math.prod(shape))
    return tuple(found)
