"""The driver: a run in chunks, with monitors, progress and a certificate."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels import backend as kernels
from coadjoint.kernels.backend import Backend
from coadjoint.kernels.evaluate import evaluate, traced
from coadjoint.kernels.program import MAX_ITERATIONS, Code
from coadjoint.mechanics.inputs import Given
from coadjoint.mechanics.internal import failure, require_internal
from coadjoint.mechanics.ledger import energy_lines, with_ledger
from coadjoint.mechanics.noether import KelvinNoether, isotropy_algebra
from coadjoint.mechanics.quantities import value
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System, replace_parameters
from coadjoint.mechanics.version import version
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation import budget
from coadjoint.simulation import monitors as observe
from coadjoint.simulation.arguments import grid, require_kinds, require_quantities, whole
from coadjoint.simulation.backwards import require_forward
from coadjoint.simulation.driver import Driver, Memory, Plan, Position
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
from coadjoint.simulation.events import require_event
from coadjoint.simulation.inputs import inputs_held, with_inputs
from coadjoint.simulation.run import Run
from coadjoint.simulation.step_sizes import fixed_steps

TOO_MUCH_ENERGY = 0.1
"""The relative change of a conserved energy from which on the card warns."""
NO_EVENT = "Argument `until` ends one run at its own time: leave it out for an ensemble."


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
    until: Callable[[State], Any] | None = None,
    progress: bool | None = None,
    backend: Backend = "auto",
    store: str | os.PathLike[str] | None = None,
) -> Run:
    """Integrate `system` from `start` and return the run: dataset, plots, and a certificate when printed.

    Give `duration` (s) or `steps`; a method with variable steps takes duration/dt of them, and the card tells to which
    t they led. Every save_every-th node is kept, and the last; energies, Kelvin–Noether quantities
    and residuals are watched at every step nevertheless, unless `monitors=False`, and so are the system's `quantities`
    (`system.watching({name: function})` adds some). `kelvin_noether` chooses quantities
    of your own; by default one for each c₀ that leaves all advected parameters alone. `inputs` is a function of the
    motion, held over each step, or a signal such as co.Linear(times, values), taken at the method's own nodes, or a
    dictionary of these; a dictionary, given or returned, reaches ℓ and forces as `inputs.name`.
    `until` is a function of the state, such as `lambda state: state.q[2] - 10.0`: the run ends where its sign changes
    between two nodes, located on the dense output; `run.event` is that time, or None where it never does. A progress
    bar appears for runs over a second on a terminal (`progress=False`: never).
    With `co.each` on parameters or start, all members run at once and an `Ensemble` comes back, with `dataset`, `plot`,
    `records` and `save` like a run and a dimension `member`; one that fails is reported and masked, the others finish.
    `backend`: "native" code for small systems, "xla" for what it cannot trace; "auto" chooses.
    `store`, a new folder, takes the records as they come, in constant memory; a run or an ensemble that is killed goes
    on with `co.resume(store, system)`.
    Raises ArgumentError and LagrangianError before the run; StepError, with what was computed in `.run`, at a step
    that fails.
    """
    began = time.perf_counter()
    method = Midpoint() if method is None else method
    require_kinds(system, start, method)
    if traced(system.parameters, start, dt):
        raise ArgumentError("co.simulate cannot be differentiated or mapped by JAX: use co.trajectory, which can.")
    h, steps = grid(dt, duration, steps)
    save_every = whole(save_every, "save_every")
    run = prepare(system, start, method, h, steps, save_every, monitors, kelvin_noether, inputs, backend, until)
    if store is not None:
        from coadjoint.simulation.resume import streamed

        run = streamed(run, store, kelvin_noether)
    else:
        require_room(run)
    return carry_on(run, progress, began)  # type: ignore[return-value]


def prepare(
    system: System, start: State, method: Method, h: float, steps: int, save_every: int, monitors: bool,
    kelvin_noether: Any, inputs: Any, backend: Backend, until: Any = None,
) -> Any:  # fmt: skip
    """A Run, or an Ensemble where co.each is used, that is checked and set up but has not begun."""
    if (count := count_of(system, start)) is not None:
        if until is not None:
            raise ArgumentError(NO_EVENT)
        whole = (count, h, steps, save_every, monitors, kelvin_noether, inputs, backend)
        return _prepare_members(system, start, method, *whole)
    system, start = with_inputs(system, start, inputs)
    warnings = require_internal(system, start, h) + system.check(start) + require_forward(system, method, start, h)
    state = with_ledger(system, method.begin(system, start, h), monitors)
    _require_chart(system, method, state, h)
    require_event(until, state)
    if until is not None and method.variable:
        raise ArgumentError(
            f"Argument `until` locates an event by parts of a step, but {method.title} chooses its own: leave it out."
        )
    program, constants = _program(system, method, state, kelvin_noether, monitors, until)
    chosen = kernels.choose(program, constants, state, monitors, backend)
    plan = Plan(chosen, program, constants, h, steps, save_every, monitors)
    return Run(system, method, start, plan, Position(state), Memory(), warnings)


def require_fit(system: System, start: State, method: Method, h: float, inputs: Any = None, until: Any = None) -> None:
    """Raise what `simulate` raises for a method that does not fit the system or its start; nothing is compiled."""
    require_kinds(system, start, method)
    together = count_of(system, start) is not None
    if together and until is not None:
        raise ArgumentError(NO_EVENT)
    system, start = with_inputs(system, start, inputs)
    system, start = first_member(system, start) if together else (system, start)
    require_internal(system, start, h)
    require_forward(system, method, start, h)
    state = method.begin(system, start, h)
    _require_chart(system, method, state, h)
    require_event(until, state)


def carry_on(run: Run | Ensemble, progress: bool | None, began: float) -> Run | Ensemble:
    """Drive a run from where it stands to its end; raises StepError at a step that fails, save in an ensemble."""
    sink = run.memory
    try:
        if not run.position.ended:
            before = run.seconds
            if isinstance(run, Ensemble):
                drive(run.plan, run.axes, run.position, sink, progress, run.title)
            else:
                Driver(run.plan, sink, progress, run.title).drive(run.position)
            run.set_up_seconds = time.perf_counter() - began - (run.seconds - before) - sink.seconds
            sink.finish(run.position)
    finally:
        sink.release()
    if isinstance(run, Ensemble):
        return run
    if run.position.failed:
        raise StepError(_sentence(run), run)
    run.warnings += _lost_energy(run) + budget.gap(run) + fixed_steps(run)
    return run


def _lost_energy(run: Run) -> list[str]:
    """A warning where energy, which nothing may change, changed much: the step does not resolve the motion."""
    changed = energy_lines(run.system) or run.system.takes("inputs") or run.system.takes("internal")
    if changed or "energy" not in run.extrema or run.relative_change("energy") < TOO_MUCH_ENERGY:
        return []
    much = run.relative_change("energy")
    return [f"The energy, which nothing changes, is off by {much:.0%}: the motion is too fast for dt = {run.dt:g}."]


def _program(system, method, state, kelvin_noether, monitors, until=None) -> tuple[StepProgram, Constants]:
    observed, watching = [], {}
    chosen = [kelvin_noether] if isinstance(kelvin_noether, KelvinNoether) else list(kelvin_noether or [])
    if not all(isinstance(quantity, KelvinNoether) for quantity in chosen):
        raise ArgumentError(f"Argument `kelvin_noether` must be co.KelvinNoether(c0), or several, but is {chosen!r}.")
    if monitors:
        observed = [observe.discrete_energy]
        if system.continuous:
            observed.insert(0, observe.legendre_energy)
        if observe.has_directions(system):
            observed.append(observe.node_velocities)
        for quantity in chosen:
            quantity.require_equivariant(system, state)
        if chosen:
            observed.append(observe.Chosen(tuple(chosen)))
        else:
            watching["c0"] = isotropy_algebra(system, state)
            if len(watching["c0"]):
                observed.append(observe.kelvin_noether)
        if state.ledger is not None:
            observed.append(observe.energy_budget)
        if method.variable:
            observed.append(observe.step_size)
        if system.group.constrained:
            observed.append(observe.group_defect)
        if system.quantities:
            require_quantities(system, state)
            observed.append(observe.quantities)
    functions = [partial(quantity.quantity, system) for quantity in chosen]
    functions += [partial(value, system, function) for _, function in system.quantities if monitors]
    if system.inputs is not None:
        functions.append(partial(inputs_held, system))
    if until is not None:
        functions.append(until)
    digest = version(system, state, *functions)
    program = StepProgram(replace_parameters(system, None), method, tuple(observed), digest, until)
    return program, Constants(system.parameters, watching)


def _prepare_members(
    system, start, method, count, h, steps, save_every, monitors, kelvin_noether, inputs, backend
) -> Ensemble:
    """`prepare` for an ensemble: what is the same for all members is checked on the first."""
    if method.variable:
        raise ArgumentError(f"The members of an ensemble share their times, but {method.title} has its own: run each.")
    system, start = with_inputs(system, start, inputs)
    one, first = first_member(system, start)
    warnings = require_internal(one, first, h) + one.check(first) + require_forward(one, method, first, h)
    members = begin_members(system, start, method, h, count, monitors)
    first, state = first_member(system, members.states)
    _require_chart(first, method, state, h)
    program, constants = _program(first, method, state, kelvin_noether, monitors)
    program, constants, axes = with_own_directions(program, constants, members, warnings)
    chosen = kernels.choose(program, member_constants(constants, axes), state, monitors, backend)
    plan = Plan(chosen, program, constants, h, steps, save_every, monitors)
    position = MembersPosition.at_start(members.states, count)
    return Ensemble(system, method, start, plan, members, axes, position, Memory(), warnings)


def _require_chart(system: System, method: Method, state: State, h: float) -> None:
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
    if told := failure(run.system, float(run.position.state.t), run.dt):
        return f"{where}: {told}"
    return f"{where} gave numbers that are not finite; {unsolved}, or check the Lagrangian and forces there."
