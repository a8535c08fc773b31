"""Files that an input file needs in its folder: those that a vehicle file names, modules that a Python file imports."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path, PurePath
from typing import Any

from coadjoint.errors import FileError

LARGEST = 64_000_000
"""Bytes of a file that a Python file reads; larger ones are not copied."""

_FOUND: dict[Path, dict[str, Path]] = {}
_opened: ContextVar[set[str] | None] = ContextVar("files that are opened", default=None)


def keep_beside(source: Path, name: str, other: Path) -> None:
    """Copy `other` along with copies of the file `source`; `name` is its relative path."""
    _FOUND.setdefault(source.resolve(), {})[name] = other


def companions(source: Path) -> dict[str, Path]:
    """The files that `source` needs in its folder, by their relative paths.

    Raises FileError for one in another folder, which a copy of `source` could not find.
    """
    found = _FOUND.get(source.resolve(), {})
    for name in found:
        if PurePath(name).is_absolute() or ".." in PurePath(name).parts:
            raise FileError(
                f"The file {source} names {name}, which is not in its folder, so that results cannot keep it: put it "
                "next to the file, or into a subfolder."
            )
    return found


@contextmanager
def kept_that_is_read(source: Path) -> Iterator[None]:
    """Inside this context, note the files that a Python file reads in its folder, for its copies."""
    _listen()
    token = _opened.set(set())
    try:
        yield
    finally:
        found = _opened.get() or ()
        _opened.reset(token)
        home = source.parent.resolve()
        for path in map(Path, found):
            own = path.resolve()
            kept = own.is_relative_to(home) and own.suffix not in (".py", ".pyc") and "site-packages" not in own.parts
            if kept and own.is_file() and own.stat().st_size <= LARGEST:
                keep_beside(source, own.relative_to(home).as_posix(), own)


@cache
def _listen() -> None:
    """Install an audit hook for opened files; Python cannot remove such a hook."""
    sys.addaudithook(_heard)


def _heard(event: str, given: tuple[Any, ...]) -> None:
    if event != "open" or (opened := _opened.get()) is None:
        return
    path, mode, flags = given
    reads = "w" not in mode and "a" not in mode if isinstance(mode, str) else not flags & (os.O_WRONLY | os.O_CREAT)
    if reads and isinstance(path, (str, bytes, os.PathLike)):
        opened.add(os.path.abspath(os.fsdecode(path)))
