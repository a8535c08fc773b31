"""`co.sweep`: from a sweep to a folder of results."""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import jax
import numpy as np

from coadjoint import checks, disk
from coadjoint.disk import write_text
from coadjoint.errors import CoadjointError, FileError
from coadjoint.kernels.run.ensemble import cores
from coadjoint.log import logger
from coadjoint.manifest import Manifest
from coadjoint.report.folder import SUMMARY, UNFINISHED, claimed
from coadjoint.report.summary import to_json, versions
from coadjoint.runs.identity import IDENTITY, require_same
from coadjoint.runs.runnable import Runnable
from coadjoint.sealed import seal
from coadjoint.simulation import netcdf
from coadjoint.simulation.dataset import meanings
from coadjoint.simulation.progress import Progress
from coadjoint.sweeps import cluster, local, store
from coadjoint.sweeps.address import require_address, require_answer
from coadjoint.sweeps.file import QUICK, Sweep
from coadjoint.sweeps.numbers import Design, side_by_side
from coadjoint.sweeps.reduction import KINDS, choose, known
from coadjoint.sweeps.results import SweepResults, facts, gathered, load_sweep, meant
from coadjoint.sweeps.task import Task, ensemble, first_possible, identity, perform
from coadjoint.texts import Table

_log = logger(__name__)


def execute(
    sweep: Sweep,
    folder: Path,
    scheduler: str | None = None,
    workers: int | None = None,
    overwrite: bool = False,
    progress: bool | None = None,
) -> SweepResults:
    """Run a sweep into a folder, or its missing tasks; a folder with the complete sweep is checked and returned.

    Raises FileError if the folder holds something else, is in use, or cannot be written; ArgumentError for wrong
    numbers and for a wrong address of a scheduler.
    """
    if workers is not None:
        checks.whole(workers, "The number of workers")
    if scheduler is not None:
        cluster.require()
        require_address(scheduler)
    _ = sweep.size
    known = identity(sweep)  # before the folder is claimed: the imports of a factory are then known, and copied
    with claimed(folder, sweep.text, overwrite, sweep.places) as claim:
        compared = "sweep" in claim.manifest.facts and require_same(folder, claim.manifest.facts, known)
        if claim.complete:
            claim.tidy()
            if damaged := next(claim.manifest.problems(), None):
                raise FileError(f"{damaged.removesuffix('.')}; --overwrite begins the sweep again.")
            made = load_sweep(folder)
            made.compared = compared
            return made
        if scheduler is not None:
            require_answer(scheduler, cluster.PATIENCE)
        claim.manifest.facts[IDENTITY] = known
        plan = _planned(sweep, claim.manifest)
        store.discard_damaged(folder)
        began = time.perf_counter()
        busy = _compute(sweep, folder, plan, known, scheduler, workers, progress)
        spent = time.perf_counter() - began
        store.enter_chunks(claim.manifest, sweep.tasks)
        claim.manifest.facts["sweep"] = {"digest": plan["digest"], "members": sweep.members, "whole": True}
        claim.results(lambda stage: _write(sweep, claim.manifest, stage, plan, {"seconds": spent, **busy}))
    return load_sweep(folder)


def _planned(sweep: Sweep, manifest: Manifest) -> Table:
    """The common data of all tasks: determined once, kept in the manifest, the same when the sweep is resumed."""
    folder, found = manifest.folder, manifest.facts.get("sweep")
    if found is None:
        found = {**probed(sweep), "digest": sweep.digest, "size": sweep.size}
        disk.remove(folder / store.MEMBERS)
        disk.make(folder / UNFINISHED / store.SHARDS)
        if sweep.results.keep != "statistics":
            attributes = {"system": found["system"], "digest": found["digest"]}
            attributes["coordinates"] = " ".join(sweep.design[0])  # in the conventions of CF, which xarray reads
            store.lay_out(manifest, _layout(sweep, found), sweep.size, attributes)
        manifest.facts["sweep"] = found
        manifest.write()
    if found["digest"] != sweep.digest:
        raise FileError(
            f"The numbers that are drawn now are not those with which the sweep in {folder} began, as with another "
            "version of SciPy: use that version, or begin again with --overwrite."
        )
    return found


def probed(sweep: Sweep) -> Table:
    """The variables of the first members, and whether members may share parameters and starts with values for each."""
    first, alone = _first(sweep)
    quick = False
    if any(one.keys[0] in QUICK for one in sweep.varied):
        with contextlib.suppress(CoadjointError):
            quick = _same(alone, ensemble(sweep, *first, True, sweep.save_every))
    _log.info("%d members of %s in %d tasks of %d.", sweep.members, alone.system.name, sweep.tasks, sweep.size)
    there = known(alone.system, alone.position.state)
    chosen = choose(sweep.results.variables, there)
    told = meanings(dict.fromkeys(chosen), alone.system)
    dims = {name: list(there[name][0][1:]) for name in chosen}
    shapes = {name: list(np.shape(there[name][1])[1:]) for name in chosen}
    return {
        "system": alone.system.name,
        "method": alone.method.title,
        "quick": quick,
        "chosen": chosen,
        "dims": dims,
        "shapes": shapes,
        "meanings": {name: told.get(name, {}) for name in chosen},
        "nodes": alone.plan.nodes,
        "dt": alone.plan.h,
        "save_every": sweep.save_every,
        "steps": alone.plan.steps,
    }


