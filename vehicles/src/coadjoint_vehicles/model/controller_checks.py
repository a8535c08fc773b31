"""Declarations of controllers: set points and memory."""

from __future__ import annotations

from collections.abc import Mapping

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint_vehicles.model.controller import Controller


def require_declared(controller: Controller) -> None:
    """Raise ArgumentError unless a controller declares its set points and its memory by name."""
    name, inputs, memory = type(controller).__name__, controller.inputs, controller.memory
    fits = isinstance(inputs, Mapping) and all(isinstance(text, str) for pair in inputs.items() for text in pair)
    checks.expect(
        fits,
        inputs,
        f"`inputs` of the controller `{name}`",
        "a dictionary of units by name, such as {'heading': 'rad'}",
    )
    if not callable(memory) or not isinstance(memory(), Mapping):
        raise ArgumentError(
            f"`memory` of the controller `{name}` must be a method that returns a dictionary, such as {{'total': 0.0}}."
        )
