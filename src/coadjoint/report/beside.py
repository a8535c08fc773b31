"""Files that an input file needs beside it: what a vehicle file names, modules that a Python file imports."""

from __future__ import annotations

from pathlib import Path, PurePath

from coadjoint.errors import FileError

_FOUND: dict[Path, dict[str, Path]] = {}


def keep_beside(source: Path, name: str, other: Path) -> None:
    """Let copies of the file `source` have `other` beside them; `name` is its place from there."""
    _FOUND.setdefault(source.resolve(), {})[name] = other


def beside(source: Path) -> dict[str, Path]:
    """The files that `source` needs beside it, by their places from there.

    Raises FileError for one in another folder, which could not be found beside a copy.
    """
    found = _FOUND.get(source.resolve(), {})
    for name in found:
        if PurePath(name).is_absolute() or ".." in PurePath(name).parts:
            raise FileError(
                f"The file {source} names {name}, which is not in its folder, so that results cannot keep it: put it "
                "beside the file, or into a folder there."
            )
    return found
