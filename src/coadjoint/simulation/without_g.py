"""Functions of the user's at states that a method leaves without g."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State


def read_of(read: Callable[[State], Any], what: str, state: State) -> Any:
    """read(state); raises what it raises, or ArgumentError where `what` can be read of the state with a g alone."""
    try:
        return read(state)
    except (LagrangianError, AttributeError) as error:
        if state.g is None and _can_be_read(read, state.replace(g=evaluate(state.places.group.identity))):
            raise needs_g(what) from error
        raise


def needs_g(what: str, verb: str = "needs") -> ArgumentError:
    """What is told of something that cannot be read without g."""
    return ArgumentError(f"{what} {verb} g, which this method does not compute: see its carry_g.")


def _can_be_read(read: Callable[[State], Any], state: State) -> bool:
    try:
        read(state)
    except (LagrangianError, AttributeError):
        return False
    return True
