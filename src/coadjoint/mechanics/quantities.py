"""Scalars that a system's runs observe at every step, such as integrals of the motion and Casimir functions."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.mechanics.reduced_functions import ReducedFunctions

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State

Quantities = tuple[tuple[str, Callable[..., Any]], ...]


def quantities_from(given: Mapping[str, Callable[..., PyTree]] | Quantities | None) -> Quantities:
    """Names and functions; raises ArgumentError for anything else."""
    try:
        found = () if given is None else tuple(dict(given).items())
    except Exception as error:
        raise ArgumentError(
            f"Quantities must be a dictionary of names and functions of the state, but are {shown(given)}."
        ) from error
    for name, function in found:
        if not (isinstance(name, str) and name.isidentifier()):
            raise ArgumentError(f"A quantity must have a name such as `height`, but is called {shown(name)}.")
        checks.function(function, f"Quantity `{name}`", "a function of the state")
    return found


def value(system: ReducedFunctions, function: Callable[..., PyTree], state: State) -> Array:
    """function(state), or function(state, p) of two arguments with the system's parameters: one number."""
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    takes = [p for p in inspect.signature(function).parameters.values() if p.kind in kinds and p.default is p.empty]
    return function(state) if len(takes) < 2 else function(state, system.parameters)


def meaning(function: Callable[..., object]) -> str | None:
    """The description of a quantity in a dataset: its formula, or the first sentence of its docstring.

    That of functions with some arguments given says which; it names no place in memory, which differs between runs.
    """
    if isinstance(function, partial):
        given = [f"{name} = {x}" for name, x in function.keywords.items() if isinstance(x, (bool, int, float, str))]
        said = meaning(function.func)
        return f"{said}, {', '.join(given)}" if said and given else said
    text = "" if inspect.isroutine(function) else str(function)
    if text and " at 0x" not in text:
        return text
    return function.__doc__.strip().split("\n")[0].rstrip(".") if function.__doc__ else None
