"""Runs that are read from files and folders."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from coadjoint import checks
from coadjoint.disk import require_file
from coadjoint.errors import FileError, printable
from coadjoint.manifest import BEGINNING, MANIFEST, Manifest
from coadjoint.sealed import readable
from coadjoint.simulation.accuracy.verdict import Accuracy, accuracy_from
from coadjoint.simulation.certificate_forms import Certificate
from coadjoint.simulation.result import LAST_RECORD, Recording, run_path
from coadjoint.simulation.run import Run
from coadjoint.texts import Table

if TYPE_CHECKING:
    import xarray

    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System


HDF5 = b"\x89HDF\r\n\x1a\n"
"""The first bytes of a netCDF file as `save` writes it."""


READERS = {
    ".csv": "numpy.genfromtxt and pandas.read_csv read a table, `read_log` the log of a vehicle",
    ".toml": "`coadjoint run` runs a run file or a mission, and writes a netCDF file",
    ".zip": "co.load_stepper loads what stepper.save wrote",
}
"""The readers of files that do not hold runs, by their endings."""


class SavedRun(Recording):
    """A run that was read from a file; `print` it for the certificate."""

    def __init__(self, dataset: xarray.Dataset, system: System | None = None):
        last = [name for name in LAST_RECORD if name in dataset]
        self._written, self._system = {name: dataset[name] for name in last}, system
        self.__dict__["dataset"] = dataset.drop_vars(last)

    def _last_record(self) -> Table:
        return self._written

    @cached_property
    def final(self) -> State:
        """The exact last record, a State from which a run can be continued. Needs the system: co.load(path, system).

        Raises ArgumentError without a system or with a different one, FileError if the file lacks the record.
        """
        from coadjoint.simulation.restart import read

        return read(self._written, self.dataset, self._system)

    @property
    def event(self) -> float | None:
        """When `until` crossed zero and ended the run, s; None if it did not."""
        found = self.dataset.attrs.get("event")
        return None if found is None else float(found)

    @property
    def dt(self) -> float:
        """The step size h, s."""
        return float(self.dataset.attrs["dt"])

    @property
    def accuracy(self) -> Accuracy | None:
        """How well the steps that were judged resolve the motion, without the errors of each; None if none was."""
        return accuracy_from(self.dataset.attrs)

    def _absent(self, name: str, known: list[str]) -> str:
        if hasattr(Run, name) or name in Run.__dataclass_fields__:
            return (
                f"`{name}` is not in the file of a run, which holds {', '.join(known)}: take it from the run itself, "
                "and save what is wanted of it."
            )
        return super()._absent(name, known)

    @property
    def certificate(self) -> Certificate:
        """The certificate in the file: `print` it for five lines, `print(run.certificate.long())` for all of them."""
        none = "a run without a certificate"
        found = Certificate.held(self.dataset.attrs) or Certificate(none, none)
        return Certificate(printable(found.short), printable(found.complete))

    def __repr__(self) -> str:
        hint = "; unresolved: print it for the reason" if self.dataset.attrs.get("unresolved") else ""
        return printable(f"<SavedRun of {self.dataset.attrs.get('system', 'a system')}{hint}>")


def load(path: str | os.PathLike[str], system: System | None = None) -> SavedRun:
    """The run in a netCDF file written by `save`, or in a folder to which a run streams, up to its current position.

        run = co.load("top.nc")
        print(run); run.dataset.energy; run.plot.energy()

        more = co.simulate(top, co.load("top.nc", top).final, dt=0.01, duration=10.0)

    path: the file, or the folder that was given as `store`. system: that of the run, by default None; needed for
    `final` alone. Returns a `SavedRun` with `dataset`, `final`, `plot` and `save`.

    Raises FileError if the file does not exist, or if this library did not write it; ArgumentError if `system` is not a
    co.System.
    """
    if system is not None:
        from coadjoint.mechanics.system import System

        checks.expect(isinstance(system, System), system, "system", "a co.System")

    source = run_path(path)
    if os.path.isdir(source):
        from coadjoint.simulation.stored_dataset import saved_dataset

        return SavedRun(saved_dataset(source.absolute()).to_xarray(), system)
    import xarray

    require_file(source)
    _require_listed(source)
    try:
        if not _begins(source, HDF5) or not readable(source):
            raise _unreadable(source)
        with xarray.open_dataset(source.absolute(), engine="h5netcdf") as opened:
            found = opened.load()
    except FileError:
        raise
    except Exception as error:  # h5py and the libraries above it raise errors of all kinds for damaged files
        raise _unreadable(source) from error
    if "time" not in found or "card" not in found.attrs:
        raise FileError(f"The file {source} was not written by coadjoint: it holds no run.")
    return SavedRun(found, system)


def _require_listed(source: Path) -> None:
    """Raise FileError if the file differs from the bytes that a manifest in its folder lists."""
    listing = source.parent / MANIFEST
    if not listing.is_file() or not _begins(listing, BEGINNING):  # of another program
        return
    manifest = Manifest.read(source.parent)
    if source.name in manifest.files:
        manifest.require(source.name)


def _unreadable(source: Path) -> FileError:
    """The error for a file that cannot be opened as netCDF: it names the kind of file and its reader."""
    try:
        hdf5, zipped = _begins(source, HDF5), _begins(source, b"PK")
    except OSError as refusal:
        return FileError(f"The file {source} cannot be read: {refusal.strerror or refusal}.")
    if hdf5:
        return FileError(
            f"The file {source} cannot be read as netCDF: it is damaged, not whole, or still being written."
        )
    reader = READERS.get(".zip" if zipped else source.suffix.lower())
    return FileError(
        f'The file {source} is not a netCDF file of a run, such as run.save("run.nc") writes, nor the folder of a '
        f"streamed run{f': {reader}' if reader else ''}."
    )


def _begins(source: Path, word: bytes) -> bool:
    with source.open("rb") as opened:
        return opened.read(len(word)) == word
