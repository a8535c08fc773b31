"""Sweep files: the run, the varied numbers, and the kept results."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks, sections
from coadjoint.arrays import PyTree
from coadjoint.checks import number, whole
from coadjoint.errors import ArgumentError
from coadjoint.runs.run_file import of_table, put
from coadjoint.runs.toml_text import to_toml
from coadjoint.sections import key
from coadjoint.sweeps.numbers import (
    DIGEST,
    DRAWN,
    MOST,
    SAMPLINGS,
    Design,
    NormalSection,
    RangeSection,
    ValuesSection,
    Varied,
    design,
    digest,
    read,
)  # fmt: skip
from coadjoint.texts import Table, file_text, read_table

if TYPE_CHECKING:
    from coadjoint.runs.runnable import Runnable

KEEP = ("statistics", "members", "trajectories")
"""The kept results of a sweep: statistics alone, results of every member, or also all saved nodes of every member."""
RUN = "run_file"
"""The section of a sweep's own configuration that holds the run file."""
QUICK = ("parameters", "initial")
"""Sections in which a value for each member may stand, so that all members step together."""
MOST_TASKS = 10_000
"""A scheduler is slow with millions of tasks, and quick with these."""
FEW_TASKS = 16
"""The least number of tasks, for several workers to share, unless they would be too small."""
LEAST_STEPS = 1e6
"""A task of fewer than LANES members has at least so many steps in all: about what its set-up takes."""
STEPS = 2e7
"""The default number of steps of all members of a task: ten seconds of a vehicle in native code, or some."""
LANES = 64
"""Members of a task are a multiple of this, so that no lane of native code idles."""
MOST_SEED = 1_000_000
"""Seeds of random currents, from seed and member, must be integers that a float represents."""
LISTED = 1000
"""Above this number of values a digest is written, which shows whether they are the same."""
SAMPLE = 16
"""Members that show in which numbers members differ; every k-th of a grid might have a number in common."""
NODES = 60
"""The default number of evaluated nodes of a run."""


def _shares(value: tuple[float, ...], name: str) -> tuple[float, ...]:
    return tuple(number(share, f"Each of {name}", above=0.0, below=1.0) for share in value)


@dataclass(frozen=True)
class SweepSection:
    """The run of a sweep, and the choice of its members."""

    run: str = key("run file or mission file that is swept", default="")
    sampling: str = key("how numbers are chosen", words=SAMPLINGS, default="grid")
    members: int | None = key("number of members, where numbers are drawn", check=whole, default=None)
    seed: int = key("seed of what is drawn", check=partial(whole, least=0, most=MOST_SEED - 1), default=0)
    task: int | None = key("members of a task", check=whole, default=None)

    def __post_init__(self):
        if self.sampling in DRAWN and self.members is None:
            raise ArgumentError(f"[sweep] sampling = {self.sampling!r} needs `members`, the number of draws.")
        if self.sampling not in DRAWN and self.members is not None:
            raise ArgumentError(f"[sweep] members follow from the values of a {self.sampling}: leave them out.")


@dataclass(frozen=True)
class ResultsSection:
    """The kept results of the members: variables and nodes."""

    keep: str = key("what is kept", words=KEEP, default="members")
    variables: list[str] = key("variables that are kept", factory=list)
    save_every: int | None = key("steps from one node to the next", check=whole, default=None)
    quantiles: tuple[float, ...] = key("quantiles of statistics", check=_shares, default=(0.05, 0.5, 0.95))
    courses: bool = key("whether statistics over time are kept", default=False)
    figures: bool = key("whether figures are drawn", default=True)


