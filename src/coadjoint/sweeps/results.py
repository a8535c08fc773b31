"""Results of a sweep: a lazy dataset of its members, their statistics, a summary."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from zarr.storage import LocalStore

from coadjoint.disk import require_folder
from coadjoint.errors import FileError, rephrased
from coadjoint.kernels.program import Code
from coadjoint.manifest import DAMAGED, Manifest, sums_up
from coadjoint.report.folder import SUMMARY, held_manifest
from coadjoint.sealed import readable
from coadjoint.simulation.zarr_reader import arrays, require_chunks
from coadjoint.sweeps.reduction import KINDS
from coadjoint.sweeps.sketch import merged
from coadjoint.sweeps.store import MEMBERS, STATISTICS, statistics
from coadjoint.sweeps.task import REFUSED
from coadjoint.texts import LARGEST_SUMMARY, Table, text_of

if TYPE_CHECKING:
    from coadjoint.sweeps.sketch import Sketch

CAUSES = {REFUSED: "refused", **{int(code): code.name.lower().replace("_", " ") for code in Code}}
"""The meaning of the codes of members."""


class SweepResults:
    """A finished sweep: `dataset` of all members, read when used; `statistics` over them; `summary`.

    manifest: that of its folder, with which all data read are compared. summary: that of its file, unless given.
    `compared`: False if the same sweep was requested again and its folder holds no identity to compare it by.
    """

    def __init__(self, manifest: Manifest, summary: Table | None = None):
        self.manifest, self.folder, self.compared = manifest, manifest.folder, True
        self.summary: Table = _summary(manifest) if summary is None else summary

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """Numbers, results and causes of failure of all members, with a dimension `member`; raises FileError."""
        path, place = self.folder / MEMBERS, f"{MEMBERS}/zarr.json"
        if place not in self.manifest.files and not path.exists():
            raise FileError(f'The sweep in {self.folder} kept statistics alone: [results] keep = "members" keeps more.')
        complete = bool(self.manifest.facts["sweep"].get("whole"))
        store = verified(self.manifest, MEMBERS, complete)
        require_chunks(self.manifest, MEMBERS, complete)
        # xarray and zarr have errors of all kinds
        with rephrased(f"The arrays in {path} cannot be opened", Exception, then=DAMAGED):
            found = xarray.open_zarr(store, consolidated=False, chunks=None, decode_cf=False, zarr_format=3)
            found = found[found.attrs["order"]]
            numbers = [name for name in found.data_vars if found[name].attrs.get("swept")]
            found = found.set_coords([*numbers, *(name for name in ("time",) if name in found)])
            return found.assign_coords(angle=["yaw", "pitch", "roll"]) if "angle" in found.dims else found

    @cached_property
    def statistics(self) -> xarray.Dataset:
        """Mean, standard deviation, extremes and quantiles over the members that did not fail; raises FileError."""
        path = self.folder / STATISTICS
        self.manifest.require(STATISTICS)
        # h5py and the libraries above it have errors of all kinds
        with rephrased(f"The file {path} cannot be read as netCDF", Exception, then=DAMAGED):
            if readable(path):
                found = xarray.load_dataset(path.absolute(), engine="h5netcdf")
                if all("statistic" in found[name].dims for name in found.data_vars) and "statistic" in found.coords:
                    return found
        raise FileError(f"The file {path} does not hold the statistics of a sweep: {DAMAGED}.")

    @property
    def failures(self) -> dict[str, int]:
        """How many members failed, by cause."""
        return dict(self.summary["failures"])

    def __repr__(self) -> str:
        told = ", ".join(f"{count:,} {cause}" for cause, count in self.failures.items()) or "none failed"
        return f"<Sweep of {self.summary['members']:,} members in {self.folder}: {told}>"


def load_sweep(folder: Path | str) -> SweepResults:
    """The finished sweep of `co.sweep` or `coadjoint sweep`.

    folder: its path. Raises FileError if there is none.
    """
    path = Path(folder)
    require_folder(path)
    held = held_manifest(path)
    if held is None or not isinstance(held.facts.get("sweep"), dict):
        raise FileError(f"The folder {path} holds no sweep.")
    if not held.facts.get("complete"):
        raise FileError(f"The sweep in {path} has not finished: the same `coadjoint sweep` command continues it.")
    return SweepResults(held)


def _summary(manifest: Manifest) -> dict[str, object]:
    """The contents of summary.json; raises FileError if it is damaged, or not that of a sweep."""
    manifest.require(SUMMARY)
    path = manifest.folder / SUMMARY
    with rephrased(f"The file {path} cannot be read", OSError, ValueError, RecursionError):
        found = json.loads(text_of(path, LARGEST_SUMMARY))
    kinds = {str: _WORDS, (int, float): _NUMBERS, dict: ("failures", "warnings", "refusals", "versions")}
    lists = [found.get(name) for name in ("numbers", "figures")] if isinstance(found, dict) else [None]
    if not (
        all(isinstance(one, list) and all(isinstance(word, str) for word in one) for one in lists)
        and all(isinstance(found.get(name), kind) for kind, names in kinds.items() for name in names)
        and all(type(count) is int for name in ("failures", "warnings") for count in found[name].values())
    ):
        raise FileError(f"The file {path} is not the summary of a sweep: {DAMAGED}.")
    return found


_WORDS = ("system", "method", "sampling", "card")
_NUMBERS = ("members", "tasks", "members_of_a_task", "finished", "events", "dt", "steps", "seconds", "task_seconds")


def gathered(folder: Path, tasks: int, quantiles: Sequence[float], dims: Table) -> tuple[xarray.Dataset, dict]:
    """The statistics of all shards merged in their order, and the outcomes of the members."""
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
    table: Table = {}
    for name, parts in sketches.items():
        table[name] = (("statistic", *dims[name.partition("_")[2]]), merged(parts).table(quantiles))
    for name, nodes in courses.items():
        rows = np.stack([merged(parts).table(quantiles) for parts in nodes], axis=1)
        table[name] = (("statistic", "time", *dims[name]), rows)
    coordinates: Table = {"statistic": labels}
    if courses:
        coordinates["time"] = times
    made = xarray.Dataset(table, coords=coordinates)
    made = made.assign_coords(angle=["yaw", "pitch", "roll"]) if "angle" in made.dims else made
    told = {"failures": failures, "finished": codes["0"], "warnings": dict(warnings), "refusals": refusals, **total}
    return made, told


def facts(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The summary in lines: name and text."""
    failures = ", ".join(f"{count:,} {cause}" for cause, count in summary["failures"].items()) or "none"
    return [
        ("sweep", f"{summary['members']:,} × {summary['system']}, {summary['method']}, dt = {summary['dt']:g} s"),
        ("numbers", f"{', '.join(summary['numbers'])} ({summary['sampling']})"),
        ("tasks", f"{summary['tasks']:,} of {summary['members_of_a_task']:,} members"),
        ("failed", failures),
        ("events", f"{summary['events']:,}"),
        ("time", f"{summary['seconds']:.3g} s, of all tasks {summary['task_seconds']:.3g} s"),
    ]


