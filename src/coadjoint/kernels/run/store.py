"""Machine code on disk, by content: $COADJOINT_CACHE, or coadjoint/ in the user's cache folder.

Files are written whole and renamed into place, so that several processes may share the folder, and carry a digest,
so that a damaged one is ignored. A folder that cannot be read or written is no cache, and nothing else happens; nor is
one that belongs to somebody else or that others may write to, for its code would be run. An empty $COADJOINT_CACHE
turns the cache off.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import tempfile
from pathlib import Path

_DIGEST = hashlib.sha256().digest_size


def folder() -> Path | None:
    """Where machine code is kept, or None if it is not."""
    chosen = os.environ.get("COADJOINT_CACHE")
    if chosen is not None:
        return Path(chosen) if chosen else None
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "coadjoint"
    except RuntimeError:  # a user without a home
        return None


def _trusted(place: Path) -> bool:
    """Whether only this user can put machine code there; raises OSError where there is no such folder."""
    if not hasattr(os, "geteuid"):  # no owners and modes to check
        return True
    found = place.stat()
    return found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def key(*parts: str) -> str:
    """A name for what follows from `parts` alone."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(f"{len(part)}:{part}".encode())
    return digest.hexdigest()


def fetch(name: str) -> bytes | None:
    """What was kept under `name`, or None."""
    place = folder()
    if place is None:
        return None
    try:
        if not _trusted(place):
            return None
        content = (place / f"{name}.code").read_bytes()
    except OSError:
        return None
    digest, code = content[:_DIGEST], content[_DIGEST:]
    return code if code and hashlib.sha256(code).digest() == digest else None


def keep(name: str, code: bytes) -> None:
    """Keep `code` under `name` if that is possible."""
    place = folder()
    if place is None:
        return
    temporary = None
    try:
        # Nobody else may put machine code there.
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _trusted(place):
            return
        handle, temporary = tempfile.mkstemp(dir=place, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            file.write(hashlib.sha256(code).digest() + code)
        os.replace(temporary, place / f"{name}.code")
    except OSError:
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
