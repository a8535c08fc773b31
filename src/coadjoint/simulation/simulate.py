"""`co.simulate`: from checked arguments to a problem, from the problem to a run, and the run to its end."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import truth, whole
from coadjoint.collector import collector_off
from coadjoint.errors import ArgumentError, Interrupted
from coadjoint.interrupts import deferred_interrupts
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run.backend import Backend
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics.inputs import Given
from coadjoint.mechanics.noether import KelvinNoether
from coadjoint.mechanics.restart_checks import Keep, continued
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.traced_once import Traced
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.program import as_read
from coadjoint.simulation.accuracy.resolution import require_full, with_trajectory_error
from coadjoint.simulation.arguments import grid, require_kinds
from coadjoint.simulation.events import Event
from coadjoint.simulation.execution import execute
from coadjoint.simulation.members import count_of, require_room
from coadjoint.simulation.outputs import Ordered, Output, ordered
from coadjoint.simulation.problem import SimulationProblem
from coadjoint.simulation.result import Result
from coadjoint.simulation.run import Run


@checks.known_arguments("co.simulate")
@deferred_interrupts()
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
    until: Event | Callable[[State], PyTree] | None = None,
    events: Mapping[str, Event | Callable[[State], PyTree]] | None = None,
    progress: bool | None = None,
    backend: Backend = "auto",
    store: str | os.PathLike[str] | None = None,
    keep: Keep | None = None,
    accuracy: bool | Literal["full"] = True,
    outputs: Sequence[Output] | None = None,
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
        dt: h, the length of a step, s; positive, without a default. A method with variable steps scales its steps by
            it and takes duration/dt of them; the certificate gives the time that they reach.
        duration: t_end − t₀, s, an integer multiple of dt; by default steps·dt. Give either this or `steps`.
        steps: the number of steps, at least 1; by default duration/dt.
        method: the integrator, by default `co.Midpoint(co.Cayley())`: order 2, symmetric, symplectic.
        save_every: every how many steps a record is kept, by default 1, and the last node always. Monitors and extrema
            cover every step nevertheless.
        monitors: whether energies, Kelvin–Noether quantities, budgets, residuals and the system's `quantities` are
            observed at every step; by default True. `system.watching({name: function})` adds quantities.
        kelvin_noether: a `co.mechanics.KelvinNoether(c0)` or several; by default one for each c₀ of a basis of
            {c₀ ∈ 𝔤 : c₀·a₀ = 0}.
        inputs: the values that forces and ℓ read as `inputs`, by default none: a signal such as
            `co.Linear(times, values)`, evaluated at the method's own nodes; a number or an array, constant; a function
            of the `co.mechanics.NodeMotion`, held over each step; or a dictionary of these, read as `inputs.name`.
        until: a function of the state to a number, or a `co.Event` with a direction: the run ends where it crosses
            zero, located on the dense output, and `run.event` is that time in s, or None; by default it runs to its
            end. It reads the ξ and ν of the node, as `run.final` has them. Needs fixed steps.
        events: name → function of the state or `co.Event`, by default none; `run.events[name]` are the states
            where it crosses zero, with ξ and ν of the node. Needs fixed steps; neither `events` nor `until` of an
            ensemble goes with `store`.
        progress: None, a progress bar on a terminal for runs over a second (the default); False, never.
        backend: "native", machine code, for small systems; "xla", JAX's compiler, for steps that cannot be traced to
            machine code; "auto", native where possible (the default).
        store: a folder to which records are written during the run, in constant memory; by default they stay in
            memory. Repeating the call continues an interrupted run, and returns a finished one; so does
            `co.resume(store, system)`.
        keep: the quantity that stays if `start` is a record of a run with other parameters, "momentum" (μ, π;
            velocities change) or "velocity" (ξ, ν); by default such a start raises ArgumentError. The certificate
            repeats the choice.
        accuracy: whether a sample of the steps is judged, each by comparison with shorter steps over the same time; by
            default True: the certificate gives the local error, or states that dt does not resolve the motion and
            which dt would. "full": the run is repeated with dt/2, and the certificate gives the error of the
            trajectory, or the time up to which it is accurate.
        outputs: a list of `co.Output`, by default none: each takes records, monitors or a function of the state at a
            cadence of its own, to memory (`run.outputs`), to a folder or to a function, which may end the run. Those
            of a run that `store` continues begin where it does.

    Returns a `Run`: `records`, `final`, `dataset` (an xarray.Dataset with the dimension `time`), `plot`, `save(path)`,
    `at(times)`. With `co.each` in the parameters or the start, all members run together in an `Ensemble`, with a
    dimension `member`; a member whose step fails is reported and masked, and the others continue.

    Raises ArgumentError, GroupError or LagrangianError before the first step, ArgumentError if `store` holds another
    run, FileError if it holds something else or cannot be written, and StepError at a step that fails, with the records
    computed until then in `.run`.

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
    fits = store is None or (isinstance(store, (str, os.PathLike)) and "\x00" not in os.fsdecode(store))
    checks.expect(fits, store, "store", "the path of a folder")
    start, warning = continued(system, start, keep)
    if store is not None and (events or (until is not None and count_of(system, start) is not None)):
        raise ArgumentError(
            "Argument `events`, and `until` for an ensemble, collect records in memory: leave out `store`."
        )
    observed = kelvin_noether, inputs, backend, until, events
    problem = SimulationProblem(system, start, method, h, steps, save_every, monitors, *observed)
    traces = Traced()
    with collector_off():
        run = problem.set_up(traces)
    run.warnings += [warning] if warning else []
    if store is not None:
        from coadjoint.simulation.resume import streamed  # loads zarr

        run = streamed(run, store, kelvin_noether, judging, traces)
    else:
        require_room(run)
    more = _ordered(outputs, run, kelvin_noether)
    run.taken = more.datasets
    with as_read(run.plan.program.version):
        done: Any = execute(run, progress, began, judging, more)
    if full:
        finer = replace(problem, h=h / 2, steps=2 * steps, save_every=2 * save_every, monitors=False)
        _judge_by(done, finer.set_up(), progress, began)
    return done


def _ordered(given: Sequence[Output] | None, run: Result, chosen: object) -> Ordered:
    """The outputs of a run."""

    def stored(of: Any, folder: Any) -> Any:
        from coadjoint.simulation.resume import streamed

        if os.path.exists(folder):
            raise ArgumentError(f"The folder {folder} of an output exists already: choose another one.")
        return streamed(of, folder, chosen, False, Traced())

    return ordered(given, run, stored)


def _judge_by(run: Run, finer: object, progress: bool | None, began: float) -> None:
    """Repeat the run with half its step size, and give the difference of the two in its certificate."""
    try:
        with_trajectory_error(run, execute(finer, progress, began, False))  # type: ignore[arg-type]
    except KeyboardInterrupt:
        raise Interrupted(
            "Interrupted in the second run, with dt/2, that judges the first: this one is whole, in `.run`.", run
        ) from None
