"""Compressed parts of files, unpacked to the size stated in the file and no further."""

from __future__ import annotations

import bz2 as bz2_module

from coadjoint.errors import FileError
from coadjoint_vehicles.logs.bags.optional import library

LARGEST_CHUNK, MOST_TIMES = 256_000_000, 1000
"""The most bytes of a chunk, and the largest ratio of its unpacked size to the size of the file."""
MOST_KEPT = 50
"""The largest ratio of kept bytes to the size of the file; `LARGEST_CHUNK` bytes are always allowed."""


def require_kept(path: str, kept: int, size: int) -> None:
    """Raise FileError where messages of so many bytes are kept of a file of this size."""
    if kept > max(LARGEST_CHUNK, MOST_KEPT * size):
        raise FileError(
            f"The messages in {path} would take {kept / 1e9:.3g} GB of memory, more than {MOST_KEPT} times the file: "
            "it is damaged, or made to fill the memory. Read fewer topics."
        )


def zstd(data: memoryview, size: int) -> bytes:
    """The unpacked bytes of zstd; of another size if `size` is wrong."""
    zstandard = library("zstandard", "Reading bags")
    told = zstandard.frame_content_size(data)
    if told >= 0 and told != size:
        return b""
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size) if size else b""


def lz4(data: memoryview, size: int) -> bytes:
    """The unpacked bytes of a frame of lz4; one byte longer than `size` if there are more."""
    return library("lz4.frame", "Reading bags").LZ4FrameDecompressor().decompress(data, max_length=size + 1)


def bz2(data: memoryview, size: int) -> bytes:
    """The unpacked bytes of bzip2; one byte longer than `size` if there are more."""
    return bz2_module.BZ2Decompressor().decompress(data, max_length=size + 1)
