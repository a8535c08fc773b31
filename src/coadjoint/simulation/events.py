"""Functions of the motion whose zeros are events: their requirements, and their values between two nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError, shown
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import in_words, require_float64
from coadjoint.simulation.arguments import read_of

Direction = Literal["rising", "falling", "both"]


@dataclass(frozen=True)
class Event:
    """The zeros of a function of the state, f(state) = 0, or only those where it rises or falls, by `direction`.

        co.Event(lambda state: state.mu[2], direction="rising")

    function: a state to one number, in terms of jax.numpy. direction: "rising", from negative to positive in the order
    of the run; "falling"; or "both". Raises ArgumentError for another direction, LagrangianError for no function.
    """

    function: Callable[[State], Any]
    direction: Direction = "both"

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise LagrangianError(f"An event must be a function of the state, but is {shown(self.function)}.")
        if not isinstance(self.direction, str) or self.direction not in get_args(Direction):
            raise ArgumentError(
                f'Argument `direction` must be "rising", "falling" or "both", but is {shown(self.direction)}.'
            )

    def counts(self, rises: bool) -> bool:
        """Whether a crossing that rises, or one that falls, is this event."""
        return self.direction == "both" or (self.direction == "rising") == rises


def as_event(given: Event | Callable[[State], Any] | None, what: str = "Argument `until`") -> Event | None:
    """The event for the value of `until`, or of a name in `events`."""
    if given is None or isinstance(given, Event):
        return given
    if not callable(given):
        raise LagrangianError(f"{what} must be a function of the state, but is {shown(given)}.")
    return Event(given)


def named_events(given: Mapping[str, Any] | None) -> dict[str, Event]:
    """Events by their names; raises ArgumentError if `given` is not a dictionary of events."""
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise ArgumentError(
            "Argument `events` must be a dictionary of names and functions of the state, as in "
            f"events={{'section': lambda state: state.mu[2]}}, but is {shown(given)}."
        )
    if "until" in given:
        raise ArgumentError("The name `until` in `events` is that of the argument which ends a run: take another.")
    found: dict[str, Event] = {}
    for name, function in given.items():
        event = as_event(function, f"The event `{name}`")
        if event is None:
            raise LagrangianError(f"The event `{name}` must be a function of the state, but is None: leave it out.")
        found[name] = event
    return found


def require_event(event: Event, what: str, state: State) -> None:
    """Raise LagrangianError unless an event is a function of a state whose value is one finite number, and
    ArgumentError if it needs a g that the method does not compute.
    """

    def value(state: State) -> Any:
        require_float64(event.function, f"The function `{what}`", (state,))
        with in_words(f"The function `{what}`"):
            return evaluate(event.function, state)

    found = read_of(value, f"The function `{what}`", state)
    number = np.shape(found) == () and not isinstance(found, dict) and np.asarray(found).dtype == float
    if not number:
        raise LagrangianError(
            f"The function `{what}` must return one number, which crosses zero at the event, such as "
            f"lambda state: state.q[2] - 10.0, but returned {shown(found)}."
        )
    if not np.isfinite(np.asarray(found)):
        raise LagrangianError(f"The function `{what}` must be finite at the start, but is {found}.")
