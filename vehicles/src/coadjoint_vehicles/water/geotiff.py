"""Depths on a grid from GeoTIFF, by tifffile: coordinates along north and east in m, elevations or depths."""

from __future__ import annotations

import lzma
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from coadjoint.checks import library
from coadjoint.disk import require_file
from coadjoint.errors import ArgumentError, FileError, error_line
from coadjoint.extending import logger

_SCALE, _TIE, _TRANSFORMATION, _KEYS, _NO_DATA = 33550, 33922, 34264, 34735, 42113
_MODEL, _RASTER, _LINEAR_UNITS = 1024, 1025, 3076
_PROJECTED, _POINT, _METRE = 1, 2, 9001
_UNPACKERS: dict[int, Any] = {8: zlib.decompressobj, 32946: zlib.decompressobj, 34925: lzma.LZMADecompressor}
"""Decompressors for compressions that tifffile unpacks without a bound: deflate, old and new, and LZMA."""
_BOUNDED = (1, 5)
"""Others that are read: none, and LZW, which imagecodecs unpacks to the size of the pixels at most."""
SMALL = 64_000_000
"""Bytes that any strip may take."""
MOST_PAGES = 100
"""The most pictures of a file: the depths, and overviews of them."""


def grid_of(path: Path, most: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Northings (n,), eastings (m,), rising, m, and the values (n, m) at the centres of pixels, NaN where none are.

    Tags as of the OGC's GeoTIFF 1.1 (19-008r4): scale 33550, tie point 33922, keys 34735. Raises FileError for files
    that are not GeoTIFF, of several bands, rotated, in degrees or in feet, and for more than `most` pixels, before
    reading these; ArgumentError where tifffile is not installed.
    """
    tifffile = library("tifffile", "A bottom of GeoTIFF needs", "coadjoint-vehicles[maps]")
    require_file(path)
    logger("tifffile")  # which logs names
    try:
        with tifffile.TiffFile(path) as opened:
            page: Any = opened.pages[0]
            tags = {
                code: page.tags[code].value
                for code in (_SCALE, _TIE, _TRANSFORMATION, _KEYS, _NO_DATA)
                if code in page.tags
            }
            if len(opened.pages) > MOST_PAGES:
                raise FileError(f"The file {path} has {len(opened.pages):,} pictures, more than {MOST_PAGES}.")
            more = sum(not other.keyframe.is_reduced for other in opened.pages[1:])  # reduced ones are overviews
            shape = tuple(page.shape) if not more else (1 + more, *page.shape)
            _require_grid(path, shape, tags, most)
            _require_segments(path, page, most)
            return _placed(path, np.asarray(page.asarray(), float), tags)
    except (FileError, ArgumentError):
        raise
    except Exception as error:
        raise FileError(f"The file {path} is not a readable GeoTIFF ({error_line(error)}).") from error


def _require_grid(path: Path, shape: tuple[int, ...], tags: dict[int, Any], most: int) -> None:
    if len(shape) != 2:
        raise FileError(f"The file {path} must have one band of depths, but its shape is {shape}.")
    if shape[0] * shape[1] > most:
        raise FileError(f"The file {path} has {shape[0] * shape[1]:,} pixels, more than {most:,}: thin it out.")
    if _TRANSFORMATION in tags or _SCALE not in tags or _TIE not in tags or len(tags[_TIE]) != 6:
        raise FileError(
            f"The file {path} must have its place by one tie point and a scale (tags 33922 and 33550), along north and "
            "east: warp it to such a grid, as by gdalwarp."
        )
    keys = _keys(tags.get(_KEYS, ()))
    if keys.get(_MODEL) != _PROJECTED:
        raise FileError(
            f"The file {path} is in degrees, or does not say in what: project it to metres, as by gdalwarp -t_srs."
        )
    if keys.get(_LINEAR_UNITS, _METRE) != _METRE:
        raise FileError(f"The file {path} is not in metres, but in the unit EPSG:{keys[_LINEAR_UNITS]}: project it.")


def _require_segments(path: Path, page: Any, most: int) -> None:
    """Raise FileError where a strip or tile would take more memory than its pixels, before tifffile unpacks it."""
    size = int(page.dtype.itemsize) * int(np.prod(page.chunks))
    if size > max(8 * most, SMALL):
        raise FileError(f"The file {path} has a strip or tile of {size:,} bytes: write it anew in smaller ones.")
    handle = page.parent.filehandle
    if sum(page.databytecounts) > handle.size:
        raise FileError(f"The file {path} is damaged: its strips have more bytes than the file.")
    packed = int(page.compression)
    if packed not in (*_BOUNDED, *_UNPACKERS):
        raise FileError(
            f"The file {path} is compressed by {page.compression!r:.60}, which is not read: write it by gdal_translate "
            "-co COMPRESS=DEFLATE."
        )
    unpacker = _UNPACKERS.get(packed)
    if unpacker is None:
        return
    for place, count in zip(page.dataoffsets, page.databytecounts, strict=True):
        handle.seek(place)
        if len(unpacker().decompress(handle.read(count), size + 1)) > size:
            raise FileError(f"The file {path} is damaged: a strip unpacks to more than its {size:,} bytes of pixels.")


def _keys(directory: Any) -> dict[int, int]:
    """GeoKeys that are one number, by their numbers."""
    rows = np.asarray(directory, int).ravel()
    rows = rows[: len(rows) // 4 * 4].reshape(-1, 4)[1:]
    return {int(key): int(value) for key, where, _, value in rows if where == 0}


def _placed(path: Path, values: np.ndarray, tags: dict[int, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The grid with its axes; a tie point is of the corner of a pixel unless keys say of its centre."""
    step_east, step_north = (float(x) for x in tags[_SCALE][:2])
    column, row, _, east, north = (float(x) for x in tags[_TIE][:5])
    if not (step_east > 0 and step_north > 0):
        raise FileError(f"The file {path} has pixels of {step_east:g} by {step_north:g} m, which must be positive.")
    half = 0.0 if _keys(tags[_KEYS]).get(_RASTER) == _POINT else 0.5
    eastings = east + (np.arange(values.shape[1]) + half - column) * step_east
    northings = north - (np.arange(values.shape[0]) + half - row) * step_north
    if _NO_DATA in tags:
        try:
            missing = float(str(tags[_NO_DATA]).strip("\0 "))
        except ValueError:
            missing = np.nan
        values = np.where(values == missing, np.nan, values)
    return northings[::-1], eastings, values[::-1]
