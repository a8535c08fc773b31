"""From a run file to a folder of results."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coadjoint.cli.resuming import UNFINISHED, discard, require_none_unfinished, unfinished
from coadjoint.cli.run_file import RunFile
from coadjoint.errors import ArgumentError, CoadjointError, FileError, StepError
from coadjoint.plotting.plots import save_figures
from coadjoint.plotting.whole_file import write_text
from coadjoint.report.folder import SUMMARY, begin_results, claimed, require_free
from coadjoint.report.summary import run_summary, to_json, versions

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System
    from coadjoint.simulation.run import Run

TRAJECTORY = "trajectory.nc"


@dataclass(frozen=True)
class Written:
    """A run, the folder that holds it, and its summary; `failure` tells why it stopped early."""

    run: Run
    folder: Path
    summary: dict[str, Any]
    failure: str | None = None


def check(file: RunFile, folder: Path, overwrite: bool) -> None:
    """What can be said before anything heavy is loaded; raises FileError."""
    from coadjoint.cli.factory import require_file

    require_none_unfinished(folder, overwrite)
    require_free(folder, file.text, overwrite)
    if file.system.factory:
        require_file(file.system.factory, file.path)


def execute(file: RunFile, folder: Path, overwrite: bool = False, progress: bool | None = None) -> Written:
    """Run a run file and write run.toml, trajectory.nc, figures and summary.json to `folder`.

    A step that fails ends the run; what was computed is written nevertheless, and the result tells. Until the results
    are written the records are in `unfinished`, from which `resume` goes on. Raises FileError where the folder holds
    another run or cannot be written, ArgumentError and LagrangianError before the run.
    """
    check(file, folder, overwrite)
    system, start = system_and_start(file)
    with claimed(folder, file.text, overwrite):
        discard(folder)
        with _factory_kept(file, folder):
            return _write(file, folder, *_ended(lambda: simulate(file, system, start, progress, folder / UNFINISHED)))


def resume(folder: Path, progress: bool | None = None) -> Written:
    """Go on with the run of a run file that was interrupted, and write what `execute` would have written.

    Raises FileError where the folder holds no such run, or a damaged one; ArgumentError where the system has changed.
    """
    from coadjoint.simulation.resume import resume as go_on

    file = unfinished(folder)
    system, _ = system_and_start(file)
    return _write(file, folder, *_ended(lambda: go_on(folder / UNFINISHED, system, progress=progress)))


def _ended(run: Callable[[], Run]) -> tuple[Run, str | None]:
    """A run that has ended, and why it did so early."""
    try:
        return run(), None
    except StepError as error:
        if error.run is None:
            raise
        # "…; what was computed until then is kept in `.run`" is for Python; here the folder keeps it.
        return error.run, str(error).split("; what was computed")[0] + "."


@contextmanager
def _factory_kept(file: RunFile, folder: Path) -> Iterator[None]:
    """The factory's file is copied beside the run before it begins, so that it can go on from the folder alone."""
    source = file.path.parent / file.system.factory.split(":")[0] if file.system.factory else None
    copy = folder / source.name if source else None
    new = copy is not None and not copy.exists()
    if source is not None:
        _copy(source, folder)
    try:
        yield
    except BaseException:
        if new and copy is not None and not (folder / UNFINISHED).exists():
            copy.unlink(missing_ok=True)
        raise


def system_and_start(file: RunFile) -> tuple[System, State]:
    """The system of a run file and the state that it starts from."""
    if file.system.factory:
        from coadjoint.cli.factory import from_factory

        return from_factory(file.system.factory, file.path, file.parameters, file.initial)
    from coadjoint.models import catalogue

    entry = catalogue[file.system.model]
    try:
        system = entry.make(**file.parameters)
        return system, entry.start(system, **file.initial)
    except CoadjointError:
        raise
    except (TypeError, ValueError) as error:
        first = str(error).split("\n")[0]
        raise ArgumentError(
            f"Model `{file.system.model}` cannot be made from [parameters] and [initial]: {first}"
        ) from error


def simulate(
    file: RunFile, system: System, start: State, progress: bool | None = None, store: Path | None = None
) -> Run:
    """The run of a run file, streamed to `store`."""
    from coadjoint.cli.methods import method
    from coadjoint.simulation.simulate import simulate as run

    grid = file.run
    return run(
        system,
        start,
        dt=grid.dt,
        duration=grid.duration,
        steps=grid.steps,
        save_every=grid.save_every,
        method=method(file.method),
        progress=progress,
        store=store,
    )


def _write(file: RunFile, folder: Path, run: Run, failure: str | None) -> Written:
    """The results, the summary last: with it the folder is complete."""
    begin_results(folder)
    figures: list[str] = []
    if run.count:
        run.save(folder / TRAJECTORY, overwrite=True)
        if file.output.figures is not False:
            names = None if file.output.figures is True else file.output.figures
            figures = save_figures([run.dataset], folder, names, file.output.format)
    summary = {**run_summary(run), "failure": failure, "figures": figures, "versions": versions()}
    write_text(folder / SUMMARY, to_json(summary))
    discard(folder)
    return Written(run, folder, summary, failure)


def _copy(source: Path, folder: Path) -> None:
    """Keep the factory's file beside the results that it made."""
    try:
        shutil.copyfile(source, folder / source.name)
    except shutil.SameFileError:
        return
    except OSError as error:
        raise FileError(f"{source} could not be copied to {folder}: {error.strerror or error}.") from error
