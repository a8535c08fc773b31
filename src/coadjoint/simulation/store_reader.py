"""Reads the folder of a run: its manifest, its configuration and its checkpoint."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from coadjoint.disk import reading, require_folder
from coadjoint.errors import FileError
from coadjoint.manifest import MANIFEST, Manifest
from coadjoint.simulation import configuration
from coadjoint.texts import Table

CONFIGURATION = "configuration.npz"


CHECKPOINTS = "checkpoint-*.npz"


OLD_CHECKPOINT = "checkpoint.npz"
"""The checkpoint in a folder of format 1."""


_AGAIN = 20
"""How often reading a folder is tried while a run there replaces the file that is read."""


def require_run(folder: Path) -> None:
    """Raise FileError if a folder holds no run, or one that an older version wrote."""
    require_folder(folder)
    if (folder / MANIFEST).exists():
        return
    if (folder / OLD_CHECKPOINT).exists() and (folder / CONFIGURATION).exists():
        raise FileError(
            f"The folder {folder} was written in format 1 of stored runs, by an older version of coadjoint: go on with "
            "that version, or begin the run again in another folder."
        )
    state = (
        "has lost its manifest: put back a copy of it"
        if (folder / CONFIGURATION).exists()
        else ("holds no run that streamed to disk")
    )
    raise FileError(f"The folder {folder} {state}.")


def run_manifest(folder: Path) -> Manifest:
    """The manifest of the run that streamed to a folder; raises FileError if the folder holds no run."""
    require_run(folder)
    found = Manifest.read(folder)
    if found.facts["kind"] != "records":
        raise FileError(
            f"The folder {folder} holds the results of a run file, not a run that streamed to disk: give co.load its "
            "trajectory.nc, and `coadjoint run` or `coadjoint resume` the folder."
        )
    return found


def standing(folder: Path) -> tuple[Manifest, Table, dict[str, np.ndarray]]:
    """The manifest of the run in a folder with the checkpoint that it names, also during the run.

    Raises FileError if a file is missing or does not have its full length.
    """
    manifest = run_manifest(folder)
    for _ in range(_AGAIN):
        try:
            for name in manifest.files:
                manifest.require_size(name)
            return manifest, *_read(manifest, manifest.facts["checkpoint"])
        except FileError:
            before, manifest = manifest.facts, run_manifest(folder)
            if manifest.facts == before:
                raise
    raise FileError(f"The folder {folder} changes faster than it can be read: wait until its run has ended.")


def read_configuration(manifest: Manifest) -> tuple[Table, dict[str, np.ndarray]]:
    """The configuration of the run in a folder; raises FileError if it is damaged."""
    return _read(manifest, CONFIGURATION)


def _read(manifest: Manifest, name: str) -> tuple[Table, dict[str, np.ndarray]]:
    manifest.require(name)
    with reading(manifest.folder / name):
        return configuration.unpacked(manifest.path(name))
