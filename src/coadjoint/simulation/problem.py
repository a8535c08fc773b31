"""A run that is checked and set up but has not begun."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError, shown
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run.backend import Backend
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import quantities
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.internal_state import driven_warnings, internal_warnings, require_internal
from coadjoint.mechanics.noether import KelvinNoether, isotropy_algebra
from coadjoint.mechanics.quantities import value
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import functions_known, require_scalar
from coadjoint.mechanics.traced_once import Traced, tracing_once
from coadjoint.mechanics.work_balance import with_ledger
from coadjoint.methods.method import Method
from coadjoint.methods.program import RENEWED, Constants, StepProgram, as_read
from coadjoint.simulation import monitors as observe
from coadjoint.simulation import setup_cache
from coadjoint.simulation.arguments import (
    inputs_held,
    needs_g,
    read_of,
    require_kinds,
    with_inputs,
)
from coadjoint.simulation.dissipation_checks import require_forward
from coadjoint.simulation.events import Event, as_event, named_events, require_event
from coadjoint.simulation.members import begin_members, count_of, first_member, require_one_time, with_own_directions
from coadjoint.simulation.plan import MembersPosition, Memory, Plan, Position
from coadjoint.simulation.run import Ensemble, Run

MOST_DIRECTIONS = 500
"""The most dimensions of a group of which all spatial momenta are observed at every step."""


Watched = tuple[tuple[str, Event], ...]
"""Events by their names."""


def prepare(
    system: System, start: State, method: Method, h: float, steps: int, save_every: int, monitors: bool,
    kelvin_noether: Any, inputs: Any, backend: Backend, until: Any = None, events: Any = None,
    traces: Traced | None = None,
) -> Any:  # fmt: skip
    """A Run, or an Ensemble where co.each is used, that is checked and set up but has not begun.

    traces: takes up what is traced for the kernel, for the run's fingerprint.
    """
    if (count := count_of(system, start)) is not None:
        whole = (count, h, steps, save_every, monitors, kelvin_noether, inputs, backend, until, events)
        return _prepare_members(system, start, method, *whole)
    system, start = with_inputs(system, start, inputs, method.start == "velocity")
    watched, noether = watched_events(until, events), _quantities(kelvin_noether)
    functions = _functions(system, noether, monitors, watched)
    observed = (*observe.BEFORE, *observe.AFTER, *noether) if monitors else tuple(noether)
    reading = setup_cache.read(system, start, functions, watched, observed, method, h)
    begun = setup_cache.found(reading)
    if begun is None:
        with functions_known(reading is not None and reading.own):
            begun = _checked(system, start, method, h, monitors, noether, watched, reading)
        setup_cache.remember(reading, begun)
    state, warnings, program, watching = begun
    begin = float(start.t)
    warnings = internal_warnings(system, h) + driven_warnings(system, begin, begin + h * steps) + warnings
    constants = _constants(system, watching)
    with tracing_once(traces), as_read(program.version):
        chosen = kernels.choose(program, constants, state, monitors or bool(watched), backend)
    state = method.begin_by_xla(system, state) if chosen == "xla" else state
    plan = Plan(chosen, program, constants, h, steps, save_every, monitors, watched, until is not None)
    crossed: dict[str, list[State]] = {name: [] for name, _ in watched[until is not None :]}
    return Run(system, method, start, plan, Position(state), Memory(), warnings, crossed=crossed)


def _checked(
    system: System, start: State, method: Method, h: float, monitors: bool, chosen: list[KelvinNoether],
    watched: Watched, reading: setup_cache.Reading | None,
) -> setup_cache.Known:  # fmt: skip
    """What all checks of a run and its start find; raises what they raise."""
    before, warnings = setup_cache.verdict(reading, "run"), []
    if before is None:
        require_internal(system, start, h)
        warnings = system.check(start, method.regular) + require_forward(system, method, start, h)
    state = with_ledger(system, method.begin(system, start, h), monitors)
    if before is None:
        require_chart(system, method, state, h)
        require_events(method, state, watched)
        before = {"warnings": warnings, "watching": _watching(system, state, chosen, monitors)}
        setup_cache.remember_verdict(reading, "run", before)
    digest = None if reading is None else reading.version
    watching = before["watching"]
    program, _ = _program(system, method, state, chosen, monitors, watching, watched, digest)
    return setup_cache.Known(state, before["warnings"], program, watching)


def watched_events(until: Any, events: Any) -> Watched:
    """The events to monitor by their names, `until` first; raises ArgumentError and LagrangianError."""
    end = as_event(until)
    return ((("until", end),) if end is not None else ()) + tuple(named_events(events).items())


def require_events(method: Method, state: State, watched: Watched) -> None:
    """Raise ArgumentError and LagrangianError for what cannot be monitored."""
    for name, event in watched:
        require_event(event, name, state)
        if method.variable:
            raise ArgumentError(
                f"An event, `{name}`, is located by parts of a step, but {method.title} chooses its own: leave it out."
            )


def require_fit(system: System, start: State, method: Method, h: float, inputs: Any = None, until: Any = None) -> None:
    """Raise what `simulate` raises for a method that does not fit the system or its start; nothing is compiled."""
    require_kinds(system, start, method)
    together = count_of(system, start) is not None
    system, start = with_inputs(system, start, inputs, method.start == "velocity")
    system, start = first_member(system, start) if together else (system, start)
    require_internal(system, start, h)
    require_forward(system, method, start, h)
    state = method.begin(system, start, h)
    require_chart(system, method, state, h)
    require_events(method, state, watched_events(until, None))


def _watching(system: System, state: State, chosen: list[KelvinNoether], monitors: bool) -> dict[str, Any]:
    """What monitors observe with; raises what is wrong with what they observe."""
    found: dict[str, Any] = {}
    if monitors:
        if chosen and state.g is None:
            raise needs_g("Kelvin–Noether quantities", "need")
        for quantity in chosen:
            quantity.require_equivariant(system, state)
        if not chosen:
            found["c0"] = _directions(system, state)
        if system.quantities:
            require_quantities(system, state)
    return found


def _directions(system: System, state: State) -> np.ndarray:
    """The directions of conserved momenta that a run observes, a row each: none without g, and of large groups."""
    if state.g is None or system.group.dim > MOST_DIRECTIONS:
        return np.zeros((0, system.group.dim))
    return isotropy_algebra(system, state)


def _program(
    system, method, state, chosen, monitors, watching, events=(), digest: str | None = None
) -> tuple[StepProgram, Constants]:
    """The program, and its constants; digest: that of the functions, where they have been read."""
    observed = ()
    if monitors:
        own = observe.kelvin_noether if len(watching.get("c0", ())) else None
        observed = observe.watching(system, method, state, observe.chosen(chosen) if chosen else own)
    digest = digest or version(system, state, *_functions(system, chosen, monitors, events))
    crossing = tuple(event.function for _, event in events)
    program = StepProgram(replace_parameters(system, None), method, observed, digest, crossing)
    return program, _constants(system, watching)


def _functions(system, chosen, monitors, events) -> list[Callable[[State], Any]]:
    """What a run reads in addition to the functions of its system."""
    functions: list[Callable[[State], Any]] = [partial(quantity.quantity, system) for quantity in chosen]
    functions += [partial(value, system, function) for _, function in system.quantities if monitors]
    if system.inputs is not None:
        functions.append(partial(inputs_held, system))
    return [*functions, *(event.function for _, event in events)]


def _constants(system: System, watching: dict[str, Any]) -> Constants:
    holds = system.internal is not None or (system.inputs is not None and system.inputs.holds)
    return Constants(system.parameters, watching, RENEWED if holds else None)


def _quantities(given: Any) -> list[KelvinNoether]:
    """The argument `kelvin_noether`: one, several or None; raises ArgumentError."""
    chosen = given if isinstance(given, (list, tuple)) else [] if given is None else [given]
    if not all(isinstance(quantity, KelvinNoether) for quantity in chosen):
        raise ArgumentError(
            f"Argument `kelvin_noether` must be co.KelvinNoether(c0), or a list of several, but is {shown(given)}."
        )
    return list(chosen)


def _prepare_members(
    system, start, method, count, h, steps, save_every, monitors, kelvin_noether, inputs, backend, until, events
) -> Ensemble:
    """`prepare` for an ensemble: what is the same for all members is checked on the first."""
    require_one_time(start)
    if method.variable:
        raise ArgumentError(f"The members of an ensemble share their times, but {method.title} has its own: run each.")
    system, start = with_inputs(system, start, inputs, method.start == "velocity")
    one, first = first_member(system, start)
    watched, noether = watched_events(until, events), _quantities(kelvin_noether)
    observed = (*observe.BEFORE, *observe.AFTER, *noether) if monitors else tuple(noether)
    reading = setup_cache.read(one, first, _functions(one, noether, monitors, watched), watched, observed, method, h)
    before, checked = setup_cache.verdict(reading, "members"), []
    if before is None:
        checked = require_internal(one, first, h) + one.check(first, method.regular)
        checked += require_forward(one, method, first, h)
        method.begin(one, first, h)  # what a method checks of a start, it checks of one that is not traced
    members = begin_members(system, start, method, h, count, monitors)
    first, state = first_member(system, members.states)
    if before is None:
        require_chart(first, method, state, h)
        require_events(method, state, watched)
        before = {"warnings": checked, "watching": _watching(first, state, noether, monitors)}
        setup_cache.remember_verdict(reading, "members", before)
    warnings, digest = before["warnings"], None if reading is None else reading.version
    program, constants = _program(first, method, state, noether, monitors, before["watching"], watched, digest)
    program, constants, axes = with_own_directions(program, constants, members, warnings)
    with as_read(program.version):
        given = program, constants, members.states, monitors or bool(watched), backend
        chosen = kernels.choose(*given, axes=(axes, True))
    if chosen == "xla":
        states = evaluate(jax.vmap(lambda state: method.begin_by_xla(first, state)), members.states)
        members = replace(members, states=states)
    plan = Plan(chosen, program, constants, h, steps, save_every, monitors, watched, until is not None, count, axes)
    position = MembersPosition.at_start(members.states, count)
    warnings = driven_warnings(first, float(state.t), float(state.t) + h * steps) + warnings
    crossed: dict[str, list[list[State]]] = {name: [[] for _ in range(count)] for name, _ in watched[plan.until :]}
    return Ensemble(system, method, start, plan, position, Memory(), warnings, crossed=crossed)


def require_chart(system: System, method: Method, state: State, h: float) -> None:
    """Raise where already the first step leaves the chart of the difference map."""
    for step, fraction in method.stages:
        reach = float(evaluate(lambda s, step=step, f=fraction: step.chart(system, s, np.float64(h) * f), state))
        if reach >= 1:
            raise ArgumentError(
                f"Argument `dt` = {h:g} is too large: the first step would leave the chart of {step.difference_map!r} "
                f"by a factor {reach:.3g}; take dt < {h / reach:.3g}."
            )


def require_quantities(system: System, state: State) -> None:
    """Raise ArgumentError where a quantity has a name that a dataset has already; LagrangianError unless a number."""
    from coadjoint.simulation.dataset import reserved

    for name, function in system.quantities:
        if name in reserved(system) or name.startswith(("work_", "inputs_", "internal_")):
            raise ArgumentError(
                f"The quantity `{name}` must have a name of its own: datasets have a variable `{name}`."
            )
        what = f"The quantity `{name}`"
        value = partial(quantities.value, system, function)
        read_of(lambda state, value=value, what=what: require_scalar(value, what, (state,)), what, state)