def meant(name: str, attributes: dict[str, object]) -> Table:
    """The attributes of `final_q` and the like, from those of `q`."""
    kind, _, of = name.partition("_")
    return (
        {**attributes, "long_name": f"{attributes.get('long_name', of)}, {KINDS[kind]}"}
        if kind in KINDS
        else attributes
    )


class Verified(LocalStore):
    """Files of the folder `place`, as the manifest lists them; raises FileError that names a file that differs.

    complete: if true, every chunk was written; otherwise a chunk that the manifest lacks held only its fill value.
    """

    def __init__(self, root: Path | str, *, manifest: Manifest, place: str, complete: bool = True, **options: Any):
        super().__init__(root, **options)
        self.manifest, self.place, self.complete = manifest, place, complete

    def with_read_only(self, read_only: bool = False) -> Verified:
        own = {"manifest": self.manifest, "place": self.place, "complete": self.complete}
        return Verified(self.root, read_only=read_only, **own)

    async def get(self, key: str, *rest: Any, **options: Any) -> Any:
        return self._checked(key, await super().get(key, *rest, **options)) if self._is_there(key) else None

    def get_sync(self, key: str, *rest: Any, **options: Any) -> Any:
        return self._checked(key, super().get_sync(key, *rest, **options)) if self._is_there(key) else None

    def _is_there(self, key: str) -> bool:
        """Whether the manifest has a file, which then must be a file of its size: pipes and devices are not read."""
        name = f"{self.place}/{key}"
        if name in self.manifest.files:
            self.manifest.require_size(name)
            return True
        if (self.root / key).exists() or (self.complete and "/c." in key):
            raise FileError(f"The file {self.root / key} is not among those of the manifest: {DAMAGED}.")
        return False

    def _checked(self, key: str, found: Any) -> Any:
        data = None if found is None else found.to_bytes()
        self.manifest.require(f"{self.place}/{key}", data)
        if data is not None and "/c." in key and not sums_up(data):
            raise FileError(f"The file {self.root / key} does not have the checksum with which it ends: {DAMAGED}.")
        return found


def verified(manifest: Manifest, place: str, complete: bool = True) -> Verified:
    """The store of the folder `place`; raises FileError unless all of it is plain, so that no other codec is run."""
    arrays(manifest, place)
    return Verified(manifest.folder / place, manifest=manifest, place=place, complete=complete, read_only=True)
