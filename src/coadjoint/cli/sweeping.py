"""`coadjoint sweep FILE`: many runs of one file, here or on a cluster."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.sweeps.results import SweepResults


SHOWN = 5
"""The most warnings of a sweep that are printed."""


@dataclass(frozen=True)
class Sweep:
    """Run a sweep file, or its missing members: `coadjoint sweep masses.toml --out masses`."""

    BEGINS: ClassVar[str] = "Reading {file}."

    file: Annotated[tyro.conf.Positional[Path], called("FILE")]
    """The sweep file, with sections sweep, vary and results; with --starter a run file or a mission file."""
    out: Annotated[Path | None, called("DIR")] = None
    """Output folder, by default named like the file; one that holds this sweep is finished, or shown if it is
    complete."""
    scheduler: Annotated[str | None, called("ADDRESS")] = None
    """A scheduler of dask.distributed, as tls://HOST:8786; by default processes of this machine."""
    workers: Annotated[int | None, called("COUNT")] = None
    """How many processes of this machine, by default one for each core; 1 runs in the command itself."""
    check: bool = False
    """Show the runs of `sweep` and report its errors, without running anything."""
    json: bool = False
    """Print the summary as JSON, and nothing else."""
    starter: bool = False
    """Print a commented sweep file for a run file, to start from, and nothing else."""
    overwrite: bool = False
    """Begin a sweep that the folder holds again."""

    def __call__(self) -> int:
        from coadjoint.sweeps.file import read_sweep
        from coadjoint.sweeps.sweep import execute, groups, probed

        if self.starter:
            from coadjoint.sweeps.example import example

            terminal.text(example(self.file))
            return 0
        sweep = read_sweep(self.file)
        folder = self.out or Path(self.file.stem)
        if self.check:
            found = probed(sweep)
            plan = {"valid": True, "members": sweep.members, "tasks": sweep.tasks, "members_of_a_task": sweep.size}
            count, apart = groups(sweep, found["quick"])
            plan |= {"steps": found["steps"], "variables": found["chosen"], "groups": count, "apart": apart}
            plan["together"] = not apart
            terminal.json(plan, indent=None) if self.json else _check(self.file, folder, plan)
            return 0
        progress = False if self.json else None
        try:
            with _warned():
                progress = False if self.json else None
                made = execute(sweep, folder, self.scheduler, self.workers, self.overwrite, progress)
        except KeyboardInterrupt:
            terminal.complain("Finished members are kept: the same command again continues with the missing ones.")
            raise
        terminal.json(made.summary) if self.json else show(made)
        return 0


def _check(file: Path, folder: Path, plan: Table) -> None:
    terminal.line(
        f"{file} is a sweep of {plan['members']:,} members, {plan['steps']:,} steps each, "
        f"in {_counted(plan['tasks'], 'task')} of {plan['members_of_a_task']:,}; its results would go to {folder}/."
    )
    if plan["apart"]:
        terminal.line(
            f"Warning: members that differ in {' or '.join(plan['apart'])} cannot step together: they are set up "
            f"group after group, {_counted(plan['groups'], 'group')} in all, a fraction of a second each."
        )


def _counted(count: int, word: str) -> str:
    return f"{count:,} {word}{'' if count == 1 else 's'}"


@contextmanager
def _warned() -> Iterator[None]:
    """Warnings of the library as sentences on stderr."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = lambda message, *_: terminal.complain(f"Warning: {message}")
        yield


def show(made: SweepResults) -> None:
    """The summary, and statistics of the final states of members."""
    from coadjoint.runs.identity import NOT_COMPARED
    from coadjoint.sweeps.results import facts

    plan = made.summary
    terminal.fields(facts(plan))
    terminal.line("")
    finals = [str(name) for name in made.statistics.data_vars if str(name).startswith("final_")]
    labels = [str(label) for label in made.statistics.statistic.values]
    terminal.table(("result", *labels), [row for name in finals for row in _rows(made.statistics[name])])
    warned = sorted(plan["warnings"].items(), key=lambda row: -row[1])
    for sentence, count in warned[:SHOWN]:
        terminal.line(f"Warning, of {count:,} members: {sentence}")
    if len(warned) > SHOWN:
        terminal.line(f"{len(warned) - SHOWN} more warnings are in summary.json.")
    for member, sentence in list(plan["refusals"].items())[:3]:
        terminal.line(f"Member {member} was refused: {sentence}")
    terminal.line(f"Results: {made.folder}/")
    if not made.compared:
        terminal.line(NOT_COMPARED)


def _rows(values: Any) -> list[tuple[str, ...]]:
    flat = values.values.reshape(values.sizes["statistic"], -1)
    parts = [str(part) for part in values["angle"].values] if "angle" in values.dims else None
    names = parts or [str(place) for place in range(flat.shape[1])]
    unit = str(values.attrs.get("units", ""))
    ending = "" if unit in ("", "1") else f" ({unit})"
    return [
        (f"{values.name}{f'[{name}]' if flat.shape[1] > 1 else ''}{ending}", *(f"{value:.4g}" for value in column))
        for name, column in zip(names, flat.T, strict=True)
    ]
