"""The problem of a simulation, checked once, and the run or ensemble that it sets up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run.backend import Backend
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.log import phase
from coadjoint.mechanics import quantities
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.internal_state import driven_warnings, internal_warnings, require_internal
from coadjoint.mechanics.noether import KelvinNoether, isotropy_algebra
from coadjoint.mechanics.quantities import value
from coadjoint.mechanics.state import State
from coadjoint.mechanics.symmetries import symmetries
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import functions_known, require_scalar
from coadjoint.mechanics.traced_once import Traced, tracing_once
from coadjoint.mechanics.work_balance import with_ledger
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants, StepProgram, as_read
from coadjoint.methods.rattle import redundancy
from coadjoint.methods.renewal import RENEWED
from coadjoint.simulation import monitors as observe
from coadjoint.simulation import setup_cache
from coadjoint.simulation.arguments import inputs_held, needs_g, read_of, require_forward, with_inputs
from coadjoint.simulation.events import Event, as_event, named_events, require_event
from coadjoint.simulation.members import (
    begin_members,
    count_of,
    first_member,
    require_chart_of_members,
    require_one_time,
    with_own_directions,
)
from coadjoint.simulation.plan import MembersPosition, Plan, Position
from coadjoint.simulation.run import Ensemble, Run
from coadjoint.simulation.sinks import Memory
from coadjoint.texts import Table

MOST_DIRECTIONS = 500
"""The most dimensions of a group of which all spatial momenta are observed at every step."""


Watched = tuple[tuple[str, Event], ...]
"""Events by their names."""


@dataclass(frozen=True)
class SimulationProblem:
    """A system from a start by a method over a grid, with the quantities and events that are observed on the way.

    kelvin_noether, inputs, until, events: as `co.simulate` takes them.
    """

    system: System
    start: State
    method: Method
    h: float
    steps: int
    save_every: int = 1
    monitors: bool = False
    kelvin_noether: Any = None
    inputs: PyTree = None
    backend: Backend = "auto"
    until: Any = None
    events: Any = None

    def set_up(self, traces: Traced | None = None) -> Any:
        """A checked Run that has not begun, or an Ensemble where co.each is used; raises the errors of the checks.

        traces: collects the traces made for the kernel, for the run's fingerprint.
        """
        count = count_of(self.system, self.start)
        return self._run(traces) if count is None else self._ensemble(count)

    @cached_property
    def watched(self) -> Watched:
        """The events to monitor by their names, `until` first."""
        return watched_events(self.until, self.events)

    @cached_property
    def noether(self) -> list[KelvinNoether]:
        """The argument `kelvin_noether`: one, several or None."""
        given = self.kelvin_noether
        chosen = given if isinstance(given, (list, tuple)) else [] if given is None else [given]
        fits = all(isinstance(quantity, KelvinNoether) for quantity in chosen)
        checks.expect(fits, given, "kelvin_noether", "co.mechanics.KelvinNoether(c0), or a list of several")
        return list(chosen)

    def _driven(self) -> tuple[System, State]:
        """The system driven by the inputs, and its start."""
        return with_inputs(self.system, self.start, self.inputs, self.method.start == "velocity")

    def _run(self, traces: Traced | None) -> Run:
        system, start = self._driven()
        traces = {} if traces is None else traces
        reading = self._read(system, start)
        begun = setup_cache.found(reading)
        if begun is None:
            phase("Tracing the functions of %s.", system.name)
            with functions_known(reading is not None and reading.own), tracing_once(traces):
                begun = self._checked(system, start, reading)
            setup_cache.remember(reading, begun)
        state, warnings, program, watching = begun
        begin = float(start.t)
        warnings = (
            internal_warnings(system, self.h) + driven_warnings(system, begin, begin + self.h * self.steps) + warnings
        )
        constants = _constants(system, watching)
        with tracing_once(traces), as_read(program.version):
            chosen = kernels.choose(program, constants, state, self._watches, self.backend)
        state = self.method.begin_by_xla(system, state) if chosen == "xla" else state
        plan = self._plan(chosen, program, constants)
        crossed: dict[str, list[State]] = {name: [] for name, _ in self.watched[plan.until :]}
        return Run(system, self.method, start, plan, Position(state), Memory(), warnings, crossed=crossed)

    def _ensemble(self, count: int) -> Ensemble:
        """An ensemble; properties that all members share are checked on the first."""
        require_one_time(self.start)
        method, h = self.method, self.h
        if method.variable:
            raise ArgumentError(
                f"The members of an ensemble share their times, but {method.title} has its own: run each."
            )
        system, start = self._driven()
        one, first = first_member(system, start)
        reading = self._read(one, first)
        before, checked = setup_cache.verdict(reading, "members"), []
        if before is None:
            checked = require_internal(one, first, h) + one.check(first, method.regular)
            checked += require_forward(one, method, first, h)
            method.begin(one, first, h)  # a method checks only starts that are not traced
        members = begin_members(system, start, method, h, count, self.monitors)
        require_chart_of_members(system, method, members, h)
        first, state = first_member(system, members.states)
        if before is None:
            before = self._verdict(first, state, reading, "members", checked + redundancy(state))
        warnings, watching = before["warnings"], before["watching"]
        program, constants = self._program(first, state, watching, reading), _constants(first, watching)
        program, constants, axes = with_own_directions(program, constants, members, warnings)
        states = members.states
        with tracing_once(), as_read(program.version):
            chosen = kernels.choose(program, constants, states, self._watches, self.backend, axes=(axes, True))
        if chosen == "xla":
            states = evaluate(jax.vmap(lambda state: method.begin_by_xla(first, state)), states)
        plan, position = self._plan(chosen, program, constants, count, axes), MembersPosition.at_start(states, count)
        warnings = driven_warnings(first, float(state.t), float(state.t) + h * self.steps) + warnings
        crossed: dict[str, list[PyTree]] = {name: [[] for _ in range(count)] for name, _ in self.watched[plan.until :]}
        return Ensemble(system, method, start, plan, position, Memory(), warnings, crossed=crossed)

    @property
    def _watches(self) -> bool:
        return self.monitors or bool(self.watched)

    def _plan(self, backend: Backend, program: StepProgram, constants: Constants, *members: PyTree) -> Plan:
        grid = self.h, self.steps, self.save_every
        return Plan(backend, program, constants, *grid, self.monitors, self.watched, self.until is not None, *members)

    def _read(self, system: System, start: State) -> setup_cache.Reading | None:
        """Read all functions and monitors once."""
        observed = (*observe.BEFORE, *observe.AFTER, *self.noether) if self.monitors else tuple(self.noether)
        return setup_cache.read(system, start, self._functions(system), self.watched, observed, self.method, self.h)

    def _functions(self, system: System) -> list[Callable[[State], PyTree]]:
        """The functions that a run reads in addition to those of its system."""
        functions: list[Callable[[State], PyTree]] = [partial(quantity.quantity, system) for quantity in self.noether]
        functions += [partial(value, system, function) for _, function in system.quantities if self.monitors]
        if system.inputs is not None:
            functions.append(partial(inputs_held, system))
        return [*functions, *(event.function for _, event in self.watched)]

    def _checked(self, system: System, start: State, reading: setup_cache.Reading | None) -> setup_cache.Known:
        """The results of all checks of a run and its start; raises the errors of the checks."""
        before, warnings = setup_cache.verdict(reading, "run"), []
        if before is None:
            require_internal(system, start, self.h)
            warnings = system.check(start, self.method.regular) + require_forward(system, self.method, start, self.h)
        state = with_ledger(system, self.method.begin(system, start, self.h), self.monitors)
        if before is None:
            before = self._verdict(system, state, reading, "run", warnings + redundancy(state))
        program = self._program(system, state, before["watching"], reading)
        return setup_cache.Known(state, before["warnings"], program, before["watching"])

    def _verdict(
        self, system: System, state: State, reading: setup_cache.Reading | None, purpose: str, warnings: list[str]
    ) -> Table:
        """The results of the checks of a state that was begun, kept for other runs."""
        require_chart(system, self.method, state, self.h)
        require_events(self.method, state, self.watched)
        found = {"warnings": warnings, "watching": self._watching(system, state, purpose == "run")}
        setup_cache.remember_verdict(reading, purpose, found)
        return found

    def _watching(self, system: System, state: State, single: bool) -> Table:
        """The constants of monitors; raises if they cannot observe a quantity. single: not of an ensemble."""
        found: Table = {}
        if not self.monitors:
            return found
        if self.noether and state.g is None:
            raise needs_g("Kelvin–Noether quantities", "need")
        for quantity in self.noether:
            quantity.require_equivariant(system, state)
        if not self.noether:
            found["c0"] = _directions(system, state)
            if single and system.constraints and state.g is not None:
                found["symmetries"] = symmetries(system, state)
        if system.quantities:
            require_quantities(system, state)
        return found

    def _program(
        self, system: System, state: State, watching: Table, reading: setup_cache.Reading | None
    ) -> StepProgram:
        observed = ()
        if self.monitors:
            own = [observe.kelvin_noether] if len(watching.get("c0", ())) else []
            own = [observe.chosen(self.noether)] if self.noether else own
            own += [observe.symmetry_momentum] if len(watching.get("symmetries", ())) else []
            observed = observe.watching(system, self.method, state, own)
        digest = version(system, state, *self._functions(system)) if reading is None else reading.version
        crossing = tuple(event.function for _, event in self.watched)
        return StepProgram(replace_parameters(system, None), self.method, observed, digest, crossing)


def watched_events(until: Any, events: Any) -> Watched:
    """The events to monitor by their names, `until` first; raises ArgumentError and LagrangianError."""
    end = as_event(until)
    return ((("until", end),) if end is not None else ()) + tuple(named_events(events).items())


def require_events(method: Method, state: State, watched: Watched) -> None:
    """Raise ArgumentError and LagrangianError for events that cannot be monitored."""
    for name, event in watched:
        require_event(event, name, state)
        if method.variable:
            raise ArgumentError(
                f"An event, `{name}`, is located by parts of a step, but {method.title} chooses its own: leave it out."
            )


def _directions(system: System, state: State) -> np.ndarray:
    """The directions of conserved momenta that a run observes, a row each: none without g, and of large groups."""
    if state.g is None or system.group.dim > MOST_DIRECTIONS:
        return np.zeros((0, system.group.dim))
    return isotropy_algebra(system, state)


def _constants(system: System, watching: Table) -> Constants:
    holds = system.internal is not None or (system.inputs is not None and system.inputs.holds)
    return Constants(system.parameters, watching, RENEWED if holds else None)


def require_chart(system: System, method: Method, state: State, h: float) -> None:
    """Raise if already the first step leaves the chart of the difference map."""
    for step, fraction in method.stages:
        reach = float(evaluate(lambda s, step=step, f=fraction: step.chart(system, s, np.float64(h) * f), state))
        if reach >= 1:
            raise ArgumentError(
                f"Argument `dt` = {h:g} is too large: the first step would leave the chart of {step.difference_map!r} "
                f"by a factor {reach:.3g}; take dt < {h / reach:.3g}."
            )


def require_quantities(system: System, state: State) -> None:
    """Raise ArgumentError if a quantity has a name that a dataset has already; LagrangianError unless a number."""
    from coadjoint.simulation.dataset import reserved

    for name, function in system.quantities:
        if name in reserved(system) or name.startswith(("work_", "inputs_", "internal_")):
            raise ArgumentError(
                f"The quantity `{name}` must have a name of its own: datasets have a variable `{name}`."
            )
        what = f"The quantity `{name}`"
        value = partial(quantities.value, system, function)
        read_of(lambda state, value=value, what=what: require_scalar(value, what, (state,)), what, state)