@dataclass(frozen=True)
class Sweep:
    """A sweep, read and checked. base: the table of its run file; places: the paths of the files that it names.

    sampled: the numbers of SAMPLE members, if those of all are not known, as on a worker.
    """

    sweep: SweepSection
    results: ResultsSection
    varied: tuple[Varied, ...]
    base: Mapping[str, Any]
    path: Path = Path("sweep.toml")
    places: Mapping[str, Path] = field(default_factory=dict)
    sampled: Design | None = None

    @cached_property
    def text(self) -> str:
        """The complete sweep as TOML, with its run file: the identity of a folder of results."""
        vary: Table = {}
        for one in self.varied:
            inner = vary
            for name in one.keys[:-1]:
                inner = inner.setdefault(name, {})
            inner[one.keys[-1]] = _written(one.template)
        own, kept = sections.written(self.sweep), sections.written(self.results)
        return to_toml({"sweep": own, "results": kept, "vary": vary, RUN: dict(self.base)})

    @cached_property
    def design(self) -> tuple[Design, int]:
        """The numbers of all members by name, and the number of members; raises ArgumentError."""
        numbers = [number for one in self.varied for number in one.numbers]
        return design(numbers, self.sweep.sampling, self.sweep.members, self.sweep.seed)

    @property
    def members(self) -> int:
        """How many runs it has."""
        return self.design[1]

    @property
    def digest(self) -> str:
        """The SHA-256 of the numbers of all members."""
        return digest(self.design[0])

    @cached_property
    def size(self) -> int:
        """The members of a task, a shard of the store; independent of the worker that computes them."""
        least = -(-self.members // MOST_TASKS)
        if self.sweep.task is None:
            shared = -(-self.members // FEW_TASKS)
            if shared < LANES:
                worth = -(-int(LEAST_STEPS) // self.steps)
                return min(max(shared, min(worth, LANES)), self.members)
            wished = min(max(int(STEPS / self.steps), LANES), shared)
            return min(-(-max(wished, least) // LANES) * LANES, self.members)
        if self.sweep.task < least:
            raise ArgumentError(
                f"[sweep] task = {self.sweep.task} would make {-(-self.members // self.sweep.task):,} tasks, but a "
                f"scheduler is quick with {MOST_TASKS:,} at most: give {least} or more, or leave it out."
            )
        return min(self.sweep.task, self.members)

    @property
    def tasks(self) -> int:
        """How many there are."""
        return -(-self.members // self.size)

    def span(self, task: int) -> slice:
        """The members of a task."""
        return slice(task * self.size, min((task + 1) * self.size, self.members))

    @cached_property
    def steps(self) -> int:
        """The steps of its first member."""
        grid = self.run(self.rows(slice(0, 1)), quick=False).run
        return grid.count

    @property
    def save_every(self) -> int:
        """The steps between evaluated nodes."""
        return self.results.save_every or max(self.steps // NODES, 1)

    def rows(self, span: slice) -> Design:
        """The numbers of some members."""
        return {name: values[span] for name, values in self.design[0].items()}

    def run(self, rows: Mapping[str, np.ndarray], quick: bool, members: np.ndarray | None = None) -> Runnable:
        """The run of the members with these numbers, in which those that are not `quick` are all the same.

        quick: whether those of the sections QUICK have a value for each member there. members: their numbers;
        random currents of a mission get a seed of each.
        """
        table = copy.deepcopy(dict(self.base))
        count = len(next(iter(rows.values())))
        for one in self.varied:
            together = quick and one.keys[0] in QUICK
            value = _each(one.values(rows, count)) if together else one.value({n: v[0] for n, v in rows.items()})
            put(table, one.keys, value, "What [vary] varies", ".".join(one.keys))
        made = replace(of_table(table, self.path, ""), places=self.places)
        return made if members is None else made.with_seeds(_each(self.sweep.seed * float(MOST) + members))

    @cached_property
    def varying(self) -> frozenset[str]:
        """The numbers of system and start in which members of a run file differ, as SAMPLE of them show.

        The same for every task, so that no member's result depends on those of its task. Raises ArgumentError where
        members differ in more than numbers.
        """
        from coadjoint.runs.members import members

        file: Any = self.run(self.sample, True)
        return members(file, possible=True).varying

    @property
    def sample(self) -> Design:
        """The numbers of SAMPLE members, the first and a random choice; one of them must be possible."""
        if self.sampled is not None:
            return self.sampled
        places = np.unique([0, *np.random.default_rng(0).integers(0, self.members, SAMPLE - 1)])
        return {name: values[places] for name, values in self.design[0].items()}

    def sample_runs(self) -> Iterator[tuple[Design, Runnable]]:
        """The numbers and the run of each of these members, alone."""
        rows = self.sample
        for place in range(len(next(iter(rows.values())))):
            row = {name: values[place : place + 1] for name, values in rows.items()}
            yield row, self.run(row, False)

    def apart(self, quick: bool) -> list[str]:
        """The names of the numbers of which no two values can step together; quick: whether those in QUICK can."""
        slow = [one for one in self.varied if not (quick and one.keys[0] in QUICK)]
        return [number.name for one in slow for number in one.numbers]


def _each(values: np.ndarray) -> Any:
    from coadjoint.mechanics.members import each

    return each(values)


def _written(template: PyTree) -> Any:
    """The varied numbers in the form of a file; for many values a digest, which shows whether they are the same."""
    if isinstance(template, list):
        return [_written(inner) for inner in template]
    if not hasattr(template, "between"):
        return template
    if template.values is not None:
        values = np.ascontiguousarray(template.values)
        many = values.size > LISTED
        return {"values": f"{DIGEST}{hashlib.sha256(values.tobytes()).hexdigest()}" if many else values.tolist()}
    if template.normal is not None:
        return {"mean": template.normal[0], "deviation": template.normal[1]}
    found = {"from": template.between[0], "to": template.between[1]}
    found |= {} if template.count is None else {"count": template.count}
    return found if template.even else {**found, "scale": "log"}


def of_tables(table: Mapping[str, Any], base: Mapping[str, Any], path: Path, places: Mapping[str, Path]) -> Sweep:
    """The sweep in a table of sections over the run in another one; raises ArgumentError."""
    known = ("sweep", "vary", "results")
    for name, given in table.items():
        checks.known(name, known, "section", "A sweep file")
        checks.instance(given, f"[{name}]", Mapping, "a section of a sweep file")
    own = sections.read(SweepSection, "sweep", table.get("sweep", {}))
    results = sections.read(ResultsSection, "results", table.get("results", {}))
    varied = tuple(read(table.get("vary", {})))
    if not varied:
        raise ArgumentError("A sweep needs a section [vary], such as [vary.parameters], with the varied numbers.")
    if base.get("perturb") or base.get("run", {}).get("members", 1) != 1:
        raise ArgumentError(
            "The run of a sweep must be of one member: leave [perturb] and [run] members out, and give the varied "
            "numbers in [vary], as in mass = { mean = …, deviation = … }."
        )
    return Sweep(own, results, varied, base, path, places)


def read_sweep(path: Path) -> Sweep:
    """The sweep in a TOML file; raises FileError and ArgumentError."""
    table = table_of(path, "sweep file")
    if "sweep" not in table:
        raise ArgumentError(
            f"The file {path} is not a sweep file, which has a section [sweep]: `coadjoint run {path}` runs a run file."
        )
    name = table["sweep"].get("run") if isinstance(table["sweep"], Mapping) else None
    if not isinstance(name, str) or not name:
        raise ArgumentError(f"[sweep] of {path} needs `run`, the name of a run or mission file next to it.")
    source = path.parent / name
    base = table_of(source, "run file")
    return of_tables(table, base, path, of_table(base, source, "").inputs)


def table_of(path: Path, word: str) -> dict[str, object]:
    """The table in a TOML file; raises FileError."""
    return read_table(file_text(path, word), path)


def declared() -> dict[str, type]:
    """The sections of sweep files, whose fields are their keys: a varied number is one of the three last ones."""
    varied = (RangeSection, ValuesSection, NormalSection)
    sections = dict(zip(("a range", "values", "a normal distribution"), varied, strict=True))
    return {"sweep": SweepSection, "results": ResultsSection} | {
        f"vary.…, {name}": kind for name, kind in sections.items()
    }
