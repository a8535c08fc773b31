"""A bottom of GeoTIFF: a plane in closed form, and files that mean something else."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coadjoint.errors import ArgumentError, CoadjointError, FileError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles.water import Bottom

NORTH, EAST = 6_650_000.0, 600_000.0
KEYS = {1024: 1, 1025: 1, 3076: 9001}


def plane(north: Any, east: Any) -> Any:
    """Depth, m, of northing and easting."""
    return 40 + 0.1 * (north - NORTH) - 0.05 * (east - EAST)


def geotiff(path: Path, change: dict[int, Any] | None = None, bands: int = 1, half: float = 0.5, **keys: int) -> Path:
    """Elevations at the centres of 30 by 40 pixels of 5 by 4 m, whose upper left corner is the tie point."""
    tifffile = pytest.importorskip("tifffile")
    east, north = EAST + 4.0 * (np.arange(40) + half), NORTH - 5.0 * (np.arange(30) + half)
    values = -plane(north[:, None], east)
    values = values if bands == 1 else np.stack([values] * bands)
    known = {**KEYS, **{int(key[1:]): value for key, value in keys.items()}}
    directory = [1, 1, 0, len(known), *(x for key, value in known.items() for x in (key, 0, 1, value))]
    tags = {33550: ("d", (4.0, 5.0, 0.0)), 33922: ("d", (0.0, 0.0, 0.0, EAST, NORTH, 0.0)), 34735: ("H", directory)}
    for code, value in (change or {}).items():
        if value is None:
            tags.pop(code)
        else:
            tags[code] = value
    extra = [(code, kind, len(value), value, True) for code, (kind, value) in tags.items()]
    tifffile.imwrite(path, values.astype(np.float32), extratags=extra, metadata=None, photometric="minisblack")
    return path


def test_a_plane_in_metres_is_met_about_its_origin(tmp_path: Path) -> None:
    for half, raster in ((0.5, 1), (0.0, 2)):
        path = geotiff(tmp_path / "x.tif", half=half, k1025=raster)
        bottom = Bottom.from_geotiff(path, origin=(NORTH - 100, EAST + 50))
        for north, east in ((10.0, 20.0), (50.0, -30.0), (33.3, 7.7)):
            depth = evaluate(bottom, north, east)
            assert depth == pytest.approx(plane(NORTH - 100 + north, EAST + 50 + east), rel=1e-6), raster


@pytest.mark.parametrize(
    ("change", "keys", "words"),
    [
        ({33550: None}, {}, "must have its place by one tie point and a scale"),
        ({34264: ("d", (1.0,) * 16)}, {}, "must have its place by one tie point and a scale"),
        ({}, {"k1024": 2}, "is in degrees"),
        ({}, {"k3076": 9002}, "is not in metres, but in the unit EPSG:9002"),
        ({33550: ("d", (4.0,))}, {}, "is not a readable GeoTIFF"),
        ({33550: ("d", (4.0, 0.0, 0.0))}, {}, "has pixels of 4 by 0 m"),
        ({42113: ("s", repr(float(np.float32(-plane(NORTH - 2.5, EAST + 2)))) + "\0")}, {}, "must be finite"),
    ],
)
def test_maps_that_mean_something_else_are_refused(tmp_path: Path, change: Any, keys: Any, words: str) -> None:
    with pytest.raises(FileError, match=words):
        Bottom.from_geotiff(geotiff(tmp_path / "x.tif", change, **keys))


def test_what_is_no_map_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = geotiff(tmp_path / "x.tif")
    with pytest.raises(FileError, match="all its depths are negative"):
        Bottom.from_geotiff(path, positive="down")
    with pytest.raises(FileError, match="must have one band of depths"):
        Bottom.from_geotiff(geotiff(tmp_path / "y.tif", bands=3))
    monkeypatch.setattr("coadjoint_vehicles.water.bottom.MOST", 1000)
    with pytest.raises(FileError, match="has 1,200 pixels, more than 1,000"):
        Bottom.from_geotiff(path)
    (tmp_path / "z.tif").write_bytes(b"II*\0" + bytes(30))
    for wrong in (tmp_path / "z.tif", tmp_path / "none.tif"):
        with pytest.raises(FileError, match=r"is not a readable GeoTIFF|There is no file"):
            Bottom.from_geotiff(wrong)
    given: tuple[dict[str, Any], ...] = ({"origin": (1.0,)}, {"origin": ("a", 0)}, {"positive": "north"})
    for one in given:
        with pytest.raises(ArgumentError, match=next(iter(one))):
            Bottom.from_geotiff(path, **one)


def test_without_tifffile_a_sentence_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tifffile", None)
    with pytest.raises(CoadjointError, match=r"needs tifffile.*pip install \"coadjoint-vehicles\[maps\]\""):
        Bottom.from_geotiff(tmp_path / "x.tif")
