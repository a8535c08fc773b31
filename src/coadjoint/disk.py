"""Durable and atomic files and folders: a file is complete or absent, and is synced to disk before it counts.

All that stored runs and folders of results write goes through the operations here, in the order in which they are
called. `before` is called before each of them.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from coadjoint.errors import FileError, rephrased

PARTIAL = ".partial"
"""The ending of the hidden name of a file that is being written or removed; the holder of the folder may remove it."""


NO_LINK = getattr(os, "O_NOFOLLOW", 0)
"""What opens a file that is written: a link under its name, in a folder of somebody else, raises OSError."""


def before(operation: str, path: Path) -> None:
    """Called before each operation on the disk, by its name. Tests put a function here that ends the process."""


def partial(path: Path) -> Path:
    """The hidden name next to `path` under which it is written, or removed."""
    return path.with_name(f".{path.name}{PARTIAL}")


def make(folder: Path) -> None:
    """Make a folder and its parents unless they exist; their names are synced to disk."""
    if not folder.is_dir():
        before("make", folder)
        new = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        for path in new:
            settle(path.parent)


def write(path: Path, parts: Iterable[Any], forced: bool = True, named: bool = True) -> None:
    """Put bytes into `path`: under its hidden name, synced to disk if `forced`, then moved into its place.

    The name is synced as well if `named`.
    """
    hidden = partial(path)
    try:
        before("write", hidden)
        with open(hidden, "wb", opener=_own) as file:
            for part in parts:
                file.write(part)
            if forced:
                file.flush()
                before("settle", hidden)
                os.fsync(file.fileno())
        move(hidden, path, named)
    except OSError:
        with contextlib.suppress(OSError):
            hidden.unlink()
        raise


def _own(path: str, flags: int) -> int:
    return os.open(path, flags | NO_LINK, 0o666)


def move(source: Path, target: Path, named: bool = True) -> None:
    """Give a file or folder another name in one move; the name is synced to disk if `named`."""
    before("move", target)
    os.replace(source, target)
    if named:
        settle(target.parent)


def settle(path: Path) -> None:
    """Sync a file, or the names in a folder, to disk."""
    before("settle", path)
    try:
        handle = os.open(path, os.O_RDONLY)
    except PermissionError:  # systems that cannot open a folder
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def remove(path: Path) -> None:
    """Remove a file, or a folder with its contents, which first moves to its hidden name."""
    if path.is_dir() and not path.is_symlink():
        hidden = partial(path)
        _remove_all(hidden)
        move(path, hidden)  # Its name goes first, also on disk: it is complete or absent.
        _remove_all(hidden)
    elif path.exists() or path.is_symlink():
        before("remove", path)
        path.unlink(missing_ok=True)


def sweep(folder: Path) -> None:
    """Remove files that a killed process left under hidden names in a folder."""
    for path in folder.glob(f".*{PARTIAL}"):
        _remove_all(path)


def _remove_all(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        before("remove", path)
        shutil.rmtree(path)
    elif path.exists() or path.is_symlink():
        before("remove", path)
        path.unlink()


def require_file(path: Path) -> None:
    """Raise FileError unless there is such a file."""
    if not os.path.isfile(path):  # no error for names that no file can have
        raise FileError(f"There is no file {path}.")


def require_folder(path: Path) -> None:
    """Raise FileError unless there is such a folder."""
    if not os.path.isdir(path):
        raise FileError(f"There is no folder {path}.")


def require_home(path: Path) -> None:
    """Raise FileError unless there is a folder in which a file of this name can be written."""
    if not path.parent.is_dir():
        raise FileError(f"The folder {path.parent} does not exist: make it first.")


def require_new(path: Path, overwrite: bool, what: str = "name") -> None:
    """Raise FileError rather than let a file be replaced; what: to choose another one of."""
    if path.exists() and not overwrite:
        raise FileError(f"The file {path} exists already: choose another {what} or pass overwrite=True.")


def reading(path: Path, what: str = "file") -> AbstractContextManager[None]:
    """A block that reads a file: an OSError in it becomes a FileError, with `what` the file is in the sentence."""
    return rephrased(f"The {what} {path} cannot be read")


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary neighbour to write to, which takes the name `path` when the block ends well and is gone if not.

    Raises FileError where the folder does not exist or cannot be written to.
    """
    target = Path(path)
    require_home(target)
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    try:
        with rephrased(f"The file {target} could not be written"):
            yield temporary
            os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write `text` as UTF-8, atomically; raises FileError."""
    with atomic_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Path(path)
