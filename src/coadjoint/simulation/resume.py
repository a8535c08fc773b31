"""Runs whose records are on disk: begun in a new folder, and continued as if they had never been interrupted."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, FileError, rephrased, shown
from coadjoint.interrupts import deferred_interrupts
from coadjoint.labelled import Labelled
from coadjoint.log import logger
from coadjoint.manifest import MANIFEST, as_written
from coadjoint.mechanics.inputs import Given
from coadjoint.mechanics.noether import KelvinNoether
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.traced_once import Traced
from coadjoint.methods.method import Method
from coadjoint.simulation.accuracy.verdict import accuracy_from
from coadjoint.simulation.configuration import (
    fingerprint,
    method_form,
    method_from,
    named,
    start_form,
    start_from,
    versions,
)
from coadjoint.simulation.dataset import attributes, member_coordinates
from coadjoint.simulation.execution import execute
from coadjoint.simulation.folder import create, holds_run, sweep_beside, tidy
from coadjoint.simulation.lock import Lock
from coadjoint.simulation.plan import Extrema
from coadjoint.simulation.problem import SimulationProblem
from coadjoint.simulation.result import Result
from coadjoint.simulation.run import Ensemble, Run
from coadjoint.simulation.store import Store
from coadjoint.simulation.store_reader import read_configuration, run_manifest, standing
from coadjoint.simulation.stored_dataset import StoredRows, stored_dataset, stored_rows
from coadjoint.texts import Table


class _OnDisk(Result):
    """A run or an ensemble whose records a store takes."""

    @property
    def store(self) -> Store:
        """The store of the records, which this run has as its `memory`."""
        return cast(Store, self.memory)

    @property
    def count(self) -> int:
        return self.store.count

    @cached_property
    def steps_saved(self) -> np.ndarray:
        return self._rows()["step"].read()

    @cached_property
    def records(self) -> State:
        raise ArgumentError(
            f"The records of this run are on disk, in {self.store.folder}: use `run.dataset`, which reads them when "
            "needed, or `run.final`, the last of them."
        )

    @cached_property
    def monitors(self) -> dict[str, np.ndarray]:
        return self.rows_of([*self.ends])

    def rows_of(self, names: Sequence[str], members: slice = slice(None)) -> dict[str, np.ndarray]:
        rows = self._rows()
        return {name: rows[name].read(members) for name in names}

    def _rows(self) -> dict[str, StoredRows]:
        """The arrays of the folder."""
        return stored_rows(self.store.manifest, self.count)

    def _kinetic(self) -> np.ndarray:
        return np.asarray(self.store.kinetic)

    def internal_states(self) -> list[PyTree]:
        """Those of at most NODES nodes, evenly spaced, read from the disk."""
        last = None if self.store.last is None else self.store.last.internal
        if last is None or self.count < 2:
            return []
        every, rows = -(-self.count // NODES), self._rows()

        def read(path: tuple[Any, ...], _: object) -> np.ndarray:
            name = "internal_" + jax.tree_util.keystr(path).lstrip(".").replace(".", "_")
            values = rows[name].read(every=every)
            return values if self.members is None else np.swapaxes(values, 0, 1)

        return [jax.tree_util.tree_map_with_path(read, last)]

    def node_times(self) -> np.ndarray:
        if self.method.variable:
            return self._rows()["time"].read()
        return self.plan.h * self.steps_saved + np.ravel(self.start.t)[0]

    @property
    def ends(self) -> Extrema:
        return self.store.ends

    @property
    def last_record(self) -> State:
        if self.store.last is None:
            raise ArgumentError("This run holds no records: its first step failed, or it has not begun.")
        return self.store.last

    @cached_property
    def _arrays(self) -> Labelled:
        """What `dataset` holds, read from the disk when it is used."""
        return stored_dataset(self.store.manifest, self.count, attributes(self), member_coordinates(self))


class StreamedRun(_OnDisk, Run):
    """The result of `co.simulate(…, store=DIR)` and `co.resume(DIR, …)`: a `Run` that is read from disk when used."""

    @property
    def last_record(self) -> State:
        return self._of_this(super().last_record)


class StreamedEnsemble(_OnDisk, Ensemble):
    """The same for many members: an `Ensemble` that is read from disk when used."""


_log = logger(__name__)
NODES = 20_000
"""Of how many nodes of a run on disk the internal states are judged."""


def streamed(
    run: Result, path: str | os.PathLike[str], chosen: object, accuracy: bool, traces: Traced
) -> StreamedRun | StreamedEnsemble:
    """A run that has not begun, put into a new folder, or continued if the folder holds the same run.

    `chosen` are the Kelvin–Noether quantities of the user; accuracy: whether it is judged; traces: those of its kernel.
    """
    folder = Path(path).absolute()
    marks = _marks(run, traces)
    held = holds_run(folder)
    form, numbers = start_form(run.start)
    header = {
        "versions": versions(),
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
    if not held:
        try:
            return _with_store(run, create(folder, run, {"fingerprint": marks}, (header, numbers)))
        except FileError:
            if not (folder / MANIFEST).exists():  # that of a run that began at the same time
                raise
    then, _ = read_configuration(run_manifest(folder))
    _require_same(folder, then, marks, header)
    return _taken_up(run, folder)


def _marks(run: Result, traces: Traced) -> dict[str, str]:
    """The fingerprint of a run that was set up, and the names of what its dataset holds."""
    marks = fingerprint(run.plan, run.position.state, run.one, traces)
    return {**marks, "names": ", ".join(_names(run.system, run.position.state))}


def _names(system: System, state: State) -> list[str]:
    """The names in a dataset that a system gives: of forces, constraints, quantities, inputs and internal states."""
    forces = system.forces.names if system.forces is not None else ()
    given = {"inputs": state.inputs, "internal": state.internal}
    return [
        *(f"force `{name}`" for name in forces),
        *(f"constraint `{one.name}`" for one in system.constraints),
        *(f"quantity `{name}`" for name, _ in system.quantities),
        *(f"{kind}{path}" for kind, tree in given.items() for path, _ in named(tree)),
    ]


def _with_store(run: Result, store: Store) -> StreamedRun | StreamedEnsemble:
    parts: Table = {field.name: getattr(run, field.name) for field in fields(run)} | {"memory": store}
    made = StreamedRun(**parts) if run.members is None else StreamedEnsemble(**parts)
    store.attributes = lambda: attributes(made)
    return made


@deferred_interrupts()
def resume(
    folder: str | os.PathLike[str],
    system: System,
    *,
    start: State | None = None,
    method: Method | None = None,
    kelvin_noether: KelvinNoether | Sequence[KelvinNoether] | None = None,
    inputs: Given | None = None,
    until: Callable[[State], object] | None = None,
    progress: bool | None = None,
) -> Run:
    """Continue a run or an ensemble that `co.simulate(…, store=folder)` left unfinished, however it was interrupted.

        run = co.resume("spin", top)

    On the same kind of processor the result is bitwise identical to that of a run that was never interrupted. A
    finished run is returned unchanged, even from a read-only folder. The step size, the grid, the start and the method
    are read from the folder; functions are not stored there.

    Arguments:
        folder: the folder that was given as `store`.
        system: the system of the run, with the same equations and parameters.
        start: the start of the run; by default the one in the folder.
        method: the method of the run; needed where it is not one of the library.
        kelvin_noether, inputs, until: those of `co.simulate`; needed where the run had them.
        progress: as for `co.simulate`; by default a bar on a terminal for runs over a second.

    Returns a `Run` or an `Ensemble` that reads from the folder.

    Raises ArgumentError if the system or a function is not that of the run; FileError for a folder that holds no
    run, is damaged, or is in use; StepError as `co.simulate` does.
    """
    began = time.perf_counter()
    place = Path(folder).absolute()
    given = {"inputs": inputs, "kelvin_noether": kelvin_noether, "until": until}
    with as_written(place):
        header, numbers = read_configuration(run_manifest(place))
        for name in header["again"]:
            if given[name] is None:
                raise ArgumentError(f"This run was begun with `{name}`, which its folder does not keep: give it again.")
        kept = method_from(header["method"])
        if not isinstance(kept, Method | None):
            raise TypeError(f"no method, but {shown(kept)}")
        method = kept if method is None else method
        if method is None:
            raise ArgumentError("The folder of this run does not keep its method: give `method` again.")
        start = start_from(header["start"], numbers, system) if start is None else start
        grid = float(header["dt"]), int(header["steps"]), int(header["save_every"]), bool(header["monitors"])
        backend, accuracy = header["backend"], header["accuracy"]
    problem = SimulationProblem(system, start, method, *grid, kelvin_noether, inputs, backend, until)
    run = problem.set_up(traces := Traced())
    marks = _marks(run, traces)
    with as_written(place):
        _require_same(place, header, marks)
        taken = _taken_up(run, place)
    return execute(taken, progress, began, accuracy)  # type: ignore[return-value]


def _taken_up(run: Result, folder: Path) -> StreamedRun | StreamedEnsemble:
    """A run that was set up again, at the position in its folder; a finished one is only read."""
    complete = run_manifest(folder).facts["complete"]
    sweep_beside(folder)
    if complete:
        with contextlib.suppress(OSError):  # of a folder that may only be read, or that another process tidies
            tidy(folder)
    lock = None if complete else _locked(folder)
    try:
        manifest, found, arrays = standing(folder)
        store = Store(run, manifest, lock)
        run.position = store.take_up(found, arrays, run.position)
        _log.info("%s holds %d of %d records.", folder, store.count, run.plan.nodes)
        run.set_up_seconds = found["attributes"].get("set_up_seconds", 0.0)
        run.accuracy = accuracy_from(found["attributes"]) if run.position.ended else None
        return _with_store(run, store)
    except BaseException:
        if lock is not None:
            lock.release()
        raise


def _locked(folder: Path) -> Lock:
    with rephrased(f"The folder {folder} cannot be written"):
        return Lock(folder)


_PARTS = {
    "equations": "the system's or the method's equations",
    "parameters": "the parameters",
    "start": "the values at the start",
    "monitors": "the monitored quantities",
    "grid": "the step size or the number of steps",
    "names": "the names",
}


_SETTINGS = ("dt", "steps", "save_every", "monitors", "backend", "accuracy")


def _require_same(folder: Path, then: Table, marks: dict[str, str], now: Table | None = None) -> None:
    """Raise ArgumentError unless the run that was set up is the one in the folder; `now` are its settings."""
    before = run_manifest(folder).facts["fingerprint"]
    if before.get("tracing") != marks["tracing"]:
        raise ArgumentError(
            f"The folder {folder} holds a run that another version of coadjoint began: go on with that version, or "
            "begin the run again in another folder."
        )
    settings = [] if now is None else [name for name in _SETTINGS if now[name] != then[name]]
    differing = [f"{name} is {then[name]} there and {now[name]} here" for name in settings if now is not None]
    different = [_PARTS[name] for name, mark in before.items() if marks[name] != mark]
    if now is not None and now["method"] != then["method"]:
        differing.insert(0, f"the method differs ({then['title']} there, {now['title']} here)")
    told = differing or [f"{part} differ" for part in different[:1]]
    if told == ["the names differ"]:
        told = [f"its names are {before['names'] or 'none'} there and {marks['names'] or 'none'} here"]
    if not told:
        return
    packages = versions()
    changed = [f"{name} {then['versions'][name]} then and {packages[name]} now" for name in packages]
    changed = [text for name, text in zip(packages, changed, strict=True) if then["versions"][name] != packages[name]]
    versions_differ = f" (packages differ too: {', '.join(changed)})" if changed and different else ""
    mend = "give the system it was begun with" if now is None else "choose another folder for `store`"
    raise ArgumentError(f"The folder {folder} holds another run: {'; '.join(told)}{versions_differ}; {mend}.")
