"""Folders of runs: made in one move, and never over anything else."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

from coadjoint import disk
from coadjoint.arrays import PyTree
from coadjoint.errors import FileError, rephrased
from coadjoint.manifest import MANIFEST, Manifest
from coadjoint.simulation.configuration import packed
from coadjoint.simulation.lock import LOCK, Lock
from coadjoint.simulation.result import Result
from coadjoint.simulation.store import Store
from coadjoint.simulation.store_reader import CHECKPOINTS, CONFIGURATION, require_run


def create(path: Path, run: Result, facts: Mapping[str, object], configuration: tuple[PyTree, PyTree]) -> Store:
    """A new folder for a run that has not begun, complete with its first checkpoint; it appears in one move.

    Until then it has a hidden name; files that a killed process left under this name are replaced.
    """
    made = disk.partial(path)
    lock: Lock | None = None
    try:
        lock = _reserved(made, path)
        _clear(made)
        store = Store(run, Manifest(made, {"kind": "records", **facts}), lock)
        store.put(CONFIGURATION, packed(*configuration))
        store.lay_out(*run.one)
        store.write_checkpoint(run.position)
        disk.move(made, path)
        lock.folder = path
    except OSError as error:
        if lock is None and isinstance(error, FileError):
            raise
        if lock is not None and lock.held:
            _give_up(made, lock)
        raise FileError(f"The folder {path} cannot be made: {error.strerror or error}.") from error
    except BaseException:
        if lock is not None:
            _give_up(made, lock)
        raise
    store.move_to(path)
    return store


def _reserved(made: Path, path: Path) -> Lock:
    """The lock of the folder that is to become `path`, and has the hidden name `made`."""
    while True:
        disk.make(made)
        try:
            return Lock(made, of=path)
        except FileNotFoundError:  # A process that found `path` finished has just swept it away.
            continue


def sweep_beside(path: Path) -> None:
    """Remove the files next to a run left by a process that was killed while it began the same run concurrently."""
    made = disk.partial(path)
    with contextlib.suppress(OSError):
        if made.is_dir():
            _give_up(made, Lock(made))


def _clear(made: Path) -> None:
    for left in made.iterdir():
        if left.name != LOCK:
            disk.remove(left)


def _give_up(made: Path, lock: Lock) -> None:
    """Remove the folder of a run that did not begin; the lock goes last, so that no process begins a run in it."""
    with contextlib.suppress(OSError):
        _clear(made)
    lock.release()
    with contextlib.suppress(OSError):  # It is another process's already.
        made.rmdir()


def tidy(folder: Path) -> None:
    """Remove temporary files from the folder of a finished run whose process was then killed; raises OSError."""
    if (folder / LOCK).exists() or len(list(folder.glob(CHECKPOINTS))) > 1:
        lock, manifest = Lock(folder), Manifest.read(folder)
        for path in folder.glob(CHECKPOINTS):
            if path.name not in manifest.files:
                disk.remove(path)
        lock.release()


def holds_run(path: Path) -> bool:
    """Whether a folder holds a run already; raises FileError if it holds something else, or cannot be made."""
    with rephrased(f"The folder {path} cannot be looked at"):
        other = path.exists() and (not path.is_dir() or any(path.iterdir()))
        # After that, for another process may have moved a run to this place meanwhile.
        held = (path / MANIFEST).exists() or (path / CONFIGURATION).exists()
        home = path.parent.is_dir()
    if held:
        require_run(path)
        return True
    if other:
        raise FileError(f"Argument `store` must name a new or empty folder, but {path} holds something else.")
    if not home:
        disk.require_home(path)
    return False
