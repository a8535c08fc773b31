"""The parts of a stepper: commands, members, checks, compiled-in parameters, and the end at an event."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import float64, whole
from coadjoint.errors import ArgumentError
from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.inputs import Command, Inputs, inputs_from
from coadjoint.mechanics.internal_rule import declared
from coadjoint.mechanics.internal_state import require_internal
from coadjoint.mechanics.signals import Signal
from coadjoint.mechanics.start import with_own_momenta
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants, StepProgram, value_at_node
from coadjoint.methods.rattle import redundancy
from coadjoint.simulation import setup_cache
from coadjoint.simulation.arguments import inputs_held, require_forward, with_inputs
from coadjoint.simulation.dense import part_of_step, sound
from coadjoint.simulation.events import Event, crossings, from_zero
from coadjoint.simulation.members import count_of
from coadjoint.simulation.plan import Plan
from coadjoint.simulation.problem import require_chart, require_events
from coadjoint.simulation.steppers.beginning import shapes_of, spread
from coadjoint.simulation.steppers.fields import Fields
from coadjoint.spaces.named import Named
from coadjoint.texts import Table

ALONE = "input"
"""The name of a command that ℓ and forces read as `inputs` itself."""


ROUND_OFF = 1e-9
"""By how much of its range a command may lie beyond a limit."""


class Commands(NamedTuple):
    """The inputs of the system, where the commands among them start, and their names and shapes."""

    inputs: Inputs | None
    start: PyTree
    fields: Fields


def commands_from(given: object) -> Commands:
    """From names, of numbers that start at 0, or name → start, or one start; raises ArgumentError.

    Signals and functions of the motion are inputs as for `co.simulate`.
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


def limits_of(rule: Any, parameters: PyTree, fields: Fields) -> np.ndarray:
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


def _known(value: object) -> bool:
    """Whether a value is known beforehand or computed from the motion, rather than commanded."""
    return isinstance(value, Signal) or callable(value)


def _start(name: str, value: object) -> PyTree:
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


def members_of(system: System, start: State, members: int | None) -> int | None:
    """How many members are stepped together, None for a single one; raises ArgumentError if the two counts differ."""
    count = count_of(system, start)
    if members is None:
        return count
    if count is not None and count != whole(members, "members"):
        raise ArgumentError(f"Argument `members` is {members}, but co.each gives {count} of them.")
    return whole(members, "members")


def commanded_system(system: System, start: State, commands: Commands, by_velocities: bool) -> tuple[System, State]:
    """The system driven by its inputs, and the start with the commands where they begin."""
    if commands.start is not None:
        start = start if by_velocities else with_own_momenta(system, start)
        start = start.replace(inputs=spread(commands.start, np.shape(start.t)))
    return with_inputs(system, start, commands.inputs, by_velocities)


def commanded(inputs: Inputs | None, state: State, command: PyTree) -> State:
    """The state with commands, which may be traced; those that are not named stay."""
    if command is None:
        return state
    if inputs is None or not any(isinstance(source, Command) for source in inputs.sources):
        raise ArgumentError("This stepper has no commands: leave out `command`.")
    if inputs.names is None:
        return state.replace(inputs=_value(command, inputs.sources[0].shape, "The command"))
    checks.mapping(command, "command", "name → value")
    shapes = {n: s.shape for n, s in zip(inputs.names, inputs.sources, strict=True) if isinstance(s, Command)}
    checks.all_known(command, shapes, "command", "This stepper")
    values = {name: _value(value, shapes[name], f"Command `{name}`") for name, value in command.items()}
    return state.replace(inputs=Named(**{**state.inputs.asdict(), **values}))


def _value(value: Any, shape: tuple[int, ...], what: str) -> PyTree:
    array = float64(value, what)
    checks.shape(array, what, shape)
    return array


def checked(
    one: System, first: State, method: Method, h: float, event: Event | None
) -> tuple[State, str, list[str]]:  # fmt: skip
    """The state as the method begins it, the version of all functions, and warnings; raises the errors of the checks.

    one, first: the system and the start of one member.
    """
    watched = () if event is None else (("until", event),)
    functions: list[PyTree] = [] if one.inputs is None else [partial(inputs_held, one)]
    functions += [event.function for _, event in watched]
    reading = setup_cache.read(one, first, functions, watched, (), method, h)
    before, warnings = setup_cache.verdict(reading, "stepper"), []
    if before is None:
        warnings = require_internal(one, first, h) + one.check(first, method.regular)
        warnings += require_forward(one, method, first, h)
    begun = method.begin(one, first, h)
    if before is None:
        require_chart(one, method, begun, h)
        require_events(method, begun, watched)
        before = {"warnings": warnings + redundancy(begun)}
        setup_cache.remember_verdict(reading, "stepper", before)
    return begun, version(one, first, *functions) if reading is None else reading.version, before["warnings"]


def program_of(skeleton: System, method: Method, event: Event | None, version: str) -> StepProgram:
    """The program of a step, which an event stops; version: of all functions."""
    stopping: Table = {} if event is None else {"until": event.function, "direction": event.direction}
    return StepProgram(skeleton, method, version=version, **stopping)


def fixed_parameters(
    constants: Constants, parameters: np.ndarray, changing: Sequence[str]
) -> tuple[Fields, tuple[tuple[int, float], ...]]:
    """The parameters by their names, and those that are compiled in."""
    fixed = Fields.of({name.removeprefix("system."): shape for name, shape in shapes_of(constants).items()})
    return fixed, _compiled_in(parameters, fixed, changing)


def _compiled_in(parameters: np.ndarray, fields: Fields, changing: Sequence[str]) -> tuple[tuple[int, float], ...]:
    """Places and values of the parameters that are 0 or 1 for all members and are not named in `changing`."""
    free: set[int] = set()
    fits = isinstance(changing, (str, list, tuple, set, frozenset))
    checks.expect(fits, changing, "changing", 'names of parameters, such as ("mass",)')
    for name in (changing,) if isinstance(changing, str) else changing:
        if name not in fields.names:
            raise ArgumentError(fields.unknown(name, "parameter"))
        free |= set(range(fields.place(name).start, fields.place(name).stop))
    shared = np.where(np.all(parameters == parameters[:1], axis=0), parameters[0], np.nan)
    kinds = enumerate(specialised(shared))
    return tuple((place, float(kind)) for place, kind in kinds if kind < 2 and place not in free)


def ending(plan: Plan, event: Event, state: State, first: bool) -> tuple[State, bool]:
    """The state at the event in the step from `state`, and True; or the state after that step, and False.

    The event is a root of f(Φ_{θh}(state)). first: whether the stepper started at `state`: if that is very close to a
    zero, the stepper starts from this zero, as a run does, and the zero does not count as an event.
    Raises StepError if a part of the step cannot be solved.
    """
    free = replace(plan, program=replace(plan.program, until=None))
    system = replace_parameters(plan.program.skeleton, plan.constants.system)
    value = tabulate(partial(value_at_node, system, event.function), state)

    def after(theta: float) -> State:
        if not theta:  # a step of no length has no reactions
            return state
        return sound(part_of_step(free, state, theta)).final

    whole = after(1.0)
    values = np.array([float(value(state)), float(value(whole))])
    if first and from_zero(values)[0] == 0:
        return whole, False
    found = crossings(values, 0, lambda theta: float(value(after(theta))))
    # Machine code has seen the change of sign; to round-off it may lie at the node.
    theta = next((crossing.theta for crossing in found if event.counts(crossing.rises)), 1.0)
    return after(theta), True
