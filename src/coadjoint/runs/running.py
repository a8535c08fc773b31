"""From a run file to a folder of results."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coadjoint.disk import write_text
from coadjoint.errors import FileError, StepError
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
from coadjoint.texts import LARGEST_SUMMARY, text_of

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run

TRAJECTORY = "trajectory.nc"

_log = logger(__name__)


@dataclass(frozen=True)
class Written:
    """A run, the folder that holds it, and its summary; `failure` tells why it stopped early.

    `before`: whether the folder held it already; `run` is then what co.load reads, None where no step was saved.
    `compared`: whether it is known that its model is the one of now.
    """

    run: Any
    folder: Path
    summary: dict[str, Any]
    failure: str | None = None
    before: bool = False
    compared: bool = False


def check(file: Runnable, folder: Path, overwrite: bool) -> list[str]:
    """The warnings with which a run of the file would begin; raises what `execute` raises before its first step.

    What is mistaken in the file comes before what is in the way in the folder, where nothing is left behind.
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

    Where the folder holds this run already, one that was interrupted goes on, and of one that has finished the results
    are returned, checked; `overwrite` begins it again. A step that fails ends the run; what was computed is written
    nevertheless, and the result tells. Until the results are written the records are in `unfinished`. Raises FileError
    where the folder holds another run or cannot be written, ArgumentError and LagrangianError before the run.
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
    """Go on with the run of a run file that was interrupted, from its folder alone, as `execute` does.

    Raises FileError where the folder holds no such run, or a damaged one; ArgumentError where the system has changed.
    """
    with held(folder) as claim:
        file = read(folder / RUN_FILE)
        return _carried_on(file, claim, None, progress)


def _carried_on(
    file: Runnable, claim: Claim, made: Setup | None, progress: bool | None, now: dict[str, str] | None = None
) -> Written:
    """The run of a claimed folder from where it stands to its results. now: what it is known by, if that is found."""
    if claim.complete:
        claim.tidy()
        return finished(claim)
    made = file.set_up() if made is None else made
    claim.manifest.facts[IDENTITY] = identity(file, made) if now is None else now
    run, failure = _ended(lambda: simulate(file, made, progress, claim.folder / UNFINISHED), claim.folder)
    return claim.results(lambda stage: write(file, claim.folder, stage, made, run, failure))


def finished(claim: Claim) -> Written:
    """What a folder holds that is complete; raises FileError where any of its files is not what was written."""
    from coadjoint.simulation.saved import load

    if damaged := next(claim.manifest.problems(), None):
        raise FileError(f"{damaged.removesuffix('.')}; --overwrite begins the run again.")
    summary = json.loads(text_of(claim.folder / SUMMARY, LARGEST_SUMMARY))
    trajectory = claim.folder / TRAJECTORY
    run = load(trajectory) if trajectory.exists() else None
    return Written(run, claim.folder, summary, summary["failure"], before=True)


def _ended(run: Callable[[], Run], folder: Path) -> tuple[Run, str | None]:
    """A run that has ended, and why it did so early; one that is interrupted tells its folder."""
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
    """Put the results that `folder` is to have into the folder `stage`."""
    figures: list[str] = []
    summary: dict[str, Any] = {}
    run.warnings += made.warnings
    if run.count:
        run.dataset.attrs.update(made.told)
        file.observe(run)
        run.warnings += file.warnings(run)
        run.save(stage / TRAJECTORY)
        summary, figures = file.results(stage, run)
    certificate = {} if "members" in summary else run_summary(run)
    summary = {**certificate, **summary, "failure": failure, "figures": figures, "versions": versions()}
    write_text(stage / SUMMARY, to_json(summary))
    _log.info("%s: results are in %s.", run.title, folder)
    return Written(run, folder, summary, failure)
