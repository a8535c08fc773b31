"""New folders for runs: complete, in one move, and never over anything else."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from coadjoint.errors import FileError
from coadjoint.simulation import checkpoint as disk
from coadjoint.simulation.ensemble import Ensemble
from coadjoint.simulation.lock import Lock
from coadjoint.simulation.reading import CONFIGURATION
from coadjoint.simulation.recording import beside
from coadjoint.simulation.run import Run
from coadjoint.simulation.store import Store


def create(path: Path, run: Run | Ensemble, configuration: tuple[Mapping[str, Any], Any]) -> Store:
    """A new folder for a run that has not begun, complete with its first checkpoint; it appears in one move."""
    require_free(path)
    header, numbers = configuration
    made: Path | None = None
    try:
        made = beside(path)
        made.mkdir()
        store = Store(run, made, header["identity"], Lock(made))
        store.lay_out(*run.one)
        disk.write(made / CONFIGURATION, header, numbers)
        store.write_checkpoint(run.position)
        made.replace(path)
    except OSError as error:
        if made is not None:
            shutil.rmtree(made, ignore_errors=True)
        raise FileError(f"The folder {path} cannot be made: {error.strerror or error}.") from error
    disk.settle(path.parent)
    store.move_to(path)
    return store


def require_free(path: Path) -> None:
    """Raise FileError unless a new run may be put at `path`."""
    try:
        held, other = (path / CONFIGURATION).exists(), path.exists() and (not path.is_dir() or any(path.iterdir()))
        home = path.parent.is_dir()
    except OSError as error:
        raise FileError(f"The folder {path} cannot be looked at: {error.strerror or error}.") from error
    if held:
        raise FileError(
            f"The folder {path} holds a run already: continue it with co.resume, or choose another folder for `store`."
        )
    if other:
        raise FileError(f"Argument `store` must name a new or empty folder, but {path} holds something else.")
    if not home:
        raise FileError(f"The folder {path.parent} does not exist: make it first.")
