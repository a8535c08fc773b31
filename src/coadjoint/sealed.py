"""netCDF files that are verified to be unchanged, and others that are first read in a separate process.

The HDF5 data of a file that `run.save` wrote are followed by a mark and the SHA-256 of all bytes before it, which HDF5
does not read. A file with another digest is damaged. A file without a mark, foreign or truncated, is first read in a
child process with limits of processor time and memory: the HDF5 library is in C, and files exist at which it loops
without end or crashes. The mark shows that a file is undamaged, not who wrote it: the sizes that a file declares are
compared with what it can hold in any case, and only contiguous numbers and short texts are read without a child.

As a script, this module is that child; it then imports nothing of the library.
"""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from coadjoint.arrays import PyTree

MARK = b"\ncoadjoint sealed"
SIZE = len(MARK) + hashlib.sha256().digest_size

SECONDS, SPEED = 8.0, 20e6
"""The processor time that a child may take to read, s, and the number of bytes for which it gets one more second."""
PATIENCE = 600.0
"""The wall-clock time that a child may take, s, beyond its processor time."""
LEAST, MOST_TIMES = 128_000_000, 50
"""The largest size that a file may declare, in bytes, and as a multiple of its own size."""
FEW = 64
"""Texts of more elements than these are read in a child."""


ENGINES = {b"\x89HDF": "h5netcdf", b"CDF\x01": "scipy", b"CDF\x02": "scipy"}
"""The engines by the beginning of a file: netCDF 4 is HDF5, netCDF 3 is written by xarray if only scipy is
installed."""


def engine_of(path: Path, by_child: bool = True) -> str:
    """The engine with which xarray reads a foreign netCDF file, after a check that it can be read safely.

    Give xarray the absolute path: it takes relative ones such as zip::x.nc for addresses.

    by_child: read it in a child first, even if it is plain. Raises ValueError if it is damaged or not netCDF, FileError
    if it declares more than it can hold.
    """
    with path.open("rb") as opened:
        engine = ENGINES.get(opened.read(4))
    if engine is None:
        raise ValueError("neither HDF5 nor netCDF 3")
    if engine == "scipy":
        _require_small(path, _of_netcdf3(path))
    if engine == "h5netcdf" and not (readable(path) if by_child else plain(path) or tried(path)):
        raise ValueError("damaged")
    return engine


def seal(path: Path) -> None:
    """Append mark and digest to a file, and sync it to disk."""
    digest = _digest(path, path.stat().st_size)
    with path.open("ab") as file:
        file.write(MARK + digest)
        file.flush()
        os.fsync(file.fileno())


def sealed(path: Path) -> bool | None:
    """Whether a sealed file is unchanged; None for a file without a mark."""
    size = path.stat().st_size - SIZE
    if size < 0:
        return None
    with path.open("rb") as file:
        file.seek(size)
        end = file.read()
    return _digest(path, size) == end[len(MARK) :] if end.startswith(MARK) else None


def readable(path: Path) -> bool:
    """Whether a netCDF file can be read safely: it is plain and unchanged, or a child has read it.

    Raises FileError for one that declares more than it can hold, and if a child exceeds its time.
    """
    found = sealed(path)
    return bool(found is not False and ((found and plain(path)) or tried(path)))


def plain(path: Path) -> bool:
    """Whether a netCDF 4 file holds numbers without filters and few texts only, so that reading takes the declared
    memory.

    Raises FileError for one that declares more than it can hold.
    """
    what, declared = examined(path)
    _require_small(path, declared)
    return not what


def tried(path: Path) -> bool:
    """Whether a child has read a netCDF file; raises FileError for one that declares more than it can hold."""
    from coadjoint.errors import FileError

    limit = SECONDS + path.stat().st_size / SPEED
    command = [sys.executable, "-P", __file__, str(path.absolute()), str(limit)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=limit + PATIENCE)
    except subprocess.TimeoutExpired:
        raise FileError(
            f"The file {path} was not read within {limit + PATIENCE:.0f} s: the machine is busy, or the file damaged."
        ) from None
    if done.stdout.startswith(b"declared "):
        _require_small(path, int(done.stdout.split()[1]))
    return done.returncode == 0


def _require_small(path: Path, declared: int) -> None:
    from coadjoint.errors import FileError

    size = path.stat().st_size
    if declared > most(size):
        raise FileError(
            f"The file {path} declares {declared / 1e9:.3g} GB of numbers, but has {size:,} bytes: it is damaged, or "
            "made to fill the memory."
        )


