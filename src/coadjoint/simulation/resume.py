"""Runs that go on: from a folder and its system to the run as if it had never been interrupted."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from coadjoint.errors import ArgumentError, FileError
from coadjoint.kernels.trace.digest import digest
from coadjoint.log import logger
from coadjoint.mechanics.inputs import Given
from coadjoint.mechanics.noether import KelvinNoether
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.simulation.accuracy.judgement import accuracy_from
from coadjoint.simulation.carry_on import carry_on
from coadjoint.simulation.configuration import method_form, method_from, start_form, start_from, versions
from coadjoint.simulation.dataset import attributes, ensemble_attributes
from coadjoint.simulation.ensemble import Ensemble
from coadjoint.simulation.fingerprint import fingerprint
from coadjoint.simulation.folder import create, require_free
from coadjoint.simulation.lock import Lock
from coadjoint.simulation.preparing import prepare
from coadjoint.simulation.reading import read_checkpoint, read_configuration
from coadjoint.simulation.run import Run
from coadjoint.simulation.store import Store
from coadjoint.simulation.streamed import StreamedEnsemble, StreamedRun

_log = logger(__name__)

FORMAT = 1


def streamed(
    run: Run | Ensemble, path: str | os.PathLike[str], chosen: Any, accuracy: bool
) -> StreamedRun | StreamedEnsemble:
    """A run that has not begun, put into a new folder; `chosen` are the Kelvin–Noether quantities of the user.

    accuracy: whether it is judged.
    """
    folder = Path(path).absolute()
    require_free(folder)
    marks = fingerprint(run.plan, run.position.state, run.one)
    form, numbers = start_form(run.start)
    header = {
        "format": FORMAT,
        "versions": versions(),
        "fingerprint": marks,
        "identity": digest(marks),
        "dt": run.plan.h,
        "steps": run.plan.steps,
        "save_every": run.plan.save_every,
        "monitors": run.plan.monitors,
        "accuracy": accuracy,
        "backend": run.plan.backend,
        "method": method_form(run.method),
        "title": run.title,
        "start": form,
        "again": [
            name
            for name, it in (
                ("inputs", run.system.inputs),
                ("kelvin_noether", chosen),
                ("until", run.plan.until),
            )
            if it
        ],
    }
    return _with_store(run, create(folder, run, (header, numbers)))


def _with_store(run: Run | Ensemble, store: Store) -> StreamedRun | StreamedEnsemble:
    parts: dict[str, Any] = {field.name: getattr(run, field.name) for field in fields(run)} | {"memory": store}
    if isinstance(run, Ensemble):
        ensemble = StreamedEnsemble(**parts)
        store.attributes = lambda: ensemble_attributes(ensemble)
        return ensemble
    made = StreamedRun(**parts)
    store.attributes = lambda: attributes(made)
    return made


def resume(
    folder: str | os.PathLike[str],
    system: System,
    *,
    start: State | None = None,
    method: Method | None = None,
    kelvin_noether: KelvinNoether | Sequence[KelvinNoether] | None = None,
    inputs: Given | None = None,
    until: Callable[[State], Any] | None = None,
    progress: bool | None = None,
) -> Run:
    """Go on with a run or an ensemble that `co.simulate(…, store=folder)` left unfinished, however it was interrupted.

        run = co.resume("spin", top)

    The result is the same to the bit as that of a run that was never interrupted, on the same kind of processor. A
    finished run is returned as it is. The step size, the grid, the start and the method are read from the folder;
    functions are not stored there.

    Arguments:
        folder: the folder that was given as `store`.
        system: the system of the run, with the same equations and parameters.
        start: the start of the run; by default the one in the folder.
        method: the method of the run; needed where it is not one of the library.
        kelvin_noether, inputs, until: those of `co.simulate`; needed where the run had them.
        progress: as for `co.simulate`; by default a bar on a terminal for runs over a second.

    Returns a `Run` or an `Ensemble` that reads from the folder.

    Raises ArgumentError where the system or a function is not that of the run; FileError for a folder that holds no
    run, is damaged, or is in use; StepError as `co.simulate` does.
    """
    began = time.perf_counter()
    place = Path(folder).absolute()
    header, numbers = read_configuration(place)
    _require_readable(place, header)
    given = {"inputs": inputs, "kelvin_noether": kelvin_noether, "until": until}
    for name in header["again"]:
        if given[name] is None:
            raise ArgumentError(f"This run was begun with `{name}`, which its folder does not keep: give it again.")
    method = method_from(header["method"]) if method is None else method
    if method is None:
        raise ArgumentError("The method of this run is not the library's own: give `method` again.")
    start = start_from(header["start"], numbers, system) if start is None else start
    grid = (header["dt"], header["steps"], header["save_every"], header["monitors"])
    run = prepare(system, start, method, *grid, kelvin_noether, inputs, header["backend"], until)
    _require_same(place, header, fingerprint(run.plan, run.position.state, run.one))
    lock = _locked(place)
    try:
        store = Store(run, place, header["identity"], lock)
        found, arrays = read_checkpoint(place, header["identity"])
        run.position = store.take_up(found, arrays, run.position)
        _log.info("%s holds %d of %d records.", place, store.count, store.total)
        run.set_up_seconds = found["attributes"].get("set_up_seconds", 0.0)
        run.accuracy = accuracy_from(found["attributes"]) if run.position.ended else None
        made = _with_store(run, store)
    except BaseException:
        lock.release()
        raise
    return carry_on(made, progress, began, header["accuracy"])  # type: ignore[return-value]


def _locked(folder: Path) -> Lock:
    try:
        return Lock(folder)
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"The folder {folder} cannot be written: {error.strerror or error}.") from error


def _require_readable(folder: Path, header: dict[str, Any]) -> None:
    if header.get("format") != FORMAT:
        raise FileError(f"The run in {folder} was written by another version of coadjoint ({header.get('versions')}).")


_PARTS = {
    "equations": "the system's or the method's equations",
    "parameters": "the parameters",
    "start": "the values at the start",
    "monitors": "the monitored quantities",
    "grid": "the step size or the number of steps",
}


def _require_same(folder: Path, header: dict[str, Any], marks: dict[str, str]) -> None:
    """Raise ArgumentError unless the run that was set up is the one in the folder."""
    different = [_PARTS[name] for name, mark in header["fingerprint"].items() if marks[name] != mark]
    if different:
        then, now = header["versions"], versions()
        changed = ", ".join(f"{name} {then[name]} then and {now[name]} now" for name in now if then[name] != now[name])
        raise ArgumentError(
            f"The folder {folder} holds another run: {different[0]} differ"
            f"{f' (packages differ too: {changed})' if changed else ''}; give the system it was begun with."
        )
