"""The driver: a run in chunks, with monitors, progress and a certificate."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Literal

import numpy as np

from coadjoint.errors import ArgumentError, StepError, shown
from coadjoint.kernels.program import MAX_ITERATIONS, Code
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run.backend import Backend
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.inputs import Given
from coadjoint.mechanics.internal import failure, require_internal
from coadjoint.mechanics.ledger import with_ledger
from coadjoint.mechanics.noether import KelvinNoether, isotropy_algebra
from coadjoint.mechanics.origin import Keep, continued
from coadjoint.mechanics.quantities import value
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System, replace_parameters
from coadjoint.mechanics.version import version
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.program import RENEWED, Constants, StepProgram
from coadjoint.simulation import budget
from coadjoint.simulation import monitors as observe
from coadjoint.simulation.accuracy.judgement import accuracy_warnings, chosen_members, judged
from coadjoint.simulation.accuracy.sample import Sampler
from coadjoint.simulation.accuracy.trajectory_error import require_full, with_trajectory_error
from coadjoint.simulation.arguments import grid, require_kinds, require_quantities, truth, whole
from coadjoint.simulation.backwards import require_forward
from coadjoint.simulation.driver import Driver, Memory, Plan, Position, Sink
from coadjoint.simulation.energy_warnings import energy_warnings
from coadjoint.simulation.ensemble import (
    Ensemble,
    begin_members,
    count_of,
    first_member,
    member_constants,
    require_room,
    with_own_directions,
)
from coadjoint.simulation.ensemble_driver import MembersPosition, drive
from coadjoint.simulation.ensemble_events import EnsembleEvents
from coadjoint.simulation.event_driver import EventDriver
from coadjoint.simulation.events import Event, as_event, named_events, not_finite, require_event
from coadjoint.simulation.inputs import inputs_held, with_inputs
from coadjoint.simulation.run import Run
from coadjoint.simulation.step_sizes import fixed_steps


def simulate(
    system: System,
    start: State,
    *,
    dt: float,
    duration: float | None = None,
    steps: int | None = None,
    method: Method | None = None,
    save_every: int = 1,
    monitors: bool = True,
    kelvin_noether: KelvinNoether | Sequence[KelvinNoether] | None = None,
    inputs: Given | None = None,
    until: Event | Callable[[State], Any] | None = None,
    events: Mapping[str, Event | Callable[[State], Any]] | None = None,
    progress: bool | None = None,
    backend: Backend = "auto",
    store: str | os.PathLike[str] | None = None,
    keep: Keep | None = None,
    accuracy: bool | Literal["full"] = True,
) -> Run:
    """Integrate `system` from `start` by steps of `dt` and return the run with its dataset, plots and certificate.

        run = co.simulate(top, start, dt=0.01, duration=100.0, method=co.Suzuki4(co.Midpoint()))
        print(run)                           # the certificate: energies, momenta, residuals, speed
        run.dataset.energy, run.plot.energy()

    Each step solves the discrete Euler–Poincaré equations of `method` for (ξ, ν) by Newton's iteration and advances
    (g, n, a, μ, π); the equations are those of the method's own docstring.

    Arguments:
        system: the mechanical system, a `co.System`.
        start: the state at t = t₀, from `system.state(…)`, or a record of another run, whose momenta stay.
        dt: h, the length of a step, s; positive. A method with variable steps scales its steps by it, takes duration/dt
            of them, and the card gives the t that they led to.
        duration: t_end − t₀, s; a whole number of steps. Give either this or `steps`.
        steps: the number of steps, at least 1.
        method: the integrator, by default `co.Midpoint(co.Cayley())`: order 2, symmetric, symplectic.
        save_every: every how many steps a record is kept, by default 1, and the last node always. Monitors and extrema
            cover every step nevertheless.
        monitors: whether energies, Kelvin–Noether quantities, budgets, residuals and the system's `quantities` are
            observed at every step; by default True. `system.watching({name: function})` adds quantities.
        kelvin_noether: a `co.KelvinNoether(c0)` or several, instead of the default: one for each c₀ of a basis of
            {c₀ ∈ 𝔤 : c₀·a₀ = 0}.
        inputs: what forces and ℓ read as `inputs`, by default nothing: a signal such as `co.Linear(times, values)`,
            evaluated at the method's own nodes; a number or an array, constant; a function of the `co.Motion`, held
            over each step; or a dictionary of these, read as `inputs.name`.
        until: a function of the state to a number, or a `co.Event` with a direction: the run ends where it crosses
            zero, located on the dense output, and `run.event` is that time in s, or None. It is evaluated on records:
            ξ and ν are those of the step that starts there, μ and π those of the time itself. Needs fixed steps.
        events: name → function of the state or `co.Event`; `run.events[name]` are the records where it crosses zero.
            Needs fixed steps; neither `events` nor `until` of an ensemble goes with `store`.
        progress: None, a progress bar on a terminal for runs over a second (the default); False, never.
        backend: "native", machine code, for small systems; "xla", JAX's compiler, for what cannot be traced to machine
            code; "auto", native where it can be (the default).
        store: a new folder to which records are written as they come, in constant memory; by default they stay in
            memory. A run that was interrupted goes on with `co.resume(store, system)`.
        keep: what stays where `start` is a record of a run with other parameters, "momentum" (μ, π; velocities
            change) or "velocity" (ξ, ν); by default such a start is refused. The card repeats it.
        accuracy: whether a sample of the steps is judged, each against steps of parts of it; by default True: the card
            gives the local error, or says that dt does not resolve the motion, and which would. "full": the run is
            done again with dt/2, and the card gives the error of the trajectory, or the time up to which it holds.

    Returns a `Run`: `records`, `final`, `dataset` (an xarray.Dataset with the dimension `time`), `plot`, `save(path)`,
    `at(times)`. With `co.each` in the parameters or the start, all members run at once, and what is returned is an
    `Ensemble`, with a dimension `member`; a member whose step fails is reported and masked, and the others go on.

    Raises ArgumentError, GroupError or LagrangianError before the first step, FileError for a folder `store` that
    is not empty or cannot be written, and StepError at a step that fails, with what was computed until then in `.run`.

    Source: the discrete Euler–Poincaré equations with additional dynamics (P43), (P44) and the Kelvin–Noether theorem
    (P27), Theorem 7.
    """
    began = time.perf_counter()
    method = Midpoint() if method is None else method
    require_kinds(system, start, method)
    if traced(system.parameters, start, dt):
        raise ArgumentError("co.simulate cannot be differentiated or mapped by JAX: use co.trajectory, which can.")
    h, steps = grid(dt, duration, steps)
    save_every, monitors = whole(save_every, "save_every"), truth(monitors, "monitors")
    progress = None if progress is None else truth(progress, "progress")
    full = isinstance(accuracy, str) and accuracy == "full"
    judging = full or truth(accuracy, "accuracy")
    if full:
        many = count_of(system, start) is not None
        require_full(many, method.variable, store is not None, until is not None or bool(events))
    kernels.require_backend(backend)
    if store is not None and not isinstance(store, (str, os.PathLike)):
        raise ArgumentError(f"Argument `store` must be the path of a new folder, but is {shown(store)}.")
    start, told = continued(system, start, keep)
    if store is not None and (events or (until is not None and count_of(system, start) is not None)):
        raise ArgumentError(
            "Argument `events`, and `until` for an ensemble, collect records in memory: leave out `store`."
        )
    watched = (until, events)
    run = prepare(system, start, method, h, steps, save_every, monitors, kelvin_noether, inputs, backend, *watched)
    run.warnings += [told] if told else []
    if store is not None:
        from coadjoint.simulation.resume import streamed

        run = streamed(run, store, kelvin_noether, judging)
    else:
        require_room(run)
    done: Any = carry_on(run, progress, began, judging)
    if full:
        twice = (h / 2, 2 * steps, 2 * save_every, False)
        finer: Any = prepare(system, start, method, *twice, kelvin_noether, inputs, backend)
        with_trajectory_error(done, carry_on(finer, progress, began, False))  # type: ignore[arg-type]
    return done


def prepare(
    system: System, start: State, method: Method, h: float, steps: int, save_every: int, monitors: bool,
    kelvin_noether: Any, inputs: Any, backend: Backend, until: Any = None, events: Any = None,
) -> Any:  # fmt: skip
    """A Run, or an Ensemble where co.each is used, that is checked and set up but has not begun."""
    if (count := count_of(system, start)) is not None:
        whole = (count, h, steps, save_every, monitors, kelvin_noether, inputs, backend, until, events)
        return _prepare_members(system, start, method, *whole)
    system, start = with_inputs(system, start, inputs, method.start == "velocity")
    warnings = (
        require_internal(system, start, h)
        + system.check(start, method.regular)
        + require_forward(system, method, start, h)
    )
    state = with_ledger(system, method.begin(system, start, h), monitors)
    require_chart(system, method, state, h)
    watched = require_events(method, state, until, events)
    program, constants = _program(system, method, state, kelvin_noether, monitors, watched)
    chosen = kernels.choose(program, constants, state, monitors or bool(watched), backend)
    plan = Plan(chosen, program, constants, h, steps, save_every, monitors, watched, until is not None)
    crossed: dict[str, list[State]] = {name: [] for name, _ in watched[until is not None :]}
    return Run(system, method, start, plan, Position(state), Memory(), warnings, crossed=crossed)


def require_events(method: Method, state: State, until: Any, events: Any) -> tuple[tuple[str, Event], ...]:
    """The events to monitor by their names, `until` first; raises ArgumentError and LagrangianError."""
    end = as_event(until)
    found = ((("until", end),) if end is not None else ()) + tuple(named_events(events).items())
    for name, event in found:
        require_event(event, name, state)
        if method.variable:
            raise ArgumentError(
                f"An event, `{name}`, is located by parts of a step, but {method.title} chooses its own: leave it out."
            )
    return found


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
    require_events(method, state, until, None)


def carry_on(run: Run | Ensemble, progress: bool | None, began: float, accuracy: bool = True) -> Run | Ensemble:
    """Drive a run from where it stands to its end; raises StepError at a step that fails, save in an ensemble."""
    ended = run.position.ended
    judging = accuracy and run.accuracy is None
    sink = Sampler(run.memory, run.plan.steps, run.plan.save_every, chosen_members(run)) if judging else run.memory
    try:
        if not ended:
            before = run.seconds
            if isinstance(run, Ensemble) and run.plan.events:
                EnsembleEvents(run.plan, run.axes, sink, run.crossed, run.ended).drive(
                    run.position, progress, run.title
                )
            elif isinstance(run, Ensemble):
                drive(run.plan, run.axes, run.position, sink, progress, run.title)
            else:
                driver(run, sink, progress).drive(run.position)
            run.accuracy = judged(run, sink) if isinstance(sink, Sampler) else None
            run.set_up_seconds = time.perf_counter() - began - (run.seconds - before) - sink.seconds
        run.warnings += accuracy_warnings(run)
        if not isinstance(run, Ensemble) and not run.position.failed:
            run.warnings += energy_warnings(run) + budget.gap(run) + fixed_steps(run)
        if not ended:
            sink.finish(run.position)
    finally:
        sink.release()
    if not isinstance(run, Ensemble) and run.position.failed:
        raise StepError(_sentence(run), run)
    return run


def driver(run: Run, sink: Sink, progress: bool | None) -> Driver:
    """What drives a run, its records into a sink."""
    if run.plan.events:
        return EventDriver(run.plan, sink, progress, run.title, run.crossed)
    return Driver(run.plan, sink, progress, run.title)


def _program(system, method, state, kelvin_noether, monitors, events=()) -> tuple[StepProgram, Constants]:
    observed, watching = (), {}
    chosen = _quantities(kelvin_noether)
    if monitors:
        for quantity in chosen:
            quantity.require_equivariant(system, state)
        if chosen:
            noether = observe.chosen(chosen)
        else:
            watching["c0"] = isotropy_algebra(system, state)
            noether = observe.kelvin_noether if len(watching["c0"]) else None
        if system.quantities:
            require_quantities(system, state)
        observed = observe.watching(system, method, state, noether)
    functions = [partial(quantity.quantity, system) for quantity in chosen]
    functions += [partial(value, system, function) for _, function in system.quantities if monitors]
    if system.inputs is not None:
        functions.append(partial(inputs_held, system))
    crossing = tuple(event.function for _, event in events)
    functions += crossing
    digest = version(system, state, *functions)
    program = StepProgram(replace_parameters(system, None), method, observed, digest, crossing)
    holds = system.inputs is not None and system.inputs.holds
    return program, Constants(system.parameters, watching, RENEWED if holds else None)


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
    if method.variable:
        raise ArgumentError(f"The members of an ensemble share their times, but {method.title} has its own: run each.")
    system, start = with_inputs(system, start, inputs, method.start == "velocity")
    one, first = first_member(system, start)
    warnings = (
        require_internal(one, first, h) + one.check(first, method.regular) + require_forward(one, method, first, h)
    )
    members = begin_members(system, start, method, h, count, monitors)
    first, state = first_member(system, members.states)
    require_chart(first, method, state, h)
    watched = require_events(method, state, until, events)
    program, constants = _program(first, method, state, kelvin_noether, monitors, watched)
    program, constants, axes = with_own_directions(program, constants, members, warnings)
    chosen = kernels.choose(program, member_constants(constants, axes), state, monitors or bool(watched), backend)
    plan = Plan(chosen, program, constants, h, steps, save_every, monitors, watched, until is not None)
    position = MembersPosition.at_start(members.states, count)
    crossed: dict[str, list[list[State]]] = {name: [[] for _ in range(count)] for name, _ in watched[plan.until :]}
    return Ensemble(system, method, start, plan, members, axes, position, Memory(), warnings, crossed=crossed)


def require_chart(system: System, method: Method, state: State, h: float) -> None:
    """Raise where already the first step leaves the chart of the difference map."""
    for step, fraction in method.stages:
        reach = float(evaluate(lambda s, step=step, f=fraction: step.chart(system, s, np.float64(h) * f), state))
        if reach >= 1:
            raise ArgumentError(
                f"Argument `dt` = {h:g} is too large: the first step would leave the chart of {step.difference_map!r} "
                f"by a factor {reach:.3g}; take dt < {h / reach:.3g}."
            )


def _sentence(run: Run) -> str:
    """What happened, where, and the remedy."""
    index, code = run.good_steps, run.position.code
    unsolved, beyond = run.method.remedies
    where = f"Step {index} of {run.steps} (t = {float(run.position.state.t):.6g} s)"
    if code is Code.NOT_CONVERGED:
        many = f"{MAX_ITERATIONS} Newton iterations"
        return f"{where} did not converge in {many} with dt = {run.dt:g}; {unsolved}."
    if code is Code.BEYOND_CHART:
        return f"{where} left the chart of the difference map: {beyond}."
    if told := not_finite(run.plan, run.position.state):
        return f"{where}: {told}"
    if told := failure(run.system, float(run.position.state.t), run.dt):
        return f"{where}: {told}"
    return f"{where} gave numbers that are not finite; {unsolved}, or check the Lagrangian and forces there."
