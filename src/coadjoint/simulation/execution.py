"""A run driven from its position to its end, and the remainder of an interrupted run."""

from __future__ import annotations

import time
from typing import Any, TypeVar

import numpy as np

from coadjoint.errors import Interrupted, StepError
from coadjoint.interrupts import forget, look
from coadjoint.kernels.newton.fixed_point import FixedPoint
from coadjoint.kernels.program import Code
from coadjoint.log import logger, phase
from coadjoint.mechanics.internal_rule import declared
from coadjoint.mechanics.internal_state import failure
from coadjoint.mechanics.singular_places import singular_place
from coadjoint.methods.rattle import kept
from coadjoint.simulation.accuracy.resolution import accuracy_warnings, chosen_members, judged_run
from coadjoint.simulation.accuracy.sample import Sampler
from coadjoint.simulation.certificate import fixed_steps
from coadjoint.simulation.dense import not_finite, part_of_step
from coadjoint.simulation.driver import Driver
from coadjoint.simulation.energy_budget import driven, energy_warnings, gap, members_driven
from coadjoint.simulation.event_driver import EventDriver, MembersEvents
from coadjoint.simulation.outputs import Ordered
from coadjoint.simulation.result import Result
from coadjoint.simulation.sinks import Memory, Outputs, Scheduled

_log = logger(__name__)


R = TypeVar("R", bound=Result)
NO_MORE = Ordered()


HALVINGS = 20
"""How often dt is halved in search of a step that is solved where dt failed."""


def execute(run: R, progress: bool | None, began: float, accuracy: bool = True, more: Ordered = NO_MORE) -> R:
    """Drive a run from its position to its end; raises StepError at a step that fails, except in an ensemble.

    more: the outputs that the user ordered.
    """
    ended = run.position.ended
    complete = run.memory.complete
    sampler = sampler_of(run) if accuracy and run.accuracy is None and not complete else None
    every = run.plan.save_every
    own = [Scheduled(sink, every) for sink in (sampler, run.memory) if sink is not None]
    outputs = Outputs([*own, *more.sinks], more.calls)
    loop, before_it = driver(run, outputs, progress), list[str]()
    try:
        before = run.seconds
        if not ended:
            phase("Running %s, %d steps.", run.title, run.plan.steps)
            _log.info("%s begins, %d steps %s.", run.title, run.plan.steps, run.plan.solution or "by native code")
            loop.drive(run.position)
        if sampler is not None:
            run.accuracy = judged_run(run, sampler)
        if not ended:
            run.set_up_seconds = time.perf_counter() - began - (run.seconds - before) - outputs.seconds
        run.warnings += accuracy_warnings(run)
        if run.members is not None:
            run.warnings += members_driven(run) if run.count else []
        elif run.position.failed:
            before_it = driven(run) if run.count else []
            run.warnings += before_it
        else:
            run.warnings += energy_warnings(run) + gap(run) + fixed_steps(run)
        if (stretches := run.internal_states()) and not run.position.failed:
            run.warnings += declared(run.system.internal).concluded(stretches, run.system.parameters)
        look()
        if not complete:
            outputs.finish(run.position)
            _log.info("%s ends after %.3g s, set up in %.3g s.", run.title, run.seconds, run.set_up_seconds)
    except KeyboardInterrupt:
        forget()
        if ended or not (run.position.steps or run.count):
            raise
        raise interrupted(run, loop) from None
    finally:
        outputs.release()
    if run.position.failed:
        raise StepError(" ".join([_sentence(run), *before_it]), run)
    return run


def sampler_of(run: Result) -> Sampler:
    """The sampler of the records by which a run is judged."""
    return Sampler(run.memory, run.plan.steps, run.plan.save_every, chosen_members(run))


def driver(run: Result, outputs: Outputs, progress: bool | None) -> Driver:
    """The driver of a run, whose records go into these sinks."""
    how = run.plan, outputs, progress, run.title
    if not run.plan.events:
        return Driver(*how)
    return EventDriver(*how, run.crossed) if run.members is None else MembersEvents(*how, run.crossed, run.ended)


def _solved(run: Result) -> str:
    """The longest of dt/2, dt/4, … that is solved where dt failed, as text; empty if none is, if Newton solves, or if
    the internal state has no course without the full step."""
    fixed = all(isinstance(stage.structure, FixedPoint) for stage in run.plan.program.stages)
    state = run.position.state
    if not fixed or state.internal_due is not None:
        return ""
    try:
        for halvings in range(1, HALVINGS + 1):
            fraction = 0.5**halvings
            if not part_of_step(run.plan, state, fraction, monitors=True).code:
                return f", and a step of {fraction * run.plan.h:.6g} s is solved there"
    except (Exception, KeyboardInterrupt):  # the message about the failed step matters more
        forget()
    return ""


def _singular(run: Result) -> str:
    """A sentence if the constraints of a run have come to a singular place."""
    memory = kept(run.position.state)
    if memory is None:
        return ""
    return singular_place(run.system, run.position.state, memory.independent, run.plan.h)


def _sentence(run: Result) -> str:
    """The failure, its place, and the remedy."""
    index, code = run.good_steps, run.position.code
    unsolved, beyond = run.method.remedies
    where = f"Step {index} of {run.plan.steps} (t = {float(run.position.state.t):.6g} s)"
    if code is Code.NOT_CONVERGED:
        many = run.plan.program.stages[0].structure.limit
        return f"{where} did not converge in {many} with dt = {run.plan.h:g}; {unsolved}{_solved(run)}.{_singular(run)}"
    if code is Code.BEYOND_CHART:
        return f"{where} left the chart of the difference map: {beyond}."
    if reason := not_finite(run.plan, run.position.state):
        return f"{where}: {reason}"
    if reason := failure(run.system, float(run.position.state.t), run.plan.h):
        return f"{where}: {reason}"
    if reason := _singular(run):
        return f"{where} gave numbers that are not finite.{reason}"
    energy = "Lagrangian" if run.system.hamiltonian is None else "Hamiltonian"
    return (
        f"{where} gave numbers that are not finite; {unsolved}{_solved(run)}, or check the {energy} and forces there."
    )


def interrupted(run: Any, loop: Driver) -> Interrupted:
    """The exception for a run whose loop was interrupted; its records end at the current position.

    Records in memory are cut there, and the current node is added. On disk a checkpoint is written, unless the
    interrupt came while records were written: then the run continues from the last checkpoint.
    """
    position, plan = run.position, run.plan
    if isinstance(run.memory, Memory):
        how = _in_memory(run, loop)
    else:
        whole = position.ended or not loop.taking
        if whole:
            loop.outputs.finish(position, complete=False)
        how = f"co.resume({str(run.memory.folder)!r}, system) goes on from the last checkpoint there"
        run = run if whole else None
    here = float(np.max(position.state.t) if plan.h > 0 else np.min(position.state.t))
    where = f"step {position.steps:,} of {plan.steps:,} (t = {here:.6g} s)"
    where = f"after the end of the run, {where}, before it was judged" if position.ended else f"at {where}"
    return Interrupted(f"Interrupted {where}; {how}.", run)


def _in_memory(run: Any, loop: Driver) -> str:
    """Cut a run at its position and say how to continue it."""
    position, plan = run.position, run.plan
    kept = "what was computed is in `.run` of this exception"
    if position.ended:
        return kept
    loop.outputs.cut(position.steps)
    loop.undo(position)
    loop.append_last(position)
    left = plan.steps - position.steps
    return f"{kept} (`error`), and co.simulate(system, error.run.final, dt={plan.h:g}, steps={left}) goes on"
