"""What a run and a file of a run have in common: a dataset, plots, and a place on disk."""

from __future__ import annotations

import contextlib
import os
import secrets
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from coadjoint.errors import FileError
from coadjoint.plotting.plots import Plots

if TYPE_CHECKING:
    import xarray


class Recording:
    """Anything with a `dataset`."""

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset."""
        raise NotImplementedError

    @property
    def plot(self) -> Plots:
        """Figures: `run.plot.energy()`, `.kelvin_noether()`, `.trajectory()`, `.attitude()`."""
        return Plots(self.dataset)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False, axes: str = "NED/FRD") -> Path:
        """Write the dataset as netCDF, or a vehicle's log as CSV where the name ends in .csv, whole or not at all.

        A log has columns `time_s`, `north_m`, `east_m`, `depth_m`, …; `axes="ENU/FLU"` writes one of east, north, up.
        Raises FileError rather than replace a file, ArgumentError for a log of what is no vehicle.
        """
        target = Path(path)
        if target.exists() and not overwrite:
            raise FileError(f"The file {target} exists already: choose another name or pass overwrite=True.")
        if not target.parent.is_dir():
            raise FileError(f"The folder {target.parent} does not exist: make it first.")
        log = self._log_text(axes) if target.suffix.lower() == ".csv" else None
        temporary = beside(target)
        try:
            os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
            if log is not None:
                temporary.write_text(log, encoding="utf-8")
            else:
                self.dataset.to_netcdf(temporary, engine="h5netcdf")
            os.replace(temporary, target)
        except OSError as error:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise FileError(f"The run could not be written to {target}: {error.strerror or error}.") from error
        return target

    def _log_text(self, axes: str) -> str:
        from coadjoint.models.underwater.log.columns import columns
        from coadjoint.models.underwater.log.csv_file import csv_text
        from coadjoint.models.underwater.log.log import Log

        return csv_text(columns(Log(self.dataset), axes))


class SavedRun(Recording):
    """A run that was read from a file; `print` it for the certificate."""

    def __init__(self, dataset: xarray.Dataset):
        self.__dict__["dataset"] = dataset

    @property
    def event(self) -> float | None:
        """When `until` crossed zero and ended the run, s; None where it did not."""
        found = self.dataset.attrs.get("event")
        return None if found is None else float(found)

    def __str__(self) -> str:
        return str(self.dataset.attrs.get("card", "a run without a certificate"))

    def __repr__(self) -> str:
        return f"<SavedRun of {self.dataset.attrs.get('system', 'a system')}>"


def load(path: str | os.PathLike[str]) -> SavedRun:
    """The run in a netCDF file written by `save`, or in a folder to which a run streams, as far as it has come.

    Raises FileError where there is none.
    """
    import xarray

    source = Path(path)
    if source.is_dir():
        from coadjoint.simulation.reading import saved_dataset

        return SavedRun(saved_dataset(source.absolute()))
    if not source.is_file():
        raise FileError(f"There is no file {source}.")
    try:
        with xarray.open_dataset(source, engine="h5netcdf") as opened:
            found = opened.load()
    except (OSError, ValueError, KeyError) as error:
        raise FileError(f"The file {source} is not a netCDF file of a run: {error}.") from error
    if "time" not in found or "card" not in found.attrs:
        raise FileError(f"The file {source} was not written by coadjoint: it holds no run.")
    return SavedRun(found)


def beside(target: Path) -> Path:
    """A hidden name that nobody else has, next to `target`; the system gives what is made there its permissions."""
    return target.parent / f".{target.name}.{secrets.token_hex(4)}"
