"""One process at a time on a folder."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from coadjoint import disk
from coadjoint.errors import FileError

LOCK = "lock"


class Lock:
    """Holds a folder until `release`, or until the process ends in whatever way; raises FileError if it is held.

    Its file is removed at `release`. That of a process that was killed stays, and holds nothing.
    """

    def __init__(self, folder: Path, name: str = LOCK):
        self.folder, self.name = folder, name
        while True:
            disk.before("lock", folder / name)
            self._handle: int | None = os.open(folder / name, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                _hold(self._handle)
            except OSError as error:
                self._close()
                raise FileError(
                    f"The folder {folder} is in use by another process that runs or resumes: wait until it ends."
                ) from error
            if self.held:
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


def _hold(handle: int) -> None:
    try:
        import fcntl
    except ImportError:
        import msvcrt

        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        return
    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
