"""Machine code on disk, by content: $COADJOINT_CACHE, or coadjoint/ in the user's cache folder.

Code that is found there is executed, so that it must be code that this user has stored there under that name: the
folder and every file belong to the user, no other user may write to them, and a file begins with a digest of its name
and content under a secret key, which lies next to the files and which no other user can read. Other files are ignored.
Files are written completely and renamed into place, so that several processes may share the folder. Together they take
no more than LIMIT; the least recently used files are removed first. A folder that cannot be read or written disables
the cache, without an error. An empty $COADJOINT_CACHE turns the cache off.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import secrets
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

LIMIT = 256 << 20
"""The largest total size of all files, in bytes; code of a system takes some 100 kB."""

_DIGEST = hashlib.sha256().digest_size
_KEY = "key"
_HOUR = 3600.0
"""The age after which an unfinished file counts as abandoned, s."""

_NOFOLLOW = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


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


def key(*parts: str) -> str:
    """A name for a result that follows from `parts` alone."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(f"{len(part)}:{part}".encode())
    return digest.hexdigest()


def fetch(name: str) -> bytes | None:
    """The code that this user stored under `name`, or None."""
    place = folder()
    if place is None:
        return None
    try:
        with _opened(place) as within:
            secret = _read(within, _KEY, private=True)
            content = _read(within, f"{name}.code", used=True)
    except OSError:
        return None
    if secret is None or content is None or len(secret) != _DIGEST:
        return None
    digest, code = content[:_DIGEST], content[_DIGEST:]
    return code if code and hmac.compare_digest(_sealed(secret, name, code), digest) else None


def keep(name: str, code: bytes) -> None:
    """Store `code` under `name` if that is possible."""
    place = folder()
    if place is None:
        return
    with contextlib.suppress(OSError):
        # No other user may put machine code there.
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        with _opened(place) as within:
            secret = _secret(place, within)
        if secret is not None:
            _put(place, f"{name}.code", _sealed(secret, name, code) + code)
            _bound(place)


def _sealed(secret: bytes, name: str, code: bytes) -> bytes:
    return hmac.digest(secret, name.encode() + b"\0" + code, "sha256")


# Trust.


@contextlib.contextmanager
def _opened(place: Path) -> Iterator[int | Path]:
    """The folder as a descriptor in which files are opened; raises OSError unless only this user can put files
    there."""
    if not hasattr(os, "geteuid"):  # no owners and modes to check
        yield place
        return
    handle = os.open(place, os.O_RDONLY | os.O_DIRECTORY)
    try:
        if not _own(os.fstat(handle), stat.S_ISDIR):
            raise PermissionError(f"{place} is open to others")
        yield handle
    finally:
        os.close(handle)


def _own(found: os.stat_result, kind: object) -> bool:
    """Whether an entry is of this kind, belongs to this user, and is not writable by others."""
    mine = found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return mine and callable(kind) and bool(kind(found.st_mode))


def _read(within: int | Path, name: str, private: bool = False, used: bool = False) -> bytes | None:
    """A file of this user, None for any other; raises OSError where there is none.

    private: no other user may read it either. used: it counts as new again.
    """
    if isinstance(within, Path):
        return (within / name).read_bytes()
    # A link leads to files that others may have written.
    handle = os.open(name, os.O_RDONLY | _NOFOLLOW, dir_fd=within)
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        if not _own(found, stat.S_ISREG) or found.st_size > LIMIT or (private and found.st_mode & 0o077):
            return None
        if used:
            with contextlib.suppress(OSError):
                os.utime(handle)
        return file.read()


def _secret(place: Path, within: int | Path) -> bytes | None:
    """The key of this folder, made at its first use."""
    for _ in range(2):
        with contextlib.suppress(FileNotFoundError):
            found = _read(within, _KEY, private=True)
            if found is not None and len(found) == _DIGEST:
                return found
            (place / _KEY).unlink()
        _put(place, _KEY, secrets.token_bytes(_DIGEST), new=True)
    return None


# Writing.


def _put(place: Path, name: str, content: bytes, new: bool = False) -> None:
    """Write a file atomically, for this user alone; new: unless another process has written it meanwhile."""
    handle, temporary = tempfile.mkstemp(dir=place, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        if new and _linked(temporary, place / name):
            return
        os.replace(temporary, place / name)
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)


def _linked(source: str, target: Path) -> bool:
    """Whether `target` exists, from before or from now; False where files cannot have two names."""
    try:
        os.link(source, target)
    except FileExistsError:
        return True
    except (OSError, AttributeError):
        return False
    return True


def _bound(place: Path) -> None:
    """Remove unfinished files and the least recently used ones, down to the LIMIT."""
    files: list[tuple[float, int, str]] = []
    with os.scandir(place) as entries:
        for entry in entries:
            with contextlib.suppress(OSError):
                found = entry.stat(follow_symlinks=False)
                if entry.name.endswith(".part") and found.st_mtime < time.time() - _HOUR:
                    os.unlink(entry.path)
                elif entry.name.endswith(".code"):
                    files.append((found.st_mtime, found.st_size, entry.path))
    total = sum(size for _, size, _ in files)
    for _, size, path in sorted(files):
        if total <= LIMIT:
            return
        with contextlib.suppress(OSError):
            os.unlink(path)
        total -= size
