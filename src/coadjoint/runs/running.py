"""From a run file to a folder of results."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coadjoint.disk import write_text
from coadjoint.errors import FileError, StepError
from coadjoint.labelled import of_run
from coadjoint.log import logger
from coadjoint.report.folder import (
    RUN_FILE,
    SUMMARY,
    UNFINISHED,
    Claim,
    claimed,
    held,
    held_manifest,
    require_free,
    require_writable,
)
from coadjoint.report.summary import run_summary, to_json, versions
from coadjoint.runs.identity import IDENTITY, identity, require_same
from coadjoint.runs.prepared import prepared
from coadjoint.runs.run_file import read
from coadjoint.runs.runnable import Runnable
from coadjoint.runs.setup import Setup
from coadjoint.texts import LARGEST_SUMMARY, Table, text_of

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run

TRAJECTORY = "trajectory.nc"

_log = logger(__name__)


@dataclass(frozen=True)
class Written:
    """A run, the folder that holds it, and its summary; `failure` is the reason why it stopped early.

    `before`: whether the folder held it already; `run` is then the run of co.load, None if no step was saved.
    `compared`: whether its model was compared with the present one.
    """

    run: Any
    folder: Path
    summary: Table
    failure: str | None = None
    before: bool = False
    compared: bool = False


def check(file: Runnable, folder: Path, overwrite: bool) -> list[str]:
    """The warnings with which a run of the file would begin; raises the errors of `execute` before its first step.

    Errors in the file come before obstacles in the folder, and nothing is left in the folder.
    """
    _ = file.inputs
    made = file.set_up()
    warnings = [*prepared(file, made).warnings, *made.warnings]
    try:
        require_writable(folder, file.text, file.inputs)
    except FileError as error:
        raise FileError(f"{file.path} is a run file, but its results have no place. {error}") from error
    return warnings


def execute(file: Runnable, folder: Path, overwrite: bool = False, progress: bool | None = None) -> Written:
    """Run a run file and write run.toml, trajectory.nc, figures and summary.json to `folder`.

    If the folder already holds this run, an interrupted one is continued, and the checked results of a finished one are
    returned; `overwrite` begins it again. A failed step ends the run; the steps before it are written nevertheless, and
    `failure` of the result has the reason. Until the results are written the records are in `unfinished`. Raises
    FileError if the folder holds another run or cannot be written, ArgumentError and LagrangianError before the run.
    """
    require_free(folder, file.text, file.inputs)
    there, made = held_manifest(folder), None
    complete = there is not None and bool(there.facts.get("complete")) and not overwrite
    if not complete or file.written_in_python:
        made = file.set_up()
        if file.output.asked:
            prepared(file, made)
    now = identity(file, made)
    compared = complete and there is not None and require_same(folder, there.facts, now)
    with claimed(folder, file.text, overwrite, file.inputs) as claim:
        return replace(_carried_on(file, claim, made, progress, now), compared=compared)


def resume(folder: Path, progress: bool | None = None) -> Written:
    """Continue the interrupted run of a run file, from its folder alone, as `execute` does.

    Raises FileError if the folder holds no such run, or a damaged one; ArgumentError if the system has changed.
    """
    with held(folder) as claim:
        file = read(folder / RUN_FILE)
        return _carried_on(file, claim, None, progress)


def _carried_on(
    file: Runnable, claim: Claim, made: Setup | None, progress: bool | None, now: dict[str, str] | None = None
) -> Written:
    """Continue the run of a claimed folder from its present records to its results. now: its identity, if known."""
    if claim.complete:
        claim.tidy()
        return finished(claim)
    made = file.set_up() if made is None else made
    claim.manifest.facts[IDENTITY] = identity(file, made) if now is None else now
    run, failure = _ended(lambda: simulate(file, made, progress, claim.folder / UNFINISHED), claim.folder)
    return claim.results(lambda stage: write(file, claim.folder, stage, made, run, failure))


def finished(claim: Claim) -> Written:
    """The results of a complete folder; raises FileError if any of its files has changed since it was written."""
    from coadjoint.simulation.saved import load

    if damaged := next(claim.manifest.problems(), None):
        raise FileError(f"{damaged.removesuffix('.')}; --overwrite begins the run again.")
    summary = json.loads(text_of(claim.folder / SUMMARY, LARGEST_SUMMARY))
    trajectory = claim.folder / TRAJECTORY
    run = load(trajectory) if trajectory.exists() else None
    return Written(run, claim.folder, summary, summary["failure"], before=True)


def _ended(run: Callable[[], Run], folder: Path) -> tuple[Run, str | None]:
    """A run that has ended, with the reason of an early end; an interruption is raised with the folder of the run."""
    try:
        return run(), None
    except StepError as error:
        if error.run is None:
            raise
        return error.run, error.sentence
    except KeyboardInterrupt:
        raise KeyboardInterrupt(*[folder] * (folder / UNFINISHED).exists()) from None


def simulate(file: Runnable, made: Setup, progress: bool | None = None, store: Path | None = None) -> Run:
    """The run of a run file, streamed to `store`."""
    from coadjoint.runs.methods import method
    from coadjoint.simulation.simulate import simulate as run

    grid = file.run
    return run(
        made.system,
        made.start,
        dt=grid.dt,
        duration=grid.duration,
        steps=grid.steps,
        save_every=grid.save_every,
        method=method(file.method),
        inputs=made.inputs,
        until=made.until,
        progress=progress,
        store=store,
    )


def write(file: Runnable, folder: Path, stage: Path, made: Setup, run: Run, failure: str | None) -> Written:
    """Write the results for `folder` into the folder `stage`."""
    figures: list[str] = []
    summary: Table = {}
    run.warnings += made.warnings
    if run.count:
        of_run(run).attrs.update(made.attributes)
        file.observe(run)
        run.warnings += file.warnings(run)
        run.save(stage / TRAJECTORY)
        summary, figures = file.results(stage, run)
    certificate = {} if "members" in summary else run_summary(run)
    summary = {**certificate, **summary, "failure": failure, "figures": figures, "versions": versions()}
    write_text(stage / SUMMARY, to_json(summary))
    _log.info("%s: results are in %s.", run.title, folder)
    return Written(run, folder, summary, failure)
