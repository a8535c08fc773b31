"""Runs of run files that were interrupted: `DIR/unfinished` holds their records until the results are written."""

from __future__ import annotations

import shutil
from pathlib import Path

from coadjoint.errors import FileError
from coadjoint.report.folder import RUN_FILE, SUMMARY
from coadjoint.runs.run_file import read
from coadjoint.runs.runnable import Runnable

UNFINISHED = "unfinished"


def require_none_unfinished(folder: Path, overwrite: bool) -> None:
    """Raise FileError where a folder holds a run that one can go on with, unless it is to be begun again."""
    if (folder / UNFINISHED).exists() and not overwrite:
        raise FileError(
            f"The folder {folder} holds a run that has not ended: go on with `coadjoint resume {folder}`, choose "
            "another folder with --out, or pass --overwrite to begin it again."
        )


def discard(folder: Path) -> None:
    """Remove the unfinished run in a folder, if there is one and no other process is at it."""
    from coadjoint.simulation.lock import Lock

    place = folder / UNFINISHED
    if place.exists():
        lock = Lock(place)
        shutil.rmtree(place, ignore_errors=True)
        lock.release()


def unfinished(folder: Path) -> Runnable:
    """The run file of the unfinished run in a folder; raises FileError where there is none."""
    if not folder.is_dir():
        raise FileError(f"There is no folder {folder}.")
    if not (folder / UNFINISHED).exists():
        what = "a run that has ended: there is nothing to go on with" if (folder / SUMMARY).exists() else "no run"
        raise FileError(f"The folder {folder} holds {what}.")
    return read(folder / RUN_FILE).beside_results()
