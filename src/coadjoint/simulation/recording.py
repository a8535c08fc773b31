"""The common base of runs and files of runs: a dataset, plots, and a place on disk."""

from __future__ import annotations

import contextlib
import os
import secrets
from functools import cached_property
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import disk
from coadjoint.csv_tables import csv_text
from coadjoint.errors import ArgumentError, FileError, shown
from coadjoint.extensions import Registry, import_string
from coadjoint.plotting.plots import Plots
from coadjoint.sealed import seal

if TYPE_CHECKING:
    import xarray


NETCDF = ("", ".nc", ".nc4", ".netcdf")
"""Endings of names that mean netCDF."""


class Recording:
    """Anything with a `dataset`."""

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset."""
        raise NotImplementedError

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """The certificate, for notebooks."""
        printer.text("…" if cycle else str(self))

    def _repr_html_(self) -> str:
        """The certificate, and the moving bodies if there are any, for notebooks."""
        from coadjoint.plotting.player import cell

        return cell(str(self), self)

    @property
    def plot(self) -> Plots:
        """Figures: `run.plot.energy()`, `.kelvin_noether()`, `.trajectory()`, `.attitude()`."""
        return Plots(self.dataset)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False, **options: Any) -> Path:
        """Write the dataset as netCDF, or in the format of the name's ending, atomically.

        A name that ends in .csv writes the log of a vehicle, with the option `axes` (`coadjoint_vehicles.logs`), or for
        another system one line per node and one column per number; a name that ends in .nc, or without an ending,
        writes netCDF.
        Raises FileError rather than replace a file, ArgumentError for another ending and for options that the format
        does not have.
        """
        target = run_path(path)
        if target.exists() and not overwrite:
            raise FileError(f"The file {target} exists already: choose another name or pass overwrite=True.")
        if not target.parent.is_dir():
            raise FileError(f"The folder {target.parent} does not exist: make it first.")
        text = self._text(target.suffix.lower(), options)
        temporary = beside(target)
        try:
            os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
            if text is not None:
                temporary.write_bytes(text if isinstance(text, bytes) else text.encode())
            else:
                whole = self.dataset.assign(self._last_record())
                whole.to_netcdf(temporary.absolute(), engine="h5netcdf")
                _require_equal(temporary, whole)
                seal(temporary)
            disk.settle(temporary)
            disk.move(temporary, target)
        except OSError as error:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise FileError(f"The run could not be written to {target}: {error.strerror or error}.") from error
        return target

    def _last_record(self) -> dict[str, Any]:
        """Variables of a netCDF file from which a run can be continued."""
        return {}

    def _text(self, ending: str, options: dict[str, Any]) -> str | bytes | None:
        """The file in a format that a package above adds; None if it is netCDF."""
        if ending == ".csv" and not {"a_down", "a_north"} <= set(self.dataset) and not options:
            return csv_table(self.dataset)
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
        return write(self.dataset, **options)


def _require_equal(file: Path, whole: xarray.Dataset) -> None:
    """Raise OSError unless the values in a file are bitwise equal to those of a dataset."""
    import xarray

    with xarray.open_dataset(file.absolute(), engine="h5netcdf", decode_cf=False) as opened:
        for name, given in whole.variables.items():
            found = opened[name].values
            if found.dtype.kind not in "OSU" and found.tobytes() != given.values.astype(found.dtype).tobytes():
                raise OSError(f"what was read again of `{name}` is not what was written")


def run_path(given: Any) -> Path:
    if not isinstance(given, (str, os.PathLike)) or not str(given) or "\0" in str(given):
        raise ArgumentError(f'Argument `path` must be the name of a file, such as "run.nc", but is {shown(given)}.')
    return Path(given)


def beside(target: Path) -> Path:
    """A hidden, unique name next to `target`; the system sets the permissions of a file made there."""
    return target.parent / f".{target.name}.{secrets.token_hex(4)}"


FORMATS: Registry[str] = Registry("FORMATS")
"""By ending, such as ".csv": "module:function", (dataset, **options) → the text of the file."""


LAST_RECORD = ("last_record", "run_parameters")
"""Variables of a netCDF file from which a run can be continued; a dataset in memory lacks them."""


def csv_table(dataset: xarray.Dataset) -> str:
    """The variables over `time` of a run, or over (`member`, `time`) of an ensemble, one line per node.

    Columns are `time` and the name of every variable, followed by its indices if it is an array: mu_0, g_0_2.
    Numbers have all their digits; NaN is an empty field.
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
    return csv_text(columns, repr)
