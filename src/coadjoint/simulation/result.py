"""Results of runs, and the common base of runs and files of runs: a dataset, plots, and a place on disk."""

from __future__ import annotations

import contextlib
import os
import secrets
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint import checks, disk
from coadjoint.arrays import PyTree
from coadjoint.csv_tables import csv_text
from coadjoint.errors import ArgumentError, must_give, rephrased
from coadjoint.extensions import Registry, import_string
from coadjoint.labelled import Labelled
from coadjoint.mechanics.energy_scale import ENERGIES, largest_kinetic, near_zero
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants
from coadjoint.plotting.plots import Plots
from coadjoint.sealed import seal
from coadjoint.simulation import netcdf
from coadjoint.simulation.accuracy.verdict import Accuracy
from coadjoint.simulation.certificate_forms import Certificate
from coadjoint.simulation.deferred import Deferred
from coadjoint.simulation.plan import Extrema, Plan
from coadjoint.texts import Table

if TYPE_CHECKING:
    import pandas
    import xarray

    from coadjoint.labelled import AnyDataset


NETCDF = ("", ".nc", ".nc4", ".netcdf")
"""Endings of names that mean netCDF."""


class AbsentError(ArgumentError, AttributeError):
    """A name that a run does not have, so that `hasattr` is False."""


