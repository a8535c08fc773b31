"""Functions of the motion whose zeros are events: what they must be, and their values between two nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import jax
import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError, StepError, shown
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.internal_state import later_in, part_of
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import in_words, require_float64
from coadjoint.methods.program import ALL_HELD, EVENTS
from coadjoint.simulation.driver import Plan
from coadjoint.simulation.without_g import read_of

Direction = Literal["rising", "falling", "both"]


@dataclass(frozen=True)
class Event:
    """The zeros of a function of the state, f(state) = 0, those alone where it rises or falls if `direction` says so.

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
    """An event of what `until`, or a name in `events`, was given."""
    if given is None or isinstance(given, Event):
        return given
    if not callable(given):
        raise LagrangianError(f"{what} must be a function of the state, but is {shown(given)}.")
    return Event(given)


def named_events(given: Mapping[str, Any] | None) -> dict[str, Event]:
    """Events by their names; raises ArgumentError for what is no dictionary of them."""
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
    ArgumentError where it needs a g that the method does not compute.
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


def not_finite(plan: Plan, state: State) -> str | None:
    """Which event has no value at a state, in a sentence; None where all have one."""
    for name, event in plan.events:
        if not np.isfinite(evaluate(event.function, state)):
            return f"the function `{name}` is not finite there: give one that is, wherever the motion goes."
    return None


def part_of_step(plan: Plan, state: State, fraction: float, monitors: bool = False) -> Chunk:
    """A step of fraction·h from a state, by the method itself.

    The internal state goes on along the course that it has over the whole step.
    """
    watches = monitors and plan.watches
    if fraction != 1.0 and state.internal_due is not None:
        if np.any(state.internal_due):
            whole = kernels.run(plan.backend, plan.program, plan.constants, state, plan.h, 1, 1, watches)
            if whole.code:
                return whole
            state = taking_course(state, jax.tree.map(lambda leaf: leaf[0], whole.records)).replace(internal_due=0.0)
        state = part_of(state, fraction)
    return kernels.run(plan.backend, plan.program, plan.constants, state, fraction * plan.h, 1, 1, watches)


def sound(chunk: Chunk) -> Chunk:
    """The chunk itself; raises StepError where its step failed."""
    if chunk.code:
        what = chunk.code.name.lower().replace("_", " ")
        raise StepError(f"A step to a time between two nodes failed ({what}): take a smaller dt.")
    return chunk


def as_held(plan: Plan) -> Plan:
    """The plan of steps that take the inputs in the state: a record holds those of its step, and its velocities."""
    inputs = plan.program.skeleton.inputs
    return plan if inputs is None or not inputs.holds else holding(plan)


def holding(plan: Plan) -> Plan:
    """The plan of steps that take inputs and internal state as they are, by the same program."""
    held = None if plan.constants.renewal is None else ALL_HELD
    return replace(plan, constants=replace(plan.constants, renewal=held))


def taking_course(state: State, of: State) -> State:
    """The state with the internal state of another one, at t and over the step from there."""
    return state.with_course(of.internal, of.internal_mean, of.internal_end, state.internal_due)


class DenseStep:
    """The records within a step from a record: Φ_{θh}, with the unknowns of the whole step that starts there.

    The method's own step of part θ leads there: momenta are as exact as at the nodes, the state is on the group, and
    all is continuous with both nodes. Inputs are held over the step; an internal state goes on along its course.
    Raises StepError where such a step cannot be solved.
    """

    def __init__(self, plan: Plan, record: State):
        self.record, self.held = record, as_held(plan)
        self.opening = plan if plan.program.skeleton.internal is None else holding(plan)

    def __call__(self, fraction: float) -> tuple[State, np.ndarray]:
        """The record after a part of the step, and the values of all events at it."""
        state = self.record
        if fraction:
            state = sound(part_of_step(self.held, state, fraction, monitors=True)).final
            state = taking_course(state, later_in(self.record, fraction))
        chunk = sound(part_of_step(self.opening if fraction else self.held, state, 1.0, monitors=True))
        return jax.tree.map(lambda leaf: leaf[0], chunk.records), chunk.monitors[EVENTS][0]
