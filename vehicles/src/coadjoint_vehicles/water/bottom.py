"""A bottom by its depths on a grid: from netCDF, CSV and GeoTIFF, interpolated with continuous derivatives."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.disk import require_file
from coadjoint.errors import ArgumentError, FileError, rephrased
from coadjoint.extending import engine_of
from coadjoint_vehicles.water.columns import read

MOST = 4_000_000
"""The most nodes of a grid."""
METRES = ("m", "metre", "metres", "meter", "meters", "")
NAMES = ("depth", "bottom", "elevation", "z")
"""The names of depths in netCDF files; `elevation` is positive up."""


class Bottom:
    """The depth of the bottom, m, as a function (north, east) → depth of its values at the nodes of a grid.

        bottom = Bottom(north=[0, 100], east=[0, 50], depth=[[20, 25], [30, 35]])
        run = co.simulate(system, start, dt=0.05, duration=300, until=water.at_bottom(bottom, clearance=2.0))

    north, east: coordinates of the nodes, (n,) and (m,) m, evenly spaced and rising. depth: (n, m) m, positive down.
    between: "bilinear", continuous, or "bicubic", through the same nodes by Catmull and Rom's cubics, whose slopes are
    continuous, too. Beyond the grid the bottom continues level with its edge. In terms of jax.numpy, differentiable by
    the place. Raises ArgumentError for an invalid grid.
    """

    def __init__(
        self, north: object, east: object, depth: object, between: Literal["bilinear", "bicubic"] = "bilinear"
    ):
        checks.choice(between, "between", ("bilinear", "bicubic"))
        self.north, self.east = _axis(north, "north"), _axis(east, "east")
        found = np.asarray(depth, dtype=float)
        shape = (len(self.north), len(self.east))
        checks.shape(found, "depth", shape)
        if found.size > MOST:
            raise ArgumentError(f"A bottom may have {MOST:,} nodes, but has {found.size:,}: thin it out.")
        if not np.all(np.isfinite(found)):
            i, j = np.argwhere(~np.isfinite(found))[0]
            raise ArgumentError(f"Argument `depth` must be finite, but is not at row {i + 1}, column {j + 1}.")
        self.depth, self.between = found, between

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str], between: Literal["bilinear", "bicubic"] = "bilinear") -> Bottom:
        """The bottom of a CSV file with the columns north, east and depth (m), a row for each node of a grid.

        Raises FileError for a file that cannot be read or is not a complete grid, with its line.
        """
        columns = read(path, ("north", "east", "depth")).values
        rows, columns_of = (np.unique(columns[key]) for key in ("north", "east"))
        north, east = np.searchsorted(rows, columns["north"]), np.searchsorted(columns_of, columns["east"])
        node, count = len(columns_of) * north + east, len(north)
        if not count == len(rows) * len(columns_of) == len(np.unique(node)):
            raise FileError(
                f"The file {path} must have one row for each of {len(rows)} × {len(columns_of)} nodes of a grid, but "
                f"has {count} rows."
            )
        depth = columns["depth"][np.argsort(node)].reshape(len(rows), len(columns_of))
        return _of_file(cls, path, rows, columns_of, depth, between)

    @classmethod
    def from_netcdf(cls, path: str | os.PathLike[str], between: Literal["bilinear", "bicubic"] = "bilinear") -> Bottom:
        """The bottom of a netCDF file with a variable depth, or elevation, over the coordinates north and east, m.

        Heights are marked by the name `elevation`, or by the attribute `positive = "up"`, which `z` needs.
        Raises FileError for a file that cannot be read or does not contain such a grid.
        """
        import xarray

        source = Path(path)
        require_file(source)
        with rephrased(f"The file {source} is not a netCDF file that can be read", Exception):
            opened = xarray.open_dataset(source.absolute(), engine=engine_of(source, by_child=False))
        with opened as dataset:
            name = next((name for name in NAMES if name in dataset), None)
            if name is None or set(dataset[name].dims) != {"north", "east"}:
                held = ", ".join(map(str, dataset.data_vars)) or "nothing"
                raise FileError(f"The file {source} needs a variable depth over north and east, but holds {held}.")
            sign = _sign(dataset[name].attrs.get("positive"), name, source)
            for axis in ("north", "east"):
                if axis not in dataset.coords:
                    raise FileError(f"The file {source} has no coordinate {axis}, in m.")
            for one in (name, "north", "east"):
                _require_metres(dataset[one].attrs.get("units"), one, source)
            if dataset[name].size > MOST:
                raise FileError(
                    f"The file {source} is not a bottom on a grid: it has {dataset[name].size:,} nodes, more than "
                    f"{MOST:,}: thin it out."
                )
            with rephrased(f"The file {source} is damaged, so that its {name} cannot be read", Exception):
                grid = dataset[name].load().transpose("north", "east").sortby(["north", "east"])
            return _of_file(cls, source, grid.north.values, grid.east.values, sign * grid.values, between)

    @classmethod
    def from_geotiff(
        cls,
        path: str | os.PathLike[str],
        between: Literal["bilinear", "bicubic"] = "bilinear",
        *,
        origin: tuple[float, float] = (0.0, 0.0),
        positive: Literal["up", "down"] = "up",
    ) -> Bottom:
        """The bottom of a GeoTIFF in metres, such as UTM, by tifffile (extra `[maps]`).

        origin: northing and easting, m, of north and east 0. positive: "up" of elevations, as most such files have
        them, or "down" of depths. Nodes are the centres of pixels.
        Raises FileError for a file that cannot be read, is in degrees, turned, compressed by other than deflate, LZMA
        and LZW, or has pixels without a value, ArgumentError for other words and numbers and where tifffile is not
        installed.
        """
        checks.choice(positive, "positive", ("up", "down"))
        try:
            zero = np.asarray(origin, float)
        except (TypeError, ValueError):
            zero = np.zeros(0)
        checks.expect(
            zero.shape == (2,) and np.all(np.isfinite(zero)), origin, "origin", "a northing and an easting in m"
        )
        from coadjoint_vehicles.water.geotiff import grid_of

        north, east, values = grid_of(Path(path), MOST)
        return _of_file(cls, path, north - zero[0], east - zero[1], -values if positive == "up" else values, between)

    def __call__(self, north: Any, east: Any) -> Array:
        """The depth at a place, m."""
        i, s = _cell(self.north, north)
        j, t = _cell(self.east, east)
        depth = jnp.asarray(self.depth.ravel())
        n, m = self.depth.shape
        steps = (0, 1) if self.between == "bilinear" else (-1, 0, 1, 2)
        rows, columns = ((1 - x, x) if self.between == "bilinear" else _cubic(x) for x in (s, t))
        total = jnp.zeros(())
        for a, row in zip(steps, rows, strict=True):
            for b, column in zip(steps, columns, strict=True):
                place = jnp.clip(i + a, 0, n - 1) * m + jnp.clip(j + b, 0, m - 1)
                total = total + row * column * depth[place]
        return total


def _axis(given: object, name: str) -> np.ndarray:
    found = np.asarray(given, dtype=float)
    steps = np.diff(found) if found.ndim == 1 else np.zeros(0)
    checks.expect(
        len(steps) >= 1 and np.all(np.isfinite(found)) and np.all(steps > 0),
        given,
        name,
        "two numbers or more that rise",
    )
    if np.ptp(steps) > 1e-6 * np.max(steps):
        raise ArgumentError(
            f"Argument `{name}` must be evenly spaced, but its steps are {min(steps):g} to {max(steps):g} m."
        )
    return found


def _cell(axis: np.ndarray, at: object) -> tuple[Array, Array]:
    """(the node before a place, how far it is to the next, from 0 to 1), held at the ends."""
    x = (at - axis[0]) / (axis[1] - axis[0])
    x = jnp.clip(x, 0.0, len(axis) - 1.0)
    i = jnp.clip(jnp.floor(x), 0.0, len(axis) - 2.0)
    return i.astype(int), x - i


def _cubic(s: Array) -> tuple[Array, ...]:
    """The weights of four nodes, Catmull and Rom (1974)."""
    return (
        0.5 * (-s + 2 * s**2 - s**3),
        0.5 * (2 - 5 * s**2 + 3 * s**3),
        0.5 * (s + 4 * s**2 - 3 * s**3),
        0.5 * (-(s**2) + s**3),
    )


def _sign(positive: object, name: str, path: str | os.PathLike[str]) -> float:
    """The factor from values to depths; raises FileError for `z` without a direction."""
    if positive is None and name == "z":
        raise FileError(
            f'The file {path} does not say whether z counts up: give it the attribute positive = "up" or "down".'
        )
    said = str(positive if positive is not None else ("up" if name == "elevation" else "down")).lower()
    checks.expect(
        said in ("up", "down"),
        positive,
        f"The file {path}: the attribute positive of {name}",
        '"up" or "down"',
        FileError,
    )
    return -1.0 if said == "up" else 1.0


def _require_metres(units: object, name: str, path: str | os.PathLike[str]) -> None:
    if units is not None and str(units).strip().lower() not in METRES:
        raise FileError(f"The file {path} must hold {name} in m, but its units are {units!r:.40}: convert it.")


def _of_file(cls: type[Bottom], path: Any, north: Any, east: Any, depth: Any, between: Any) -> Bottom:
    if np.size(depth) and np.all(np.asarray(depth) < 0):
        raise FileError(
            f"The file {path} holds no bottom under water: all its depths are negative, from {np.min(depth):g} m on; "
            "depths count down."
        )
    try:
        return cls(north, east, depth, between)
    except ArgumentError as error:
        raise FileError(f"The file {path} is not a bottom on a grid. {error}") from error
