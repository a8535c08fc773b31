"""From a run file to a folder of results."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coadjoint.errors import ArgumentError, FileError, StepError
from coadjoint.log import logger
from coadjoint.plotting.whole_file import write_text
from coadjoint.report.folder import SUMMARY, begin_results, claimed, require_free, require_writable
from coadjoint.report.summary import run_summary, to_json, versions
from coadjoint.runs.resuming import UNFINISHED, discard, require_none_unfinished, unfinished
from coadjoint.runs.runnable import Runnable
from coadjoint.runs.setup import Setup

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run

TRAJECTORY = "trajectory.nc"

_log = logger(__name__)


@dataclass(frozen=True)
class Written:
    """A run, the folder that holds it, and its summary; `failure` tells why it stopped early."""

    run: Run
    folder: Path
    summary: dict[str, Any]
    failure: str | None = None


def check(file: Runnable, folder: Path, overwrite: bool) -> list[str]:
    """The warnings with which a run of the file would begin; raises what `execute` raises before its first step.

    What is mistaken in the file comes before what is in the way in the folder, where nothing is left behind.
    """
    _ = file.companions
    made = file.set_up()
    warnings = [*prepared(file, made).warnings, *made.warnings]
    try:
        _require_folder(file, folder, overwrite)
        require_writable(folder, file.text, overwrite)
    except FileError as error:
        raise FileError(f"{file.path} is a run file, but its results have no place. {error}") from error
    return warnings


def _require_folder(file: Runnable, folder: Path, overwrite: bool) -> None:
    """Raise FileError where the folder holds another run."""
    require_none_unfinished(folder, overwrite)
    require_free(folder, file.text, overwrite)


def prepared(file: Runnable, made: Setup) -> Run:
    """The run of a file as it stands before its first step; nothing is compiled.

    Raises ArgumentError and LagrangianError for what does not fit, figures that cannot be drawn of it among them.
    """
    from coadjoint.runs.methods import method
    from coadjoint.simulation.arguments import grid, require_kinds
    from coadjoint.simulation.preparing import prepare

    chosen, section = method(file.method), file.run
    require_kinds(made.system, made.start, chosen)
    h, steps = grid(section.dt, section.duration, section.steps)
    what = (made.system, made.start, chosen, h, steps, section.save_every)
    run = prepare(*what, True, None, made.inputs, "xla", made.until)
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


def execute(file: Runnable, folder: Path, overwrite: bool = False, progress: bool | None = None) -> Written:
    """Run a run file and write run.toml, trajectory.nc, figures and summary.json to `folder`.

    A step that fails ends the run; what was computed is written nevertheless, and the result tells. Until the results
    are written the records are in `unfinished`, from which `resume` goes on. Raises FileError where the folder holds
    another run or cannot be written, ArgumentError and LagrangianError before the run.
    """
    _require_folder(file, folder, overwrite)
    _ = file.companions
    made = file.set_up()
    if file.output.asked:
        prepared(file, made)
    with claimed(folder, file.text, overwrite):
        discard(folder)
        with _companions_kept(file.companions, folder):
            return write(
                file, folder, made, *_ended(lambda: simulate(file, made, progress, folder / UNFINISHED), folder)
            )


def resume(folder: Path, progress: bool | None = None) -> Written:
    """Go on with the run of a run file that was interrupted, and write what `execute` would have written.

    Raises FileError where the folder holds no such run, or a damaged one; ArgumentError where the system has changed.
    """
    from coadjoint.simulation.resume import resume as go_on

    file = unfinished(folder)
    made = file.set_up()

    def run() -> Run:
        return go_on(folder / UNFINISHED, made.system, inputs=made.inputs, until=made.until, progress=progress)

    return write(file, folder, made, *_ended(run, folder))


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


@contextmanager
def _companions_kept(sources: list[Path], folder: Path) -> Iterator[None]:
    """Files that the run file names are copied to the folder of the run, so that it can go on from the folder alone."""
    copies = [folder / source.name for source in sources]
    new = [copy for copy in copies if not copy.exists()]
    for source in sources:
        _copy(source, folder)
    try:
        yield
    except BaseException:
        if not (folder / UNFINISHED).exists():
            for copy in new:
                copy.unlink(missing_ok=True)
        raise


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


def write(file: Runnable, folder: Path, made: Setup, run: Run, failure: str | None) -> Written:
    """The results, the summary last: with it the folder is complete."""
    begin_results(folder)
    figures: list[str] = []
    summary: dict[str, Any] = {}
    run.warnings += made.warnings
    if run.count:
        run.dataset.attrs.update(made.told)
        run.warnings += file.warnings(run)
        run.save(folder / TRAJECTORY, overwrite=True)
        summary, figures = file.results(folder, run)
    certificate = {} if "members" in summary else run_summary(run)
    summary = {**certificate, **summary, "failure": failure, "figures": figures, "versions": versions()}
    write_text(folder / SUMMARY, to_json(summary))
    discard(folder)
    _log.info("%s: results are in %s.", run.title, folder)
    return Written(run, folder, summary, failure)


def _copy(source: Path, folder: Path) -> None:
    """Keep a file with the results that were made of it."""
    try:
        shutil.copyfile(source, folder / source.name)
    except shutil.SameFileError:
        return
    except OSError as error:
        raise FileError(f"{source} could not be copied to {folder}: {error.strerror or error}.") from error
