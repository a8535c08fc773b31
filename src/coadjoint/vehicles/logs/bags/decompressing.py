"""Parts of files that are compressed, unpacked to the size that the file says and no further."""

from __future__ import annotations

import bz2 as bz2_module

from coadjoint.vehicles.logs.bags.optional import library

LARGEST_CHUNK, MOST_TIMES = 256_000_000, 1000
"""The most bytes of a chunk, and how many times as large as the file what it holds may be."""


def zstd(data: memoryview, size: int) -> bytes:
    """What zstd has compressed; of another size where `size` is wrong."""
    zstandard = library("zstandard", "Reading bags")
    told = zstandard.frame_content_size(data)
    if told >= 0 and told != size:
        return b""
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size) if size else b""


def lz4(data: memoryview, size: int) -> bytes:
    """What lz4 has compressed, as a frame; longer than `size` by one where there is more."""
    return library("lz4.frame", "Reading bags").LZ4FrameDecompressor().decompress(data, max_length=size + 1)


def bz2(data: memoryview, size: int) -> bytes:
    """What bzip2 has compressed; longer than `size` by one where there is more."""
    return bz2_module.BZ2Decompressor().decompress(data, max_length=size + 1)
