"""netCDF files that can be trusted to be what was written, and others that are tried in a process of their own.

Behind the HDF5 of a file that `run.save` wrote stand a mark and the SHA-256 of all before it, which HDF5 does not read.
A file whose digest is another one is damaged. One without a mark, of somebody else or cut off, is first read in a child
process: the HDF5 library is in C, and files exist at which it loops without end or crashes.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

MARK = b"\ncoadjoint sealed"
SIZE = len(MARK) + hashlib.sha256().digest_size

SECONDS, SPEED = 8.0, 20e6
"""How long a child may take: so many seconds, and one more for so many bytes."""

_CHILD = "import sys, xarray; xarray.open_dataset(sys.argv[1], engine='h5netcdf').load()"


def seal(path: Path) -> None:
    """Append mark and digest to a file, and force it to the disk."""
    digest = _digest(path, path.stat().st_size)
    with path.open("ab") as file:
        file.write(MARK + digest)
        file.flush()
        os.fsync(file.fileno())


def sealed(path: Path) -> bool | None:
    """Whether a file is as it was sealed; None of one that bears no mark."""
    size = path.stat().st_size - SIZE
    if size < 0:
        return None
    with path.open("rb") as file:
        file.seek(size)
        end = file.read()
    return _digest(path, size) == end[len(MARK) :] if end.startswith(MARK) else None


def readable(path: Path) -> bool:
    """Whether a netCDF file can be read without harm: it is as it was sealed, or a child has read it in time."""
    found = sealed(path)
    if found is not None:
        return found
    limit = SECONDS + path.stat().st_size / SPEED
    try:
        done = subprocess.run([sys.executable, "-c", _CHILD, str(path)], capture_output=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def _digest(path: Path, size: int) -> bytes:
    """The SHA-256 of the first bytes of a file."""
    hasher = hashlib.sha256()
    with path.open("rb") as file:
        while size > 0 and (block := file.read(min(size, 1 << 20))):
            hasher.update(block)
            size -= len(block)
    return hasher.digest()
