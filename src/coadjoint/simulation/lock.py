"""One process at a time on a folder."""

from __future__ import annotations

import os
from pathlib import Path

from coadjoint.errors import FileError


class Lock:
    """Holds a folder until `release`, or until the process ends in whatever way; raises FileError if it is held."""

    def __init__(self, folder: Path):
        self._handle: int | None = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _hold(self._handle)
        except OSError as error:
            self.release()
            raise FileError(
                f"The folder {folder} is in use by another process that runs or resumes: wait until it ends."
            ) from error

    def release(self) -> None:
        """Let others in; the operating system does the same for a process that was killed."""
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
