"""Output folders: one run each, never overwritten by another one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from coadjoint.errors import FileError
from coadjoint.texts import read_table

RUN_FILE = "run.toml"
"""The configuration of the run that a folder holds, written first: it claims the folder."""
SUMMARY = "summary.json"
"""The certificate of the run, written last: with it a folder is complete."""


def require_free(folder: Path, configuration: str, overwrite: bool) -> None:
    """Raise FileError if `folder` holds another run, or this very run and `overwrite` is not set.

    `configuration` is the text of the run's run.toml; two runs are the same if their TOML means the same.
    """
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is a file, not a folder: choose another output folder with --out.")
    held = folder / RUN_FILE
    if held.exists():
        if not _same(held, configuration):
            raise FileError(f"The folder {folder} holds another run already: choose another one with --out.")
        if not overwrite:
            raise FileError(
                f"The folder {folder} holds this very run already: pass --overwrite to repeat it, or choose another "
                "folder with --out."
            )
    elif folder.is_dir() and ((folder / SUMMARY).exists() or any(folder.glob("*.nc"))):
        raise FileError(f"The folder {folder} holds another run already: choose another one with --out.")


def make(folder: Path) -> None:
    """Make a folder, unless it is there; raises FileError where it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"The folder {folder} cannot be made: {error.strerror or error}.") from error


@contextmanager
def claimed(folder: Path, configuration: str, overwrite: bool) -> Iterator[Path]:
    """`folder`, made and marked by its run.toml; left as it was found if the block raises before it wrote anything.

    Raises FileError as `require_free` does, and where the folder cannot be made or written to.
    """
    require_free(folder, configuration, overwrite)
    made = _missing(folder)
    before = set() if made else {entry.name for entry in folder.iterdir()}
    held, written = folder / RUN_FILE, None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not held.exists():
            # "x" lets one of two runs that start at once have the folder.
            with open(held, "x", encoding="utf-8") as file:
                written = held
                file.write(configuration)
    except FileExistsError as error:
        raise FileError(f"The folder {folder} has just been taken by another run: choose another one.") from error
    except OSError as error:
        if written is not None:
            written.unlink(missing_ok=True)
        _clean(folder, made)
        raise FileError(f"The folder {folder} cannot be written to: {error.strerror or error}.") from error
    try:
        yield folder
    except BaseException:
        if {entry.name for entry in folder.iterdir()} - before == {RUN_FILE}:
            held.unlink()
            _clean(folder, made)
        raise


def require_writable(folder: Path, configuration: str, overwrite: bool) -> None:
    """Raise FileError as `claimed` does; the folder is left as it was found."""
    with suppress(_Released), claimed(folder, configuration, overwrite):
        raise _Released


class _Released(Exception):
    """A folder was claimed only to see whether it can be."""


def begin_results(folder: Path) -> None:
    """Take away the summary of a run that is repeated, so that its folder counts as complete only when it is."""
    try:
        (folder / SUMMARY).unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"The folder {folder} cannot be written to: {error.strerror or error}.") from error


def _same(held: Path, configuration: str) -> bool:
    try:
        return read_table(held.read_text(encoding="utf-8"), held) == read_table(configuration, held)
    except (OSError, UnicodeDecodeError):
        return False


def _missing(folder: Path) -> list[Path]:
    """The folders that do not exist yet, the innermost first."""
    return [path for path in (folder, *folder.parents) if not path.exists()]


def _clean(folder: Path, made: list[Path]) -> None:
    """Remove the empty folders that were made for nothing."""
    for path in made:
        try:
            os.rmdir(path)
        except OSError:
            return
