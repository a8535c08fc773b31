"""Arrays in NumPy archives, read only where the file holds as many bytes as an array declares."""

from __future__ import annotations

import io
import math
import zipfile

import numpy as np


def stored_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """The array in `name`.npy of an archive, which is stored without compression.

    Raises ValueError for one that is compressed, holds Python objects, or declares another size than it has, before any
    number is read; KeyError for a name that is not there.
    """
    part = archive.getinfo(f"{name}.npy")
    with archive.open(part) as file:
        version = np.lib.format.read_magic(file)
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = header(file)
        size = math.prod(shape) * kind.itemsize
        if kind.hasobject or part.compress_type != zipfile.ZIP_STORED or file.tell() + size != part.file_size:
            raise ValueError(f"{name} declares {size} bytes, but the file holds {part.file_size}")
    with archive.open(part) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def stored_arrays(content: bytes) -> dict[str, np.ndarray]:
    """All arrays of an archive by their names; raises ValueError if it declares more than it has, or is damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(part.file_size for part in archive.infolist()) > len(content):
                raise ValueError("the archive declares more bytes than it has")
            names = [part.filename.removesuffix(".npy") for part in archive.infolist()]
            return {name: stored_array(archive, name) for name in names}
    except (KeyError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise ValueError(f"the archive is damaged: {error}") from error