def most(size: int) -> int:
    """The number of bytes that a file of this size may declare."""
    return max(LEAST, MOST_TIMES * size)


def examined(path: Path) -> tuple[str, int]:
    """The first content other than plain numbers, or "", and the number of bytes that the file declares, without
    reading them."""
    import h5py

    limit = most(path.stat().st_size)
    what, declared = "", 0
    with h5py.File(path, "r") as file:
        for held in _held(file):
            if isinstance(held, str):
                return held, declared
            special, size = _texts(held, limit)
            if isinstance(held, h5py.Dataset):
                more, numbers = _numbers(held)
                special, size = special or more, size + numbers
            what, declared = what or special, declared + size
            if declared > limit:
                break
    return what, declared


def _of_netcdf3(path: Path) -> int:
    """How many bytes a netCDF 3 file declares, whose variables may all be the same part of the file."""
    from scipy.io import netcdf_file

    with netcdf_file(path.absolute(), mmap=True) as file:
        return sum(max(one.itemsize(), 8) * one.data.size for one in file.variables.values())


def _held(group: Any) -> Iterator[Any]:
    """A group with all groups and datasets within, each once; a text instead of the target of a link."""
    import h5py

    pending, seen = [group], {group}
    while pending:
        found = pending.pop()
        yield found
        for name in found if isinstance(found, h5py.Group) else ():
            if not isinstance(found.get(name, getlink=True), h5py.HardLink):
                yield "a link"
                continue
            inner = found[name]
            if inner not in seen:
                seen.add(inner)
                pending.append(inner)


def _numbers(dataset: Any) -> tuple[str, int]:
    """The special features of a dataset, and the bytes that it declares; numbers may become float64."""
    import h5py

    if dataset.shape is None:
        return "", 0
    if dataset.is_virtual or dataset.external:
        return "numbers of another file", 0
    if dataset.dtype.hasobject:
        what = "texts" if dataset.size > FEW or h5py.check_string_dtype(dataset.dtype) is None else ""
        return what, 8 * dataset.size if what else sum(len(dataset[at]) for at in _places(dataset.shape))
    elements = max(dataset.size, math.prod(dataset.chunks or (0,)))
    filters = dataset.id.get_create_plist().get_nfilters()
    return "filters" if filters else "", elements * max(dataset.dtype.itemsize, 8)


def _places(shape: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    import numpy as np

    return iter(np.ndindex(*shape))


def _texts(held: PyTree, limit: int) -> tuple[str, int]:
    """The special features of the attributes of a group or dataset, and their bytes."""
    size = 0
    for name in held.attrs:
        attribute = held.attrs.get_id(name)
        elements = math.prod(attribute.shape or ())
        if attribute.dtype.hasobject and elements > FEW:
            return "texts", size + 8 * elements
        found = held.attrs[name] if elements <= FEW and attribute.shape is not None else None
        size += len(found) if isinstance(found, (str, bytes)) else elements * max(attribute.dtype.itemsize, 8)
        if size > limit:
            break
    return "", size


def _digest(path: Path, size: int) -> bytes:
    """The SHA-256 of the first bytes of a file."""
    hasher = hashlib.sha256()
    with path.open("rb") as file:
        while size > 0 and (block := file.read(min(size, 1 << 20))):
            hasher.update(block)
            size -= len(block)
    return hasher.digest()


def _limited(seconds: float, memory: int) -> None:
    """End this process after so much more processor time, and give it no more than so many bytes more."""
    try:
        import resource
    except ImportError:  # without such limits, the parent's time limit remains
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    spent = math.ceil(used.ru_utime + used.ru_stime + seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (spent, spent))
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except OSError:
        return
    space = pages * resource.getpagesize() + memory
    resource.setrlimit(resource.RLIMIT_AS, (space, space))


def _child(path: str, seconds: float) -> None:
    import xarray

    size = os.stat(path).st_size
    _limited(seconds, 3 * most(size))
    what, declared = examined(Path(path))
    if declared > most(size):
        os.write(1, b"declared %d" % declared)
        sys.exit(3)
    if what in ("a link", "numbers of another file"):
        sys.exit(4)
    xarray.open_dataset(path, engine="h5netcdf").load()


if __name__ == "__main__":
    _child(sys.argv[1], float(sys.argv[2]))
