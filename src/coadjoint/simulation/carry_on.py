"""A run driven from where it stands to its end."""

from __future__ import annotations

import time

from coadjoint.errors import StepError
from coadjoint.kernels.program import MAX_ITERATIONS, Code
from coadjoint.log import logger
from coadjoint.mechanics.internal import failure
from coadjoint.simulation import budget
from coadjoint.simulation.accuracy.judgement import accuracy_warnings, chosen_members, judged
from coadjoint.simulation.accuracy.sample import Sampler
from coadjoint.simulation.driver import Driver, Sink
from coadjoint.simulation.energy_warnings import driven, energy_warnings, members_driven
from coadjoint.simulation.ensemble import (
    Ensemble,
)
from coadjoint.simulation.ensemble_driver import drive
from coadjoint.simulation.ensemble_events import EnsembleEvents
from coadjoint.simulation.event_driver import EventDriver
from coadjoint.simulation.events import not_finite
from coadjoint.simulation.run import Run
from coadjoint.simulation.step_sizes import fixed_steps

_log = logger(__name__)


def carry_on(run: Run | Ensemble, progress: bool | None, began: float, accuracy: bool = True) -> Run | Ensemble:
    """Drive a run from where it stands to its end; raises StepError at a step that fails, save in an ensemble."""
    ended = run.position.ended
    judging = accuracy and run.accuracy is None
    sink = Sampler(run.memory, run.plan.steps, run.plan.save_every, chosen_members(run)) if judging else run.memory
    before_it: list[str] = []
    try:
        before = run.seconds
        if not ended:
            _log.info("%s begins, %d steps by %s.", run.title, run.plan.steps, run.plan.backend)
            if isinstance(run, Ensemble) and run.plan.events:
                EnsembleEvents(run.plan, run.axes, sink, run.crossed, run.ended).drive(
                    run.position, progress, run.title
                )
            elif isinstance(run, Ensemble):
                drive(run.plan, run.axes, run.position, sink, progress, run.title)
            else:
                driver(run, sink, progress).drive(run.position)
        if isinstance(sink, Sampler):
            run.accuracy = judged(run, sink)
        if not ended:
            run.set_up_seconds = time.perf_counter() - began - (run.seconds - before) - sink.seconds
        run.warnings += accuracy_warnings(run)
        if isinstance(run, Ensemble):
            run.warnings += members_driven(run) if run.count else []
        elif run.position.failed:
            before_it = driven(run) if run.count else []
            run.warnings += before_it
        else:
            run.warnings += energy_warnings(run) + budget.gap(run) + fixed_steps(run)
        if not ended:
            sink.finish(run.position)
            _log.info("%s ends after %.3g s, set up in %.3g s.", run.title, run.seconds, run.set_up_seconds)
    finally:
        sink.release()
    if not isinstance(run, Ensemble) and run.position.failed:
        raise StepError(" ".join([_sentence(run), *before_it]), run)
    return run


def driver(run: Run, sink: Sink, progress: bool | None) -> Driver:
    """What drives a run, its records into a sink."""
    if run.plan.events:
        return EventDriver(run.plan, sink, progress, run.title, run.crossed)
    return Driver(run.plan, sink, progress, run.title)


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
    if reason := not_finite(run.plan, run.position.state):
        return f"{where}: {reason}"
    if reason := failure(run.system, float(run.position.state.t), run.dt):
        return f"{where}: {reason}"
    return f"{where} gave numbers that are not finite; {unsolved}, or check the Lagrangian and forces there."
