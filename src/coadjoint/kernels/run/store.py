"""Machine code on disk, by content: $COADJOINT_CACHE, or coadjoint/ in the user's cache folder.

Code that is found there is run, so that it must be code which this user has kept there under that name: the folder and
every file belong to the user, nobody else may write to them, and a file begins with a digest of its name and content
under a secret key, which lies beside the files and which nobody else can read. What does not fit is ignored.
Files are written whole and renamed into place, so that several processes may share the folder. Together they take no
more than LIMIT; what has not been used for longest goes first. A folder that cannot be read or written is no cache, and
nothing else happens. An empty $COADJOINT_CACHE turns the cache off.
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
"""The most bytes that all files together take; code of a system takes some 100 kB."""

_DIGEST = hashlib.sha256().digest_size
_KEY = "key"
_HOUR = 3600.0
"""After so long a file that is being written has been given up, s."""

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
    """A name for what follows from `parts` alone."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(f"{len(part)}:{part}".encode())
    return digest.hexdigest()


def fetch(name: str) -> bytes | None:
    """What this user kept under `name`, or None."""
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
    """Keep `code` under `name` if that is possible."""
    place = folder()
    if place is None:
        return
    with contextlib.suppress(OSError):
        # Nobody else may put machine code there.
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        with _opened(place) as within:
            secret = _secret(place, within)
        if secret is not None:
            _put(place, f"{name}.code", _sealed(secret, name, code) + code)
            _bound(place)


def _sealed(secret: bytes, name: str, code: bytes) -> bytes:
    return hmac.digest(secret, name.encode() + b"\0" + code, "sha256")


# What is trusted.


@contextlib.contextmanager
def _opened(place: Path) -> Iterator[int | Path]:
    """The folder, as what files in it are opened in; raises OSError unless only this user can put files there."""
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
    """Whether what was found is of this kind, belongs to this user, and nobody else may write to it."""
    mine = found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return mine and callable(kind) and bool(kind(found.st_mode))


def _read(within: int | Path, name: str, private: bool = False, used: bool = False) -> bytes | None:
    """A file of this user's own, None for any other; raises OSError where there is none.

    private: nobody else may read it either. used: it counts as new again.
    """
    if isinstance(within, Path):
        return (within / name).read_bytes()
    # A link leads to what others may have written.
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


# What is written.


def _put(place: Path, name: str, content: bytes, new: bool = False) -> None:
    """Write a file whole, for this user alone; new: unless another process has written it meanwhile."""
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
    """Whether `target` is there, which it was before or is now; False where files cannot have two names."""
    try:
        os.link(source, target)
    except FileExistsError:
        return True
    except (OSError, AttributeError):
        return False
    return True


def _bound(place: Path) -> None:
    """Remove files that were left half written, and those that have not been used for longest, down to the LIMIT."""
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
