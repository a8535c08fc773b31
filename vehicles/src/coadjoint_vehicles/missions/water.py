"""The water of a mission file: kinds of currents by name, several that add up, a density."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.members import each
from coadjoint.sections import in_si, of_section
from coadjoint_vehicles.water.dimensions import DIMENSIONS

if TYPE_CHECKING:
    from coadjoint.mechanics.members import Each
    from coadjoint_vehicles.water.bottom import Bottom
    from coadjoint_vehicles.water.water import Water

Located = Callable[[Any], Path]
"""Where a file is that a mission names."""

_ROOM = "coadjoint_vehicles.water"
CURRENTS = {
    "uniform": "water:UniformWater",
    "shear": "profiles:LinearShear",
    "sheared": "profiles:Sheared",
    "tidal": "currents:TidalCurrent",
    "gauss_markov": "gauss_markov:GaussMarkovCurrent",
    "table": "tables:CurrentTable",
}
DENSITIES = {
    "linear": "density:LinearDensity",
    "exponential": "density:ExponentialDensity",
    "table": "density:DensityTable",
}
PROFILES = {
    "linear": "profiles:LinearProfile",
    "power_law": "profiles:PowerLaw",
    "logarithmic": "profiles:Logarithmic",
}
APART = 2**32
"""Between the seeds of two random currents of one mission."""
_INNER = {"density": DENSITIES, "profile": PROFILES}
VECTORS = ("velocity", "surface", "gradient", "mean", "amplitudes", "velocities", "deviation", "phases")
"""The fields of currents that hold a number for each axis of space."""


def water(section: Mapping[str, Any], axes: str, located: Located, seeds: Each | None = None) -> Water | None:
    """The water of [water], still without one; `seeds` for random currents of several members.

    One current with its `kind` ("uniform" unless given) and fields, or several, each a table [water.NAME], which add
    up, with [water.density]. axes: those of vectors. located: where a file is that a table names. Raises ArgumentError
    and FileError.
    """
    read = partial(_made, axes, located)
    given = {name: table for name, table in section.items() if name != "bottom"}
    if not given:
        return None
    named = {name: table for name, table in given.items() if isinstance(table, dict) and name != "profile"}
    if not named:
        return read(given, "water", CURRENTS, "uniform", seeds)
    alone = [key for key in given if key not in named]
    if alone:
        raise ArgumentError(
            f"Section [water] has `{alone[0]}` next to tables such as [water.{next(iter(named))}]: put it into a table "
            "of its own, as in [water.drift]."
        )
    from coadjoint_vehicles.water.sea import Sea

    made = {}
    for place, (name, table) in enumerate(named.items()):
        kinds, default = (_INNER[name], "") if name in _INNER else (CURRENTS, "uniform")
        own = None if seeds is None else each(seeds.values + place * APART)
        made[name] = read(table, f"water.{name}", kinds, default, own)
    return Sea(**made)


def bottom(section: Mapping[str, Any], located: Located) -> Bottom | None:
    """The bottom of [water.bottom], a grid in a file, CSV or netCDF; None without one.

    Raises ArgumentError and FileError.
    """
    given = section.get("bottom")
    if given is None:
        return None
    if not isinstance(given, dict) or not isinstance(given.get("file"), str):
        raise ArgumentError(f'[water.bottom] needs file = "…", a grid in CSV or netCDF, but is {given!r:.60}.')
    from coadjoint_vehicles.water.bottom import Bottom

    path = located(given["file"])
    map_ = path.suffix.lower() in (".tif", ".tiff")
    keys = ("file", "between", *(("origin", "positive") if map_ else ()))
    found = in_si("water.bottom", given, keys, {"origin": u.LENGTH})
    between = found.get("between", "bilinear")
    if map_:
        more = {key: found[key] for key in ("origin", "positive") if key in found}
        return Bottom.from_geotiff(path, between, **more)
    reader = Bottom.from_csv if path.suffix == ".csv" else Bottom.from_netcdf
    return reader(path, between)


def _made(axes: str, located: Located, given: Any, title: str, kinds: dict[str, str], default: str, seeds: Any) -> Any:
    """One current, density or profile of a table."""
    table = dict(given)
    kind = table.pop("kind", default)
    checks.known(kind, list(kinds), "kind", f"Section [{title}]")
    module, _, name = kinds[kind].partition(":")
    cls = getattr(import_module(f"{_ROOM}.{module}"), name)
    if "file" in table and hasattr(cls, "from_csv"):
        if len(table) > 1:
            raise ArgumentError(f"Section [{title}] takes all of its table from `file`: leave the other keys out.")
        return cls.from_csv(located(table["file"]))
    known = [key for key in inspect.signature(cls).parameters if key != "self"]
    measured = {**dict.fromkeys(known), **DIMENSIONS, **({"surface": u.SPEED} if kinds is CURRENTS else {})}
    values = in_si(title, table, known, measured)
    for key in [key for key in values if key in _INNER and isinstance(values[key], dict)]:
        values[key] = _made(axes, located, values[key], f"{title}.{key}", _INNER[key], "", seeds)
    if kinds is CURRENTS and axes != "NED/FRD":
        values = {key: _turned(key, value, axes) for key, value in values.items()}
    if seeds is not None and "seed" in known:
        values["seed"] = seeds
    try:
        with of_section(title):
            return cls(**values)
    except TypeError as error:
        needed = [key for key, value in inspect.signature(cls).parameters.items() if value.default is value.empty]
        raise ArgumentError(
            f"Section [{title}] of kind {kind!r} needs {', '.join(f'`{key}`' for key in needed)}."
        ) from error


def _turned(key: str, value: object, axes: PyTree) -> PyTree:
    """A field of a current in NED; standard deviations and phases change places and keep their signs."""
    from coadjoint_vehicles.axes import space_axes

    N = space_axes(axes)
    try:
        found = np.asarray(value if key in VECTORS else 0.0, dtype=float)
    except (TypeError, ValueError):
        return value  # which the current refuses
    return found @ (np.abs(N) if key in ("deviation", "phases") else N) if found.shape[-1:] == (3,) else value
