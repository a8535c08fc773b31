"""What a stepper is built of: its members and commands, what was checked, and the parameters that are compiled in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError, shown
from coadjoint.kernels.emit.plan import specialised
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.internal_state import require_internal
from coadjoint.mechanics.start import with_own_momenta
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation import known
from coadjoint.simulation.arguments import whole
from coadjoint.simulation.backwards import require_forward
from coadjoint.simulation.events import Event
from coadjoint.simulation.inputs import inputs_held, with_inputs
from coadjoint.simulation.members import count_of
from coadjoint.simulation.preparing import require_chart, require_events
from coadjoint.simulation.steppers.commands import Commands
from coadjoint.simulation.steppers.fields import Fields
from coadjoint.simulation.steppers.trees import shapes_of, spread


def members_of(system: System, start: State, members: int | None) -> int | None:
    """How many are stepped at once, None for a single one; raises ArgumentError where both say it and differ."""
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


def checked(
    one: System, first: State, method: Method, h: float, event: Event | None
) -> tuple[State, str, list[str]]:  # fmt: skip
    """The state as the method begins it, the version of all functions, and warnings; raises what is wrong.

    one, first: the system and the start of one member.
    """
    watched = () if event is None else (("until", event),)
    functions: list[Any] = [] if one.inputs is None else [partial(inputs_held, one)]
    functions += [event.function for _, event in watched]
    reading = known.read(one, first, functions, watched, (), method, h)
    before, warnings = known.verdict(reading, "stepper"), []
    if before is None:
        warnings = require_internal(one, first, h) + one.check(first, method.regular)
        warnings += require_forward(one, method, first, h)
    begun = method.begin(one, first, h)
    if before is None:
        require_chart(one, method, begun, h)
        require_events(method, begun, watched)
        before = {"warnings": warnings}
        known.remember_verdict(reading, "stepper", before)
    return begun, version(one, first, *functions) if reading is None else reading.version, before["warnings"]


def program_of(skeleton: System, method: Method, event: Event | None, version: str) -> StepProgram:
    """The program of a step, which an event stops; version: of all functions."""
    stopping: dict[str, Any] = {} if event is None else {"until": event.function, "direction": event.direction}
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
    if not isinstance(changing, (str, list, tuple, set, frozenset)):
        raise ArgumentError(
            f'Argument `changing` must be names of parameters, such as ("mass",), but is {shown(changing)}.'
        )
    for name in (changing,) if isinstance(changing, str) else changing:
        if name not in fields.names:
            raise ArgumentError(fields.unknown(name, "parameter"))
        free |= set(range(fields.place(name).start, fields.place(name).stop))
    shared = np.where(np.all(parameters == parameters[:1], axis=0), parameters[0], np.nan)
    kinds = enumerate(specialised(shared))
    return tuple((place, float(kind)) for place, kind in kinds if kind < 2 and place not in free)
