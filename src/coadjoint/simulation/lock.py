"""One process at a time on a folder."""

from __future__ import annotations

import contextlib
import os
import socket
from pathlib import Path

from coadjoint import disk
from coadjoint.errors import FileError

LOCK = "lock"


class Lock:
    """Holds a folder until `release`, or until the process ends in whatever way; raises FileError if it is held.

    Its file, which names process and computer, is removed at `release`. That of a process that was killed stays, and
    holds nothing. Errors speak of the folder `of`, where the one that is held has another name for a while.
    """

    def __init__(self, folder: Path, name: str = LOCK, of: Path | None = None):
        self.folder, self.name = folder, name
        while True:
            disk.before("lock", folder / name)
            self._handle: int | None = _opened(folder / name)
            try:
                _hold(self._handle)
            except OSError as error:
                holder = _holder(self._handle)
                self._close()
                raise FileError(
                    f"The folder {of or folder} is in use by {holder}: wait until it ends, then the same call "
                    "again goes on with the run, or returns it."
                ) from error
            if self.held:
                _sign(self._handle)
                return
            self._close()  # The process that had it has just removed it.

    @property
    def held(self) -> bool:
        """Whether the folder is the one that was locked, and not one that was put in its place, or none."""
        try:
            return self._handle is not None and os.path.samestat(
                os.fstat(self._handle), os.stat(self.folder / self.name)
            )
        except OSError:
            return False

    def release(self) -> None:
        """Let others in; the operating system does the same for a process that was killed."""
        if self.held:
            with contextlib.suppress(OSError):
                disk.before("unlock", self.folder / self.name)
                (self.folder / self.name).unlink()
        self._close()

    def _close(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None


def _opened(path: Path) -> int:
    """The file of a lock; raises FileError for a link, which would lead to a file of another folder."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | disk.NO_LINK, 0o666)
    except OSError as error:
        if path.is_symlink():
            raise FileError(f"The file {path} is a link, to which nothing is written: remove it.") from error
        raise


def _sign(handle: int) -> None:
    """Write the holder of a lock into its file, so that others can name it."""
    with contextlib.suppress(OSError):  # of a disk that is full
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()} {socket.gethostname()}".encode())


def _holder(handle: int) -> str:
    """The holder of a lock as text, as far as its file names it."""
    with contextlib.suppress(OSError, ValueError):
        number, _, computer = os.read(handle, 300).decode("ascii").partition(" ")
        here = computer == socket.gethostname()
        if here and hasattr(os, "sched_yield"):  # not Windows, where signal 0 ends a process
            os.kill(int(number), 0)  # raises if no process has this number: the previous holder was killed
        return f"process {int(number)}" if here else f"process {int(number)} on {computer}"
    return "another process"


def _hold(handle: int) -> None:
    try:
        import fcntl
    except ImportError:
        import msvcrt

        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        return
    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
