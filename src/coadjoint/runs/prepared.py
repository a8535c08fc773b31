"""A run of a file before its first step, and the check that all requests of the file fit it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    from coadjoint.runs.runnable import Runnable
    from coadjoint.runs.setup import Setup
    from coadjoint.simulation.run import Run


def prepared(file: Runnable, made: Setup) -> Run:
    """The run of a file before its first step; nothing is compiled.

    Raises ArgumentError and LagrangianError for settings that do not fit, also for figures that cannot be drawn of it.
    """
    from coadjoint.runs.methods import method
    from coadjoint.simulation.arguments import grid, require_kinds
    from coadjoint.simulation.problem import SimulationProblem

    chosen, section = method(file.method), file.run
    require_kinds(made.system, made.start, chosen)
    h, steps = grid(section.dt, section.duration, section.steps)
    what = (made.system, made.start, chosen, h, steps, section.save_every)
    run = SimulationProblem(*what, monitors=True, inputs=made.inputs, backend="xla", until=made.until).set_up()
    if file.output.asked:
        _require_drawable(file.output.asked, run)
    return run


def _require_drawable(figures: list[str], run: Run) -> None:
    """Raise ArgumentError for figures that a run will have nothing to draw for."""
    from coadjoint.plotting.plots import available
    from coadjoint.simulation.dataset import outline

    there = available(outline(run), films=True)
    if lacking := [name for name in figures if name not in there]:
        raise ArgumentError(
            f"[output] figures: a run of {run.system.name} has nothing to draw for `{lacking[0]}`; it has what is "
            f"drawn in {', '.join(there)}."
        )
