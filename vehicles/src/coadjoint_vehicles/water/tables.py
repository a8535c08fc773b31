"""Currents from tables over time and depth, and from CSV files."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, FileError
from coadjoint.extending import traced
from coadjoint.mechanics import Linear
from coadjoint_vehicles.water.columns import DOWN, Columns, read
from coadjoint_vehicles.water.water import Water

AXES = ("time", "depth")


@dataclass(frozen=True, eq=False)
class CurrentTable(Water):
    """A current linear between the rows of a table over time, over depth, or over both.

    velocities: (k, 3) m/s over k `times` (s) or k `depths` (m, from 0 on), or (k, m, 3) over k times and m depths;
    north, east, down. Outside of the table the current is held at its ends. A table costs a selection for each of its
    rows wherever the current is asked for. Raises ArgumentError for times or depths that do not grow, negative depths
    and wrong shapes.
    """

    velocities: Any
    times: Any = None
    depths: Any = None

    def __post_init__(self) -> None:
        shape: list[int] = []
        for name in ("times", "depths"):
            values = getattr(self, name)
            if values is None:
                continue
            values = checks.array(values, name, "(k,)")
            if name == "depths" and not traced(values) and np.any(values < 0):
                raise ArgumentError(f"Argument `depths` must be 0 m or more, but has {np.min(values):g} m: {DOWN}.")
            checks.increasing(values, name)
            object.__setattr__(self, name, values)
            shape.append(len(values))
        if not shape:
            raise ArgumentError("A table of currents needs `times`, `depths` or both.")
        object.__setattr__(self, "velocities", checks.array(self.velocities, "velocities", (*shape, 3)))

    @property
    def uniform(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.depths is None

    @property
    def steady(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.times is None

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str]) -> CurrentTable:
        """The table of a CSV file with the columns time (s) and depth (m), one or both, north, east [and down] (m/s).

        Rows are sorted by time, then by depth; each time has the same depths. Raises FileError with file, line and
        column for a value that is missing, not a number, out of order or duplicated.
        """
        table = read(path, ("north", "east"), (*AXES, "down"))
        axes = [name for name in AXES if name in table.values]
        if not axes:
            raise FileError(f"{path}: column `time` or `depth` is missing: a table needs one, or both.")
        table.require_growth(axes)
        down = table.values.get("down", np.zeros(len(table.values["north"])))
        rows = np.stack([table.values["north"], table.values["east"], down], axis=-1)
        if len(axes) == 1:
            return cls(rows, **{f"{axes[0]}s": table.values[axes[0]]})
        times = np.unique(table.values["time"])
        depths = _require_grid(table, times)
        return cls(rows.reshape(len(times), len(depths), 3), times, depths)

    def current(self, position: Array, t: Scalar, internal: PyTree, own: PyTree) -> Array:
        rows = own.velocities
        if self.times is not None:
            rows = Linear(own.times, rows)(t)
        return rows if self.depths is None else Linear(own.depths, jnp.asarray(rows))(position[2])


def _require_grid(table: Columns, times: np.ndarray) -> np.ndarray:
    """The depths that every time has; raises where one has others."""
    time, depth = table.values["time"], table.values["depth"]
    depths = depth[time == times[0]]
    for t in times[1:]:
        rows = np.flatnonzero(time == t)
        if not np.array_equal(depth[rows], depths):
            raise table.refuse(
                int(rows[0]),
                "depth",
                f"time {t:g} has the depths {_listed(depth[rows])}, but time {times[0]:g} has {_listed(depths)}: give "
                "each time the same depths.",
            )
    return depths


def _listed(values: np.ndarray) -> str:
    shown = ", ".join(f"{value:g}" for value in values[:6])
    return shown if len(values) <= 6 else f"{shown}, … ({len(values)})"
