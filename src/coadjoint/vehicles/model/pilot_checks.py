"""What pilots are given: gains and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.models.quantities import number, positive, vector


def require_gains(pilot: Any, names: tuple[str, ...]) -> None:
    """Each of these fields that is given as (k_p, k_i, k_d), (3,); raises ArgumentError."""
    for name in names:
        if getattr(pilot, name) is not None:
            _set(pilot, name, vector(getattr(pilot, name), _of(pilot, name)))


def require_positive(pilot: Any, names: tuple[str, ...]) -> None:
    """Each of these fields that is given as a positive number, and the delay between 0 and the period."""
    for name in names:
        if getattr(pilot, name) is not None:
            _set(pilot, name, positive(getattr(pilot, name), _of(pilot, name)))
    _set(pilot, "delay", number(pilot.delay, _of(pilot, "delay"), at_least=0.0))
    if not traced(pilot.delay, pilot.period) and pilot.delay > pilot.period:
        raise ArgumentError(
            f"Argument `{_of(pilot, 'delay')}` must be at most the period, {pilot.period:g} s, but is "
            f"{pilot.delay:g} s."
        )


def require_declared(pilot: Any) -> None:
    """Raise ArgumentError unless a pilot says its set points and its memory by name."""
    name, inputs, memory = type(pilot).__name__, pilot.inputs, pilot.memory
    if not isinstance(inputs, Mapping) or not all(isinstance(text, str) for pair in inputs.items() for text in pair):
        raise ArgumentError(
            f"`inputs` of the pilot `{name}` must be a dictionary of units by name, such as {{'heading': 'rad'}}, but "
            f"is {inputs!r}."
        )
    if not callable(memory) or not isinstance(memory(), Mapping):
        raise ArgumentError(
            f"`memory` of the pilot `{name}` must be a method that returns a dictionary, such as {{'total': 0.0}}."
        )


def _of(pilot: Any, name: str) -> str:
    return f"{name}` of the pilot `{type(pilot).__name__}"


def _set(pilot: Any, name: str, value: Any) -> None:
    object.__setattr__(pilot, name, value)
