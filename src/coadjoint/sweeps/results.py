"""What a sweep leaves: a lazy dataset of its members, their statistics, a summary."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from coadjoint.errors import FileError
from coadjoint.kernels.program import Code
from coadjoint.report.folder import SUMMARY, held_manifest
from coadjoint.sweeps.reduction import KINDS
from coadjoint.sweeps.sketch import merged
from coadjoint.sweeps.store import MEMBERS, STATISTICS, statistics
from coadjoint.sweeps.task import REFUSED

if TYPE_CHECKING:
    from coadjoint.sweeps.sketch import Sketch

CAUSES = {REFUSED: "refused", **{int(code): code.name.lower().replace("_", " ") for code in Code}}
"""What the codes of members mean."""


class SweepResults:
    """A finished sweep: `dataset` of all members, read when used; `statistics` over them; `summary`.

    folder: where it is, a path. summary: that of its file, unless given.
    """

    def __init__(self, folder: Path, summary: dict[str, Any] | None = None):
        self.folder = folder
        try:
            self.summary: dict[str, Any] = summary or json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise FileError(f"The folder {folder} holds no finished sweep: there is no {SUMMARY}.") from error

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """Numbers, results and causes of failure of all members, with a dimension `member`; raises FileError."""
        path = self.folder / MEMBERS
        if not path.exists():
            raise FileError(f'The sweep in {self.folder} kept statistics alone: [results] keep = "members" keeps more.')
        found = xarray.open_zarr(path, consolidated=False, chunks=None)
        found = found[found.attrs["order"]]
        numbers = [name for name in found.data_vars if found[name].attrs.get("swept")]
        found = found.set_coords([*numbers, *(name for name in ("time",) if name in found)])
        return found.assign_coords(angle=["yaw", "pitch", "roll"]) if "angle" in found.dims else found

    @cached_property
    def statistics(self) -> xarray.Dataset:
        """Mean, standard deviation, extremes and quantiles over the members that did not fail."""
        return xarray.load_dataset(self.folder / STATISTICS, engine="h5netcdf")

    @property
    def failures(self) -> dict[str, int]:
        """How many members failed, by cause."""
        return dict(self.summary["failures"])

    def __repr__(self) -> str:
        told = ", ".join(f"{count:,} {cause}" for cause, count in self.failures.items()) or "none failed"
        return f"<Sweep of {self.summary['members']:,} members in {self.folder}: {told}>"


def load_sweep(folder: Path | str) -> SweepResults:
    """The finished sweep that `co.sweep` or `coadjoint sweep` left.

    folder: where it is, a path. Raises FileError where there is none.
    """
    path = Path(folder)
    if not path.is_dir():
        raise FileError(f"There is no folder {path}.")
    held = held_manifest(path)
    if held is None or "sweep" not in held.facts:
        raise FileError(f"The folder {path} holds no sweep.")
    return SweepResults(path)


def gathered(folder: Path, tasks: int, quantiles: Sequence[float], dims: dict[str, Any]) -> tuple[xarray.Dataset, dict]:
    """The statistics of all shards merged in their order, and what happened to the members."""
    sketches: dict[str, list[Sketch]] = {}
    courses: dict[str, list[list[Sketch]]] = {}
    codes, warnings, refusals = Counter[str](), Counter[str](), dict[str, str]()
    total = {"events": 0, "kernel_seconds": 0.0, "task_seconds": 0.0}
    times = np.zeros(0)
    for shard in statistics(folder, tasks):
        for name, sketch in shard.sketches().items():
            sketches.setdefault(name, []).append(sketch)
        for name, nodes in shard.courses().items():
            held = courses.setdefault(name, [[] for _ in nodes])
            for at_node, sketch in zip(held, nodes, strict=True):
                at_node.append(sketch)
        codes.update(shard.header["codes"])
        warnings.update(shard.header["warnings"])
        refusals |= shard.header["refusals"]
        total["events"] += shard.header["events"]
        total["kernel_seconds"] += shard.header["kernel"]
        total["task_seconds"] += shard.header["seconds"]
        times = shard.times if len(shard.times) > len(times) else times
    failures = {CAUSES[int(code)]: count for code, count in sorted(codes.items()) if int(code)}
    labels = ["mean", "std", "min", "max", *(f"{100 * q:.12g}%" for q in quantiles)]
    table: dict[str, Any] = {}
    for name, parts in sketches.items():
        table[name] = (("statistic", *dims[name.partition("_")[2]]), merged(parts).table(quantiles))
    for name, nodes in courses.items():
        rows = np.stack([merged(parts).table(quantiles) for parts in nodes], axis=1)
        table[name] = (("statistic", "time", *dims[name]), rows)
    coordinates: dict[str, Any] = {"statistic": labels}
    if courses:
        coordinates["time"] = times
    made = xarray.Dataset(table, coords=coordinates)
    made = made.assign_coords(angle=["yaw", "pitch", "roll"]) if "angle" in made.dims else made
    told = {"failures": failures, "finished": codes["0"], "warnings": dict(warnings), "refusals": refusals, **total}
    return made, told


def facts(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The summary in lines: what each is called, and the text."""
    failures = ", ".join(f"{count:,} {cause}" for cause, count in summary["failures"].items()) or "none"
    return [
        ("sweep", f"{summary['members']:,} × {summary['system']}, {summary['method']}, dt = {summary['dt']:g} s"),
        ("numbers", f"{', '.join(summary['numbers'])} ({summary['sampling']})"),
        ("tasks", f"{summary['tasks']:,} of {summary['members_of_a_task']:,} members"),
        ("failed", failures),
        ("events", f"{summary['events']:,}"),
        ("time", f"{summary['seconds']:.3g} s, of all tasks {summary['task_seconds']:.3g} s"),
    ]


def meant(name: str, attributes: dict[str, Any]) -> dict[str, Any]:
    """The attributes of `final_q` and the like, from those of `q`."""
    kind, _, of = name.partition("_")
    return (
        {**attributes, "long_name": f"{attributes.get('long_name', of)}, {KINDS[kind]}"}
        if kind in KINDS
        else attributes
    )
