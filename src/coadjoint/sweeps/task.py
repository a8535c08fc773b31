"""One task of a sweep: some members stepped together, reduced, and written as one shard."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar

import jax
import numpy as np

from coadjoint.collector import collector_off
from coadjoint.errors import ArgumentError, CoadjointError, FileError, rephrased
from coadjoint.kernels.run.ensemble import at_most
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.members import count_members
from coadjoint.report.folder import RUN_FILE, kept_inputs
from coadjoint.runs import identity as runs
from coadjoint.runs.identity import difference
from coadjoint.runs.members import members as members_of
from coadjoint.runs.methods import method
from coadjoint.runs.run_file import RunFile
from coadjoint.runs.runnable import Runnable
from coadjoint.runs.setup import Setup
from coadjoint.simulation.arguments import grid, require_kinds
from coadjoint.simulation.execution import execute
from coadjoint.simulation.problem import SimulationProblem
from coadjoint.sweeps.file import QUICK, RUN, Sweep, of_tables
from coadjoint.sweeps.numbers import Design, side_by_side
from coadjoint.sweeps.reduction import Observer, Reduction
from coadjoint.sweeps.sketch import Sketch, merged
from coadjoint.sweeps.store import Shard, write
from coadjoint.texts import read_table, text_of

if TYPE_CHECKING:
    from coadjoint.simulation.run import Ensemble


REFUSED = -2
"""The code of a member that cannot be set up, such as one of a negative mass."""


_WORST = re.compile(r"Of member (\d+), and of (\d+) others of \d+, ")
"""How a warning about several members begins: the worst, by its number within those that are set up together."""
_OF_MEMBER = re.compile(r"^Of member \d+: ")
"""A member number within those that are set up together, which means nothing for a single one."""


_ONE = Lock()

T = TypeVar("T")


@dataclass(frozen=True)
class Task:
    """Some members of the sweep in a folder: the data that a worker receives.

    configuration: the SHA-256 of the sweep's text; rows: the numbers of these members; quick: whether parameters and
    starts may have values for all members together; identity: that of the sweep; size: the members of a full task;
    sample: the numbers of some members, spread over all.
    """

    folder: str
    configuration: str
    number: int
    first: int
    rows: Mapping[str, np.ndarray]
    count: int
    save_every: int
    chosen: tuple[str, ...]
    quick: bool
    identity: Mapping[str, str]
    size: int
    sample: Mapping[str, np.ndarray]


_sweeps: dict[tuple[str, str], tuple[Sweep, dict[str, str]]] = {}
"""The last sweep of this process, and its identity."""


def swept(task: Task) -> tuple[Sweep, dict[str, str]]:
    """The sweep of a task, and its identity in this process."""
    key = task.folder, task.configuration
    if key not in _sweeps:
        sweep = replace(read(*key), sampled=dict(task.sample))
        _sweeps.clear()
        _sweeps[key] = sweep, identity(sweep)
    return _sweeps[key]


def read(folder: str, configuration: str) -> Sweep:
    """The sweep in a folder; raises FileError if it is another."""
    import hashlib

    path = Path(folder) / RUN_FILE
    shared = "all workers need the folder of the sweep at the same path, on a disk that they share"
    with rephrased(f"A worker cannot read {path}", then=shared):
        text = text_of(path)
    if hashlib.sha256(text.encode()).hexdigest() != configuration:
        raise FileError(f"The folder {folder} holds another sweep by now: this task does not belong to it.")
    table = read_table(text, path)
    return of_tables({key: value for key, value in table.items() if key != RUN}, table[RUN], path, kept_inputs(path))


def perform(task: Task, threads: int = 1) -> dict[str, float]:
    """Compute a task and write its shard; returns its times, and the number of the process."""
    shard = compute(task, threads)
    began = time.perf_counter()
    sweep, _ = swept(task)
    shard.members = {**task.rows, **shard.members}
    write(Path(task.folder), task.number, task.size, shard, sweep.results.keep != "statistics")
    spent = time.perf_counter() - began
    return {"seconds": shard.seconds + spent, "kernel": shard.kernel, "writing": spent, "process": float(os.getpid())}


def compute(task: Task, threads: int = 1) -> Shard:
    """The shard of a task; tasks of one process run one after another, each on so many threads."""
    began = time.perf_counter()
    sweep, known = swept(task)
    if differing := difference(task.identity, known):
        raise ArgumentError(
            f"The model of a worker differs from the one at the start of the sweep: {differing}; all workers need the "
            "same "
            "files and versions."
        )
    with _ONE, at_most(threads), collector_off():
        parts = [_part(sweep, task, places) for places in _groups(sweep, task)]
        found = _joined(task, [piece for part in parts for piece in part])
    found.seconds = time.perf_counter() - began
    return found


def identity(sweep: Sweep) -> dict[str, str]:
    """The identity of a sweep: the run of the first of its sample that can be set up."""
    return first_possible(sweep, lambda _, file: runs.identity(file))


def first_possible(sweep: Sweep, make: Callable[[Design, Runnable], T]) -> T:
    """The value made from the first of the sample that can be set up; raises the error of the very first.

    make: (numbers of a member, its run) → anything.
    """
    refused: CoadjointError | None = None
    for numbers, file in sweep.sample_runs():
        try:
            return make(numbers, file)
        except FileError:
            raise
        except CoadjointError as error:
            refused = refused or error
    assert refused is not None
    raise refused


def _groups(sweep: Sweep, task: Task) -> Iterator[np.ndarray]:
    """The places of members of the task that step together: those whose slow numbers are the same."""
    if not (names := sweep.apart(task.quick)):
        yield np.arange(task.count)
        return
    _, inverse = np.unique(side_by_side(task.rows, names), axis=0, return_inverse=True)
    for group in range(int(inverse.max()) + 1):
        yield np.flatnonzero(inverse.ravel() == group)


@dataclass
class _Piece:
    """Members that were run together, or one that raised an error."""

    places: np.ndarray
    run: Any = None
    reduction: Any = None
    refusal: str = ""


def _part(sweep: Sweep, task: Task, places: np.ndarray) -> list[_Piece]:
    """Members run together; if some cannot be set up or run, only those are left out, found by bisection."""
    rows = {name: values[places] for name, values in task.rows.items()}
    try:
        run = ensemble(sweep, rows, task.first + places, task.quick, task.save_every)
        return [_Piece(places, run, _stepped(sweep, task, run))]
    except FileError:
        raise
    except CoadjointError as error:
        if len(places) == 1:
            return [_Piece(places, refusal=_OF_MEMBER.sub("", str(error)))]
        half = len(places) // 2
        return [*_part(sweep, task, places[:half]), *_part(sweep, task, places[half:])]


def _stepped(sweep: Sweep, task: Task, run: Ensemble) -> Reduction:
    """The kept results of members, which are stepped to their ends."""
    kept = sweep.results
    reduction = Reduction(
        Observer(run.system, task.chosen), run.position.state, kept.courses, kept.keep == "trajectories"
    )
    run.memory = reduction
    execute(run, False, time.perf_counter())
    if run.ended:
        states = jax.tree.map(lambda *leaves: np.stack(leaves), *run.ended.values())
        reduction.end([*run.ended], states)
    return reduction


def ensemble(
    sweep: Sweep, rows: Mapping[str, np.ndarray], members: np.ndarray, quick: bool, save_every: int
) -> Ensemble:
    """Members by number, with these numbers, ready to run; raises the errors of their run."""
    file, count = sweep.run(rows, quick, members), len(members)
    made, alike = _set_up(sweep, file, quick)
    made = _known(sweep, made, alike) if quick and not sweep.apart(True) else made
    start = made.start
    if count_members(made.system.parameters) is None and not np.ndim(start.t):
        start = jax.tree.map(lambda leaf: np.repeat(np.asarray(leaf)[None], count, axis=0), start)
    chosen, section = method(file.method), file.run
    require_kinds(made.system, start, chosen)
    h, steps = grid(section.dt, section.duration, section.steps)
    what = (made.system, start, chosen, h, steps, save_every)
    return SimulationProblem(*what, inputs=made.inputs, until=made.until).set_up()


def _set_up(sweep: Sweep, file: Runnable, quick: bool) -> tuple[Setup, Hashable]:
    """The set-up of some members, and a value that is equal for those whose systems differ in numbers alone."""
    if quick and isinstance(file, RunFile) and any(one.keys[0] in QUICK for one in sweep.varied):
        found = members_of(file)
        return found.together(sweep.varying), found.signatures[0]
    return file.set_up(), None


_setups: dict[int, tuple[Sweep, Setup, Hashable]] = {}
"""The first set-up of the last sweep of this process."""


def _known(sweep: Sweep, made: Setup, alike: Hashable) -> Setup:
    """A set-up with the system of the first one, so that cached data of its functions are found again.

    Only the parameters and the start differ.
    """
    before = _setups.get(id(sweep))
    if before is None:
        _setups.clear()
        _setups[id(sweep)] = sweep, made, alike
        return made
    if before[2] != alike:
        return made
    system = replace_parameters(before[1].system, made.system.parameters)
    return replace(before[1], system=system, start=made.start)


def _joined(task: Task, pieces: list[_Piece]) -> Shard:
    """All members of the task in their order."""
    found: dict[str, np.ndarray] = {"code": np.full(task.count, REFUSED), "steps_done": np.zeros(task.count, int)}
    found["event_time"] = np.full(task.count, np.nan)
    run_pieces = [piece for piece in pieces if piece.run is not None]
    for piece in run_pieces:
        failed = piece.run.codes != 0
        results = {**piece.reduction.results(failed), "code": piece.run.codes, "steps_done": piece.run.steps_done}
        if piece.run.event is not None:
            results["event_time"] = piece.run.event
        for name, values in results.items():
            if name not in found:
                found[name] = np.full((task.count, *values.shape[1:]), np.nan)
            found[name][piece.places] = values
    good = found["code"] == 0
    numbers = {
        name: values for name, values in found.items() if name.split("_")[0] in ("final", "least", "largest", "mean")
    }
    shard = Shard(
        found,
        {name: Sketch.of(values[good]) for name, values in numbers.items()},
        _courses(run_pieces),
        run_pieces[0].run.plan.h * run_pieces[0].run.steps_saved if run_pieces else np.zeros(0),
        {int(piece.places[0]) + task.first: piece.refusal for piece in pieces if piece.refusal},
        {},
        int(np.isfinite(found["event_time"]).sum()),
        sum(piece.run.seconds for piece in run_pieces),
    )
    for piece in run_pieces:
        for sentence in piece.run.warnings:
            said, members = _of_all(sentence, task.first + piece.places)
            shard.warnings[said] = shard.warnings.get(said, 0) + members
    if run_pieces and run_pieces[0].reduction.whole:
        shard.nodes = _nodes(task, run_pieces)
    return shard


def _of_all(sentence: str, members: np.ndarray) -> tuple[str, int]:
    """A warning with the number of its worst member in the sweep, and how many members it is about."""
    found = _WORST.match(sentence)
    if found is None:
        return sentence, len(members)
    return f"Of member {members[int(found[1])]}{sentence[found.end(1) :]}", int(found[2]) + 1


def _courses(pieces: list[_Piece]) -> dict[str, list[Sketch]]:
    """The sketch over all members at every node."""
    if not pieces:
        return {}
    names = pieces[0].reduction.nodes
    return {
        name: [merged(at_node) for at_node in zip(*(piece.reduction.nodes[name] for piece in pieces), strict=True)]
        for name in names
    }


def _nodes(task: Task, pieces: list[_Piece]) -> dict[str, np.ndarray]:
    """All values at every node, (members, nodes, …)."""
    found: dict[str, np.ndarray] = {}
    for piece in pieces:
        for name, rows in piece.reduction.rows.items():
            values = np.stack(rows, axis=1)
            if name not in found:
                found[name] = np.full((task.count, *values.shape[1:]), np.nan)
            found[name][piece.places] = values
    return found
