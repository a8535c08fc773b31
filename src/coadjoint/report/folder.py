"""Output folders: one run each, never overwritten by another one, complete with a manifest.

A folder holds `run.toml` (the configuration), `inputs/` (copies of the files that it names, each in a separate folder),
the results, `summary.json` and `manifest.json`. The order of writes: run.toml, the copies, a manifest of these, which
claims the folder; the run; all results under a hidden name, synced to disk and then moved into place, the summary last;
the manifest of everything, which completes the folder; then temporary data of the run are removed.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from coadjoint import disk
from coadjoint.disk import require_folder
from coadjoint.errors import FileError, rephrased
from coadjoint.manifest import FORMAT, MANIFEST, Manifest
from coadjoint.report.companion_files import companions
from coadjoint.simulation.lock import Lock
from coadjoint.texts import file_text, read_table, text_of

RUN_FILE = "run.toml"
"""The configuration of the run that a folder holds."""
SUMMARY = "summary.json"
"""The certificate of the run."""
INPUTS = "inputs"
"""The folder of copies of the files that the run file names."""
UNFINISHED = "unfinished"
"""The folder of the records of a run until its results are written."""

_LOCK, _STAGE = ".lock", "results"


@dataclass
class Claim:
    """An output folder while this process holds it."""

    folder: Path
    manifest: Manifest
    lock: Lock
    made: list[str] = field(default_factory=list)
    """The files that `begin` put there."""

    @property
    def complete(self) -> bool:
        """Whether it already holds the results."""
        return bool(self.manifest.facts.get("complete"))

    def results(self, write: Callable[[Path], Any]) -> Any:
        """Put results into the folder by `write`, whose value is returned; the folder is then complete."""
        self._require_held()
        stage = disk.partial(self.folder / _STAGE)
        try:
            disk.sweep(self.folder)
            disk.make(stage)
            found = write(stage)
            names = sorted((path.name for path in stage.iterdir()), key=lambda name: (name == SUMMARY, name))
            for name in names:
                disk.settle(stage / name)
            self._require_held()
            for name in names:
                disk.move(stage / name, self.folder / name, named=False)
                self.manifest.enter(name)
            disk.settle(self.folder)
            self.manifest.facts["complete"] = True
            self.manifest.write()
            self.tidy()
        except FileError:
            raise
        except OSError as error:
            self._require_held()
            raise FileError(
                f"The results could not be written to {self.folder}: {error.strerror or error}; the same command again "
                "continues from there."
            ) from error
        return found

    def tidy(self) -> None:
        """Remove temporary data of the run, whose results exist."""
        disk.sweep(self.folder)
        disk.remove(self.folder / UNFINISHED)

    def begin(self, configuration: str, inputs: Mapping[str, Path]) -> None:
        """Put the configuration of the run into the folder, and a manifest of it."""
        self.manifest = Manifest(self.folder, {"kind": "results", "complete": False, "inputs": {}})
        disk.remove(self.folder / SUMMARY)
        self._put(RUN_FILE, configuration.encode())
        for number, (name, source) in enumerate(inputs.items(), 1):
            copy = f"{INPUTS}/{number}/{source.name}"
            self._put(copy, source.read_bytes())
            for other, path in companions(source).items():
                self._put(f"{INPUTS}/{number}/{other}", path.read_bytes())
            self.manifest.facts["inputs"][name] = copy
        self.manifest.write()

    def _put(self, name: str, data: bytes) -> None:
        if name != RUN_FILE or not (self.folder / name).exists():
            disk.make((self.folder / name).parent)
            disk.write(self.folder / name, [data])
            self.made.append(name)
        self.manifest.enter(name)

    def _require_held(self) -> None:
        if not self.lock.held:
            raise FileError(f"The folder {self.folder} was deleted or moved while the run wrote to it: begin it again.")


def require_free(folder: Path, configuration: str, inputs: Mapping[str, Path] | None = None) -> None:
    """Raise FileError if `folder` holds another run, with the difference.

    `configuration` is the text of the run's run.toml; two runs are the same if their TOML means the same, and their
    input files are the same.
    """
    try:
        os.stat(folder)
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise FileError(f"The folder {folder} cannot be looked at: {error.strerror or error}.") from error
    except ValueError as error:
        raise FileError(f"No folder can have the name {folder}, which holds a NUL: choose another one.") from error
    if not folder.is_dir():
        raise FileError(f"{folder} is a file, not a folder: choose another output folder with --out.")
    held = held_manifest(folder)
    if held is None and (folder / SUMMARY).exists() | any(folder.glob("*.nc")) | (folder / UNFINISHED).exists():
        raise FileError(
            f"The folder {folder} holds another run already, or one that an older version of coadjoint wrote (before "
            f"format {FORMAT}): choose another one with --out."
        )
    if held is not None:
        held.require(RUN_FILE)
    if (folder / RUN_FILE).exists():
        differing = _differing(folder / RUN_FILE, configuration)
        if not differing and held is not None and inputs is not None:
            differing = _differing_input(held, inputs)
        if differing:
            raise FileError(
                f"The folder {folder} holds another run already: {differing}; choose another one with --out."
            )


def held_manifest(folder: Path) -> Manifest | None:
    """The manifest of an output folder, None where it has none; raises FileError for that of another kind."""
    try:
        found = Manifest.read(folder)
    except FileNotFoundError:
        return None
    if found.facts["kind"] != "results":
        raise FileError(
            f"The folder {folder} holds a run that streamed to disk by co.simulate(store=…), not results: choose "
            "another one with --out."
        )
    inputs = found.facts.get("inputs")
    if not isinstance(inputs, dict) or not all(isinstance(copy, str) for copy in inputs.values()):
        raise FileError(f"The manifest of {folder} was not written by coadjoint: it has no list of inputs.")
    return found


def make(folder: Path) -> None:
    """Make a folder unless it exists; raises FileError if it cannot be made."""
    with rephrased(f"The folder {folder} cannot be made"):
        folder.mkdir(parents=True, exist_ok=True)


@contextmanager
def claimed(
    folder: Path, configuration: str, overwrite: bool, inputs: Mapping[str, Path] | None = None
) -> Iterator[Claim]:
    """`folder`, made and marked by its run.toml; left as it was found if the block raises before it wrote anything.

    If it holds this very run, it is returned unchanged, unless `overwrite` begins it again. Raises FileError as
    `require_free` does, and where the folder cannot be made or written to, or another process has it.
    """
    require_free(folder, configuration, inputs)
    made, claim, new = _missing(folder), None, False
    try:
        claim = _locked(folder)
        require_free(folder, configuration, inputs)
        disk.sweep(folder)
        new = not claim.manifest.files
        for place in () if new else {claim.manifest.path(name).parent for name in claim.manifest.files}:
            disk.sweep(place)
        if new or (overwrite and (claim.complete or (folder / UNFINISHED).exists())):
            if not new:
                _discard(claim)
            claim.begin(configuration, inputs or {})
        yield claim
    except BaseException as error:
        if claim is not None and new and not claim.complete and not (folder / UNFINISHED).exists():
            _withdraw(claim)
        if claim is not None:
            claim.lock.release()
        _clean(folder, made)
        if isinstance(error, OSError) and not isinstance(error, FileError):
            raise FileError(f"The folder {folder} cannot be written to: {error.strerror or error}.") from error
        raise
    claim.lock.release()


def kept_inputs(run_file: Path) -> dict[str, Path]:
    """The places of the files that the run file of an output folder names; none for another run file."""
    found = held_manifest(run_file.parent) if run_file.name == RUN_FILE else None
    return {} if found is None else {name: found.path(copy) for name, copy in found.facts["inputs"].items()}


@contextmanager
def held(folder: Path) -> Iterator[Claim]:
    """An output folder that holds any run; raises FileError where there is none."""
    require_folder(folder)
    found = held_manifest(folder)
    if found is None:
        require_free(folder, "")
        raise FileError(f"The folder {folder} holds no run.")
    with claimed(folder, file_text(found.path(RUN_FILE), "run file"), False) as claim:
        for name in (RUN_FILE, *(name for name in found.files if name.startswith(f"{INPUTS}/"))):
            found.require(name)
        yield claim


def require_writable(folder: Path, configuration: str, inputs: Mapping[str, Path] | None = None) -> None:
    """Raise FileError as `claimed` does; the folder is left as it was found."""
    with suppress(_Released), claimed(folder, configuration, False, inputs):
        raise _Released


class _Released(Exception):
    """Signals that a folder was claimed only as a test."""


def _locked(folder: Path) -> Claim:
    while True:
        disk.make(folder)
        try:
            lock = Lock(folder, _LOCK)
            break
        except FileNotFoundError:  # A process that began here at the same time has just removed its empty folder.
            continue
    try:
        return Claim(folder, held_manifest(folder) or Manifest(folder), lock)
    except BaseException:
        lock.release()
        raise


def _discard(claim: Claim) -> None:
    """Mark a folder as without results, and remove temporary data of its run."""
    claim.manifest.facts["complete"] = False
    claim.manifest.write()
    place = claim.folder / UNFINISHED
    if place.exists():
        lock = Lock(place)
        disk.remove(place)
        lock.release()


def _withdraw(claim: Claim) -> None:
    """Remove what `begin` put into the folder."""
    with suppress(OSError):
        for name in (MANIFEST, *claim.made):
            (claim.folder / name).unlink(missing_ok=True)
        for place in {(claim.folder / name).parent for name in claim.made} - {claim.folder}:
            place.rmdir()
        if (claim.folder / INPUTS).is_dir():
            (claim.folder / INPUTS).rmdir()
        disk.sweep(claim.folder)


def _differing(held: Path, configuration: str) -> str:
    """The first difference of two configurations, in words; empty where they mean the same."""
    try:
        there = dict(_leaves(read_table(text_of(held), held)))
    except (OSError, UnicodeDecodeError):
        return f"its {RUN_FILE} cannot be read"
    here = dict(_leaves(read_table(configuration, RUN_FILE)))
    for name in {**there, **here}:
        if name not in there:
            return f"{name} is given here and not there"
        if name not in here:
            return f"{name} is given there and not here"
        if there[name] != here[name]:
            return f"{name} is {there[name]!r} there and {here[name]!r} here"
    return ""


def _leaves(table: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value
    if not table and prefix:
        yield prefix.rstrip("."), {}


def _differing_input(held: Manifest, inputs: Mapping[str, Path]) -> str:
    for name, source in inputs.items():
        copy = PurePosixPath(held.facts["inputs"].get(name, "none"))
        for kept in [kept for kept in held.files if PurePosixPath(kept).is_relative_to(copy.parent)] or [str(copy)]:
            here = source if kept == str(copy) else source.parent / PurePosixPath(kept).relative_to(copy.parent)
            found = hashlib.sha256(here.read_bytes()).hexdigest() if here.is_file() else None
            if kept not in held.files or found != held.files[kept][1]:
                return f"the file {here.name} has other contents there"
    return ""


def _missing(folder: Path) -> list[Path]:
    """The folders that do not exist yet, the innermost first."""
    return [path for path in (folder, *folder.parents) if not path.exists()]


def _clean(folder: Path, made: list[Path]) -> None:
    """Remove empty folders that turned out to be unnecessary."""
    for path in made:
        with contextlib.suppress(OSError):
            os.rmdir(path)