def groups(sweep: Sweep, quick: bool) -> tuple[int, list[str]]:
    """The number of groups of members that are set up separately, and the names of the numbers in which they differ."""
    apart = sweep.apart(quick)
    return len(np.unique(side_by_side(sweep.design[0], apart), axis=0)) if apart else 1, apart


def _first(sweep: Sweep) -> tuple[tuple[Any, np.ndarray], Any]:
    """The first of the sample that can be set up, its numbers and itself; raises the error of the very first."""

    def made(row: Design, _: Runnable) -> tuple[tuple[Any, np.ndarray], Any]:
        chosen = (row, np.zeros(1, int))
        return chosen, ensemble(sweep, *chosen, False, sweep.save_every)

    return first_possible(sweep, made)


def _same(one: Any, other: Any) -> bool:
    """Whether two ways to set members up give the same numbers."""
    pairs = [(x.position.state, x.plan.constants.system) for x in (one, other)]
    leaves = [jax.tree.leaves(pair) for pair in pairs]
    if len(leaves[0]) != len(leaves[1]):
        return False
    return all(np.allclose(np.ravel(a), np.ravel(b), rtol=1e-12, atol=1e-14) for a, b in zip(*leaves, strict=True))


def _layout(sweep: Sweep, plan: Mapping[str, Any]) -> Table:
    """The arrays of the store: numbers, outcomes, results, and nodes if they are kept."""
    n, found = sweep.members, Table()
    for name, values in sweep.design[0].items():
        dims = (f"{name}_{axis}" for axis in range(values.ndim - 1))
        found[name] = (("member", *dims), values.shape, "float64", {"swept": 1})
    found["code"] = (("member",), (n,), "int64", {"long_name": "how its last step ended, 0 where it was good"})
    found["steps_done"] = (("member",), (n,), "int64", {"long_name": "good steps"})
    found["event_time"] = (("member",), (n,), "float64", {"units": "s", "long_name": "when an event ended it"})
    for name in plan["chosen"]:
        dims, shape = plan["dims"][name], plan["shapes"][name]
        for kind in KINDS:
            told = meant(f"{kind}_{name}", plan["meanings"][name])
            found[f"{kind}_{name}"] = (("member", *dims), (n, *shape), "float64", told)
        if sweep.results.keep == "trajectories":
            whole = (n, plan["nodes"], *shape)
            found[name] = (("member", "time", *dims), whole, "float64", plan["meanings"][name])
    return found


def _compute(
    sweep: Sweep,
    folder: Path,
    plan: Mapping[str, Any],
    known: Mapping[str, str],
    scheduler: str | None,
    workers: int | None,
    progress: bool | None,
) -> Table:
    """Compute all missing tasks; returns their times."""
    configuration = hashlib.sha256(sweep.text.encode()).hexdigest()
    place = str(folder.resolve())

    def made(number: int) -> Task:
        span = sweep.span(number)
        return Task(
            place, configuration, number, span.start, sweep.rows(span), span.stop - span.start, plan["save_every"],
            tuple(plan["chosen"]), plan["quick"], known,
            sweep.size, sweep.sample,
        )  # fmt: skip

    def missing() -> list[int]:
        return sorted(set(range(sweep.tasks)) - store.done(folder))

    began, taken, processes = time.perf_counter(), {"writing": 0.0, "busy": 0.0}, set[float]()
    first = missing()
    with Progress(sweep.tasks, progress, f"{sweep.members:,} members", "tasks") as bar:
        bar.advance(sweep.tasks - len(first), 0.0)

        def done(number: int, spent: Mapping[str, float]) -> None:
            taken["writing"] += spent["writing"]
            taken["busy"] += spent["seconds"]
            processes.add(spent["process"])
            bar.advance(1, time.perf_counter() - began)

        if scheduler is not None:
            waited = cluster.run(made, missing, done, scheduler)
        else:
            waited = local.run(lambda number: partial(perform, made(number)), first, done, workers or cores())
    return {
        **waited,
        "writing_seconds": taken["writing"],
        "busy_seconds": taken["busy"],
        "computed_tasks": len(first),
        "processes": len(processes),
    }


def _write(sweep: Sweep, manifest: Manifest, stage: Path, plan: Table, spent: Mapping[str, object]) -> None:
    """Statistics, figures and the summary of a sweep whose tasks are all done."""
    made, told = gathered(manifest.folder, sweep.tasks, sweep.results.quantiles, plan["dims"])
    for name in map(str, made.data_vars):
        of = name.partition("_")[2] if name.partition("_")[0] in KINDS else name
        made[name].attrs.update(meant(name, plan["meanings"][of]))
    netcdf.write(made, stage / store.STATISTICS)
    seal(stage / store.STATISTICS)
    summary: Table = {
        "system": plan["system"], "method": plan["method"], "dt": plan["dt"], "steps": plan["steps"],
        "save_every": plan["save_every"], "members": sweep.members, "tasks": sweep.tasks,
        "members_of_a_task": sweep.size,
        "sampling": sweep.sweep.sampling, "seed": sweep.sweep.seed, "numbers": list(sweep.design[0]), **told, **spent,
        "versions": versions(),
    }  # fmt: skip
    summary["card"] = "\n".join(f"{name:8} {text}" for name, text in facts(summary))
    summary["figures"] = []
    if sweep.results.figures and sweep.results.keep != "statistics":
        from coadjoint.sweeps.figures import save_figures

        summary["figures"] = save_figures(SweepResults(manifest, summary), stage)
    write_text(stage / SUMMARY, to_json(summary))
