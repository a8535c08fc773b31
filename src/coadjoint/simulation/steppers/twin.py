"""Stepping as a pure function: the same steps under grad, jit and vmap."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.inputs import Command, Inputs
from coadjoint.mechanics.state import State
from coadjoint.spaces.named import Named
from coadjoint.spaces.numbers import float64


def commanded(inputs: Inputs | None, state: State, command: Any) -> State:
    """The state with commands, which may be traced; those that are not named stay."""
    if command is None:
        return state
    if inputs is None or not any(isinstance(source, Command) for source in inputs.sources):
        raise ArgumentError("This stepper has no commands: leave out `command`.")
    if inputs.names is None:
        return state.replace(inputs=_value(command, inputs.sources[0].shape, "The command"))
    if not isinstance(command, Mapping):
        raise ArgumentError(f"Argument `command` must be name → value, but is {type(command).__name__}.")
    shapes = {n: s.shape for n, s in zip(inputs.names, inputs.sources, strict=True) if isinstance(s, Command)}
    if unknown := [name for name in command if name not in shapes]:
        raise ArgumentError(f"There is no command `{unknown[0]}`; there is: {', '.join(shapes)}.")
    values = {name: _value(value, shapes[name], f"Command `{name}`") for name, value in command.items()}
    return state.replace(inputs=Named(**{**state.inputs.asdict(), **values}))


def _value(value: Any, shape: tuple[int, ...], what: str) -> Any:
    array = float64(value, what)
    if jnp.shape(array) != shape:
        raise ArgumentError(
            f"{what} must have {f'shape {shape}' if shape else 'one number'}, but has {jnp.shape(array)}."
        )
    return array
