"""New folders for runs: complete, in one move, and never over anything else."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from coadjoint import disk
from coadjoint.errors import FileError
from coadjoint.manifest import MANIFEST, Manifest
from coadjoint.simulation.checkpoint import packed
from coadjoint.simulation.ensemble import Ensemble
from coadjoint.simulation.lock import LOCK, Lock
from coadjoint.simulation.reading import CHECKPOINTS, CONFIGURATION, require_run
from coadjoint.simulation.run import Run
from coadjoint.simulation.store import Store


def create(path: Path, run: Run | Ensemble, facts: Mapping[str, Any], configuration: tuple[Any, Any]) -> Store:
    """A new folder for a run that has not begun, complete with its first checkpoint; it appears in one move.

    Until then it has a hidden name; what a process that was killed left under this name is made anew.
    """
    made = disk.partial(path)
    lock: Lock | None = None
    try:
        disk.make(made)
        lock = Lock(made)
        for left in made.iterdir():
            if left.name != LOCK:
                disk.remove(left)
        store = Store(run, Manifest(made, {"kind": "records", **facts}), lock)
        store.put(CONFIGURATION, packed(*configuration))
        store.lay_out(*run.one)
        store.write_checkpoint(run.position)
        disk.move(made, path)
        lock.folder = path
    except OSError as error:
        if lock is not None and lock.held:
            shutil.rmtree(made, ignore_errors=True)
            lock.release()
        raise FileError(f"The folder {path} cannot be made: {error.strerror or error}.") from error
    except BaseException:
        if lock is not None:
            shutil.rmtree(made, ignore_errors=True)
            lock.release()
        raise
    store.move_to(path)
    return store


def tidy(folder: Path) -> None:
    """Remove what is left in the folder of a finished run whose process was killed then; raises OSError."""
    if (folder / LOCK).exists() or len(list(folder.glob(CHECKPOINTS))) > 1:
        lock, manifest = Lock(folder), Manifest.read(folder)
        for path in folder.glob(CHECKPOINTS):
            if path.name not in manifest.files:
                disk.remove(path)
        lock.release()


def holds_run(path: Path) -> bool:
    """Whether a folder holds a run already; raises FileError where it holds something else, or cannot be made."""
    try:
        held = (path / MANIFEST).exists() or (path / CONFIGURATION).exists()
        other = path.exists() and (not path.is_dir() or any(path.iterdir()))
        home = path.parent.is_dir()
    except OSError as error:
        raise FileError(f"The folder {path} cannot be looked at: {error.strerror or error}.") from error
    if held:
        require_run(path)
        return True
    if other:
        raise FileError(f"Argument `store` must name a new or empty folder, but {path} holds something else.")
    if not home:
        raise FileError(f"The folder {path.parent} does not exist: make it first.")
    return False
