"""`co.sweep`: many runs of one file, from Python."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.interrupts import deferred_interrupts
from coadjoint.runs.run_file import read
from coadjoint.runs.runnable import Runnable
from coadjoint.sweeps.file import of_tables
from coadjoint.sweeps.results import SweepResults
from coadjoint.sweeps.sweep import execute
from coadjoint.texts import Table, read_table


@deferred_interrupts()
def sweep(
    run: object,
    vary: Mapping[str, object] | None = None,
    *,
    store: str | os.PathLike[str] | None = None,
    sampling: str = "list",
    members: int | None = None,
    seed: int = 0,
    task: int | None = None,
    keep: str = "members",
    variables: Sequence[str] = (),
    save_every: int | None = None,
    quantiles: Sequence[float] = (0.05, 0.5, 0.95),
    courses: bool = False,
    figures: bool = True,
    scheduler: str | None = None,
    workers: int | None = None,
    overwrite: bool = False,
    progress: bool | None = None,
    **parameters: PyTree,
) -> SweepResults:
    """Many runs of a run or mission file, on this machine or a cluster of dask, into a folder.

        table = co.sweep("station.toml", mass=co.each(masses))
        table = co.sweep(mission, {"initial.heading_deg": {"from": 0, "to": 360}}, sampling="sobol", members=4096)
        table.dataset.final_q, table.statistics, table.failures

    Arguments:
        run: the path of a run or mission file, or a mission of `co.vehicles.load_mission`.
        vary: the varied numbers, by section and key as in "parameters.mass_kg", in the form of section [vary] of a
            sweep file: {"from": …, "to": …} with a "count" for grids, {"values": […]}, {"mean": …, "deviation": …}, or
            a list with such in the place of numbers; or `co.each(values)`, (members, …). By default nothing.
        store: the folder of the results, by default the name of the file with `_sweep`, in the working directory.
        sampling: "list", by default: member i gets the i-th value of each number; "grid": all combinations; or
            "random", "latin_hypercube", "sobol", which need `members`.
        members: the number of draws, at least 1; by default the length of the list or grid.
        seed: of the draws, 0 by default.
        task: the members of a task, at least 1; by default as many as take some ten seconds.
        keep: "statistics", "members" (the default) or "trajectories".
        variables: those whose results are kept, by default q, euler_angles, xi and nu.
        save_every: the steps between evaluated nodes, by default for some 60 nodes.
        quantiles: numbers between 0 and 1, by default 5 %, 50 % and 95 %.
        courses: whether statistics at every node are kept, by default False.
        figures: whether they are drawn, by default True; none with "statistics".
        scheduler: the address of a scheduler, as "tcp://HOST:8786"; by default processes of this machine.
        workers: how many of those, by default one for each core; with one, or a single task, it is this process.
        overwrite: whether a finished sweep in the folder is begun again, by default False.
        progress: as in `co.simulate`.
        parameters: the varied numbers of the section `parameters`, by its keys.

    Returns `SweepResults`. The same call again computes the missing members, or returns a finished sweep.

    Raises ArgumentError for numbers that cannot be varied and for a wrong address, and FileError if the folder holds
    another sweep, is in use or cannot be written, or a scheduler does not answer.
    """
    file = _file(run)
    given = {**(vary or {}), **{f"parameters.{key}": value for key, value in parameters.items()}}
    _require_variation(given)
    own = {"run": file.path.name, "sampling": sampling, "members": members, "seed": seed, "task": task}
    kept = {
        "keep": keep,
        "variables": list(variables),
        "save_every": save_every,
        "courses": courses,
        "figures": figures,
    }
    table = {
        "sweep": {key: value for key, value in own.items() if value is not None},
        "results": {**{k: v for k, v in kept.items() if v is not None}, "quantiles": list(map(float, quantiles))},
        "vary": _nested(given),
    }
    made = of_tables(table, read_table(file.text, file.path), file.path, file.inputs)
    folder = Path(f"{file.path.stem}_sweep" if store is None else store)
    return execute(made, folder, scheduler, workers, overwrite, progress)


def _file(run: object) -> Runnable:
    if isinstance(run, (str, os.PathLike)):
        return read(Path(run))
    found = getattr(run, "file", run)
    if not isinstance(found, Runnable):
        raise ArgumentError(
            f"Argument `run` must be the path of a run or mission file, or a mission, but is {shown(run)}."
        )
    return found


def _require_variation(given: Mapping[str, object]) -> None:
    """Raise ArgumentError unless something varies, and every key that is given does."""
    if not given:
        raise ArgumentError(
            "A sweep needs varied numbers: parameters by name, as in co.sweep(run, mass=co.each([30.5, 31.5])), and "
            "other "
            'keys by their section, as in co.sweep(run, {"initial.speed_m_s": co.each([1.0, 1.5])}).'
        )
    for name, value in given.items():
        if not _varies(value):
            raise ArgumentError(
                f"Numbers varied by co.sweep must have a value for each member, but {name} is {shown(value)}: give "
                'co.each([…]), or for other samplings than a list {"from": …, "to": …}; a value that all members '
                "have belongs into the run file."
            )


def _varies(value: object) -> bool:
    if isinstance(value, (list, tuple)):
        return any(map(_varies, value))
    return isinstance(value, Mapping) or hasattr(value, "member")


def _nested(given: Mapping[str, Any]) -> Table:
    """Tables within tables, of keys with dots."""
    found: Table = {}
    for name, value in given.items():
        inner, (*above, key) = found, name.split(".")
        for part in above:
            inner = inner.setdefault(part, {})
        inner[key] = value
    return found
