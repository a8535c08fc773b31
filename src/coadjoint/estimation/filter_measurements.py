"""The measurements of a filter by their names: the values that fit them, and those that are expected at rows."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.measurements import Measurement
from coadjoint.estimation.numbers import float64
from coadjoint.estimation.prepared import prepared
from coadjoint.estimation.process import Process
from coadjoint.estimation.timetable import Series, series
from coadjoint.kernels.run.function import RowFunction


class FilterMeasurements:
    """The measurements of a process by name, `prepared`, with the `sizes` of their values and their `numbers`.

    members: of many filters, None of one.
    """

    def __init__(self, process: Process, measurements: Mapping[str, Measurement], members: int | None):
        self.prepared = {name: prepared(process, name, measurement) for name, measurement in measurements.items()}
        self.sizes = {name: one.space.size for name, one in self.prepared.items()}
        self.numbers = {name: i for i, name in enumerate(self.prepared)}
        self._example, self._members = process.example, members
        self._read: dict[str, RowFunction] = {}

    def readings(self, rows: PyTree, random: np.random.Generator | None) -> dict[str, np.ndarray]:
        """The values (…, m) at rows of the process (…, size), by name, with noise from `random` if there is one."""
        rows, size = np.asarray(rows), len(self._example)
        checks.expect(
            np.issubdtype(rows.dtype, np.floating) and rows.shape[-1:] == (size,),
            rows,
            "rows",
            f"rows (…, {size}) of the process",
        )
        found: dict[str, np.ndarray] = {}
        for name, one in self.prepared.items():
            if name not in self._read:
                self._read[name] = one.readings(self._example)
            e = one.noise(rows.size // size, random)
            given = np.concatenate([rows.reshape(-1, size), e], axis=1)
            found[name] = self._read[name](np.zeros((len(e), 0)), given)[0].reshape(*rows.shape[:-1], -1)
        return found

    def log(self, measured: PyTree) -> dict[str, Series]:
        """The series of a log, name → (times, values), in the order of the measurements."""
        seen = all_series(measured, "measured", self.sizes, self._members)
        for name, one in seen.items():
            self.prepared[name].space.require(one.values.reshape(-1, self.sizes[name]), f"`{name}` of `measured`")
        return {name: seen[name] for name in self.prepared if name in seen}

    def value(self, name: str, value: PyTree) -> np.ndarray:
        """The measured values, (1, m), or (members, m)."""
        checks.known(name, self.sizes, "measurement", "The filter")
        try:
            found = float64(value)
        except (TypeError, ValueError):
            raise ArgumentError(f"`{name}` of `measured` must be numbers, but is {shown(value)}.") from None
        flat = found.reshape(-1)
        # Squares that overflow go the other way.
        alone = len(flat) == self.sizes[name] and (self._members is None or found.ndim < 2)
        if alone and math.isfinite(flat.dot(flat)):
            values = flat[None]
        else:
            one = series(name, ([0.0], [found]), "measured", self.sizes, self._members)
            values = one.values if one.values.ndim == 2 else one.values[0]
        if not self.prepared[name].space.everywhere:
            self.prepared[name].space.require(values, f"`{name}` of `measured`")
        return values


def all_series(given: PyTree, argument: str, sizes: Mapping[str, int], members: int | None) -> dict[str, Series]:
    """Name → (times, values) as given, each checked; empty where nothing is given."""
    if given is not None:
        checks.instance(given, argument, Mapping, "name → (times, values)")
    return {name: series(name, one, argument, sizes, members) for name, one in dict(given or {}).items()}