class Recording:
    """Anything with a `dataset`."""

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset with dimensions ([member,] time, …)."""
        found = self._arrays.to_xarray()
        self.__dict__.pop("_arrays", None)
        return found

    @cached_property
    def _arrays(self) -> Labelled:
        """What `dataset` holds, without xarray."""
        must_give(self, "_arrays")

    @property
    def _labelled(self) -> AnyDataset:
        """The records as they are held now: the dataset once it has been read, as it may have been changed."""
        read = self.__dict__.get("dataset")
        return self._arrays if read is None else read

    @property
    def certificate(self) -> Certificate:
        """The certificate, in a short and in a long form."""
        must_give(self, "certificate")

    def __str__(self) -> str:
        return str(self.certificate)

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """The certificate, for notebooks."""
        printer.text("…" if cycle else str(self))

    def _repr_html_(self) -> str:
        """The certificate, and the moving bodies if there are any, for notebooks."""
        from coadjoint.plotting.player import cell

        return cell(self.certificate, self)

    if not TYPE_CHECKING:  # type checkers find wrong names by themselves

        def __getattr__(self, name: str) -> object:
            """Raises AttributeError, with the nearest name."""
            if hasattr(type(self), name):
                return object.__getattribute__(self, name)  # a property that failed: its own error again
            kind = type(self).__name__
            if name.startswith("_"):
                raise AttributeError(f"{kind!r} object has no attribute {name!r}")
            raise AbsentError(self._absent(name, [known for known in dir(type(self)) if not known.startswith("_")]))

    def _absent(self, name: str, known: list[str]) -> str:
        """The sentence for a name that is not there."""
        return checks.unknown(f"`{name}`", f"`{type(self).__name__}`", name, known)

    def to_dataframe(self) -> pandas.DataFrame:
        """The variables over time as a table of pandas: a row for each node and a column for each number.

            run.to_dataframe()["mu_2"].plot()

        The index is `time`, s, of an ensemble (`member`, `time`); columns are named as in CSV: energy, mu_0, R_0_2.
        """
        import pandas

        leading = [name for name in ("member", "time") if name in self.dataset.dims]
        return pandas.DataFrame(table_columns(self.dataset)).set_index(leading)

    @property
    def plot(self) -> Plots:
        """Figures: `run.plot.energy()`, `.kelvin_noether()`, `.trajectory()`, `.attitude()`."""
        return Plots(self._labelled)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False, **options: Any) -> Path:
        """Write the dataset as netCDF, or in the format of the name's ending, atomically.

        A name that ends in .csv writes the log of a vehicle, with the option `axes` (`coadjoint_vehicles.logs`), or for
        another system one line per node and one column per number; a name that ends in .nc, or without an ending,
        writes netCDF.
        Raises FileError rather than replace a file, ArgumentError for another ending and for options that the format
        does not have.
        """
        target = run_path(path)
        disk.require_new(target, overwrite)
        disk.require_home(target)
        text = self._text(target.suffix.lower(), options)
        temporary = beside(target)
        try:
            with rephrased(f"The run could not be written to {target}"):
                os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
                if text is not None:
                    temporary.write_bytes(text if isinstance(text, bytes) else text.encode())
                else:
                    complete = self._labelled.assign(self._last_record())
                    netcdf.write(complete, temporary)
                    _require_equal(temporary, complete)
                    seal(temporary)
                disk.settle(temporary)
                disk.move(temporary, target)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
        return target

    def _last_record(self) -> Table:
        """Variables of a netCDF file from which a run can be continued."""
        return {}

    def _text(self, ending: str, options: Table) -> str | bytes | None:
        """The file in a format that a package above adds; None if it is netCDF."""
        if ending == ".csv" and not {"a_down", "a_north"} <= set(self._labelled) and not options:
            return csv_table(self._labelled)
        if ending not in FORMATS:
            if ending not in NETCDF:
                known = ", ".join([".nc", *FORMATS])
                raise ArgumentError(f"A run is written to a file that ends in {known}, but the name ends in {ending}.")
            if options:
                raise ArgumentError(f"A file of netCDF has no option `{next(iter(options))}`: leave it out.")
            return None
        write = import_string(FORMATS[ending])
        known = [name for name in signature(write).parameters if name != "dataset"]
        for name in options:
            if name not in known:
                raise ArgumentError(f"A file in {ending} has no option `{name}`; it has: {', '.join(known) or 'none'}.")
        own = FORMATS[ending].startswith(OWN)  # these take labelled arrays too
        return write(self._labelled if own else self.dataset, **options)


def _require_equal(file: Path, complete: AnyDataset) -> None:
    """Raise OSError unless the values in a file are bitwise equal to those of a dataset."""
    import h5py

    with h5py.File(file, "r") as opened:
        for name, given in complete.variables.items():
            found: Any = opened[str(name)]
            if found.dtype.kind in "OSU":
                continue
            if found[()].tobytes() != given.values.astype(found.dtype).tobytes():
                raise OSError(f"the values of `{name}` in the file are not those that were written")


def run_path(given: Any) -> Path:
    fits = isinstance(given, (str, os.PathLike)) and str(given) and ("\x00" not in str(given))
    checks.expect(fits, given, "path", 'the name of a file, such as "run.nc"')
    return Path(given)


def beside(target: Path) -> Path:
    """A hidden, unique name next to `target`; the system sets the permissions of a file made there."""
    return target.parent / f".{target.name}.{secrets.token_hex(4)}"


OWN = "coadjoint.", "coadjoint_vehicles."
"""The packages of the library."""

FORMATS: Registry[str] = Registry("FORMATS")
"""By ending, such as ".csv": "module:function", (dataset, **options) → the text of the file."""


LAST_RECORD = ("last_record", "run_parameters")
"""Variables of a netCDF file from which a run can be continued; a dataset in memory lacks them."""


def csv_table(dataset: AnyDataset) -> str:
    """The table of a dataset as CSV: one line per node. Numbers have all their digits; NaN is an empty field."""
    return csv_text(table_columns(dataset), repr)


def table_columns(dataset: AnyDataset) -> dict[str, np.ndarray]:
    """The variables over `time` of a run, or over (`member`, `time`) of an ensemble, one row per node.

    Columns (rows,) are `time` and the name of every variable, followed by its indices if it is an array: mu_0, g_0_2.
    """
    leading = [name for name in ("member", "time") if name in dataset.dims]
    count = int(np.prod([dataset.sizes[name] for name in leading]))
    grid = np.meshgrid(*(dataset[name].values for name in leading), indexing="ij")
    columns = {name: np.ravel(values) for name, values in zip(leading, grid, strict=True)}
    for name, variable in dataset.data_vars.items():
        if not set(leading) <= set(variable.dims):
            continue
        values = variable.transpose(*leading, ...).values
        rows = values.reshape(count, -1)
        for column, index in enumerate(np.ndindex(*values.shape[len(leading) :])):
            columns["_".join([str(name), *map(str, index)])] = rows[:, column]
    return columns


@dataclass(repr=False, eq=False)
class Result(Recording):
    """A run, or an ensemble, whose arrays have a first axis of members.

    ended: the records at the events that ended members, by their index. taken: how to read the outputs.
    """

    system: System
    method: Method
    start: State
    plan: Plan
    position: PyTree
    memory: PyTree
    warnings: list[str]
    set_up_seconds: float = 0.0
    crossed: dict[str, list[PyTree]] = field(default_factory=dict)
    accuracy: Accuracy | None = None
    ended: dict[int, State] = field(default_factory=dict)
    taken: tuple[Callable[[Any], Any], ...] = ()
    _found = ({}, 0, {})  # extrema, count of nodes, and what `_once` keeps of them; not a field

    @cached_property
    def outputs(self) -> tuple[xarray.Dataset | None, ...]:
        """The dataset of each of the `outputs` that were ordered; None of those that went to a function."""
        return tuple(read(self) for read in self.taken)

    @abstractmethod
    def summary(self) -> Table:
        """The certificate as plain numbers."""

    @property
    def members(self) -> int | None:
        """How many members an ensemble has; None of a single run."""
        return self.plan.members

    @property
    def title(self) -> str:
        """The system and the method as text."""
        many = "" if self.members is None else f"{self.members:,} × "
        return f"{many}{self.system.name}, {self.method.title}"

    @property
    def one(self) -> tuple[Constants, State]:
        """The constants of the first member and its state, for which the equations are traced."""
        state = self.position.state
        return self.plan.constants_of(), state if self.members is None else jax.tree.map(lambda leaf: leaf[0], state)

    @property
    def seconds(self) -> float:
        """The time spent in the kernel, s; compiling and set-up are in `set_up_seconds`."""
        return self.position.seconds

    @property
    def good_steps(self) -> int:
        """The number of steps done, by all members together."""
        return int(np.sum(self.position.steps if self.members is None else self.position.steps_done))

    @property
    def event(self) -> PyTree:
        """When `until` crossed zero and ended the run, s; None if it did not, or NaN of a member, (members,)."""
        return self.position.event if self.plan.until else None

    @property
    def count(self) -> int:
        """The number of saved nodes."""
        return sum(len(steps) for steps in self.memory.steps)

    @cached_property
    def steps_saved(self) -> np.ndarray:
        """The step index of every saved node, (nodes,)."""
        return np.concatenate([np.zeros(0, dtype=int), *self.memory.steps])

    @cached_property
    def records(self) -> State:
        """The saved states, every leaf with axes ([member,] node, …)."""
        self._require_records()
        if self.members is None:
            return jax.tree.map(np.asarray, self._deferred_records)
        return jax.tree.map(self._joined, *self.memory.records)

    @cached_property
    def _deferred_records(self) -> State:
        """`records` of a single run, each leaf joined when it is first read."""
        self._require_records()
        return jax.tree.map(self._joined_later, *self.memory.records)

    def _require_records(self) -> None:
        if not self.memory.records:
            raise ArgumentError("This run holds no records: its first step failed.")

    def internal_states(self) -> list[PyTree]:
        """The internal states at the saved nodes, in consecutive stretches with leading axes (nodes, [members,] …)."""
        found = [part.internal for part in getattr(self.memory, "records", [])] or getattr(self.memory, "internal", [])
        return [part for part in found if part is not None]

    @cached_property
    def monitors(self) -> dict[str, np.ndarray]:
        """Every monitored scalar, of shape ([members,] nodes, …) each."""
        if self.members is None:
            return {name: rows.values for name, rows in self._deferred_monitors.items()}
        return {name: self._joined(*parts) for name, parts in self._monitored().items()}

    @cached_property
    def _deferred_monitors(self) -> dict[str, Deferred]:
        """`monitors` of a single run, each joined when it is first read."""
        return {name: self._joined_later(*parts) for name, parts in self._monitored().items()}

    def _monitored(self) -> dict[str, list[np.ndarray]]:
        """The stretches of every monitor, with axes (node, [member,] …)."""
        rows: list[Mapping[str, np.ndarray]] = self.memory.monitors
        return {name: [part[name] for part in rows] for name in (rows[0] if rows else {})}

    def rows_of(self, names: Sequence[str], members: slice = slice(None)) -> dict[str, np.ndarray]:
        """Some monitors at the saved nodes, of shape ([members,] nodes, …) each, of some members; none is kept."""
        return {name: self.monitors[name][members] for name in names}

    def node_times(self) -> np.ndarray:
        """The times of the saved nodes, s, (nodes,); for a single run the times of its records."""
        if self.members is None:
            return np.asarray(self.records.t)
        return self.plan.h * self.steps_saved + np.ravel(self.start.t)[0]

    def _joined(self, *parts: np.ndarray) -> np.ndarray:
        """Stretches with axes (node, [member,] …) as one array with axes ([member,] node, …)."""
        if self.members is None:
            return np.concatenate(parts)
        return np.concatenate([np.swapaxes(part, 0, 1) for part in parts], axis=1)

    def _joined_later(self, *parts: np.ndarray) -> Deferred:
        """Stretches of a single run as one array, when it is first read."""
        shape = (sum(map(len, parts)), *parts[0].shape[1:])
        return Deferred(shape, parts[0].dtype, partial(self._joined, *parts))

    @property
    def extrema(self) -> Extrema:
        """(minimum, maximum) of monitors and certificates over every step, of the shape of a row of `monitors`."""
        return self.position.extrema

    @property
    def ends(self) -> Extrema:
        """Every monitored scalar at the first and at the last record, of the shape of a row of `monitors`."""
        return self._once(
            "ends", lambda: {name: (parts[0][0], parts[-1][-1]) for name, parts in self._monitored().items()}
        )

    def _require_monitored(self, name: str) -> None:
        checks.known(name, self.extrema, "monitored quantity", f"This {type(self).__name__.lower()}")

    def _kinetic(self) -> np.ndarray:
        """The largest ½|⟨μ, ξ⟩ + ⟨π, ν⟩| at the saved nodes, one number or (members,)."""
        return largest_kinetic(*self.memory.records)

    def _once(self, what: str, find: Callable[[], PyTree]) -> PyTree:
        """find(), kept under a name until the run goes on."""
        extrema, count, found = self._found
        if extrema is not self.extrema or count != self.count:
            found = {}
            self._found = self.extrema, self.count, found
        if what not in found:
            found[what] = find()
        return found[what]

    def _size_and_change(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """The scale of a monitored X and max_k |X_k − X₀|, one number or (members,) each.

        The scale is |X₀|, and of energies the largest kinetic energy if E₀ is near zero.
        """
        low, high, first = self._bounds(name)
        size = np.linalg.norm(first, axis=-1)
        change = np.linalg.norm(_widest(low, high, first), axis=None if self.members is None else 1)
        if name in ENERGIES:
            motion = self._once("largest kinetic energy", self._kinetic)
            size = np.where(near_zero(size, motion), motion, size)
        return size, change

    def sizes(self, name: str) -> np.ndarray:
        """The scale to which changes of a monitored X are relative, one number or (members,); 0 if they are larger."""
        size, change = self._once(f"size and change of {name}", partial(self._size_and_change, name))
        return np.where(size > change, size, 0.0)

    def relative_changes(self, name: str) -> np.ndarray:
        """max_k |X_k − X₀| / |X₀| of a monitored X, one number or (members,), over good steps; of energies see `size`.

        It is absolute where that passes 1.
        """
        size, change = self._once(f"size and change of {name}", partial(self._size_and_change, name))
        return change / np.where(size > change, size, 1.0)

    def _bounds(self, name: str) -> list[np.ndarray]:
        """The least, the largest and the first value of a monitored X, ([members,] components)."""
        self._require_monitored(name)
        if name not in self.ends:
            raise ArgumentError(f"`{name}` is a residual: its largest value is run.largest({name!r}).")
        lead = () if self.members is None else (self.members,)
        return [np.reshape(x, (*lead, -1)) for x in (*self.extrema[name], self.ends[name][0])]


def _widest(low: np.ndarray, high: np.ndarray, first: np.ndarray) -> np.ndarray:
    """The largest change of each component since the start."""
    return np.maximum(np.abs(high - first), np.abs(first - low))
