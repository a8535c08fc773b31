"""The estimate of a filter: rows of its process, covariances of their errors, and the measurements it expects."""

from __future__ import annotations

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.estimation.arguments import array
from coadjoint.estimation.filter_measurements import FilterMeasurements
from coadjoint.estimation.innovation import FilterMemory
from coadjoint.estimation.process import Process
from coadjoint.mechanics.state import State
from coadjoint.overview import NumberRow, Overview, WithOverview, listed


class FilterEstimate(WithOverview):
    """Rows of a process with the covariances P of their errors, of one filter or of many members."""

    process: Process
    members: int | None
    _held: FilterMemory
    _measured: FilterMeasurements

    def _overview(self) -> Overview:
        facts = {
            "by": type(self.process).__name__,
            "t": f"{self.t:g} s",
            "members": self.members,
            "errors": f"{self.process.width} coordinates",
            "measurements": listed(f"{name} ({size})" for name, size in self._measured.sizes.items()),
        }
        found = zip(self.process.names, np.sqrt(np.maximum(np.diagonal(self.P[0]), 0.0)), strict=True)
        return Overview("Filter", facts, tuple(NumberRow(name, one) for name, one in found), "deviation")

    @property
    def rows(self) -> np.ndarray:
        """The estimates as rows of the process, (members, size), of one filter (1, size); others may be set."""
        return self._held.rows

    @rows.setter
    def rows(self, rows: np.ndarray) -> None:
        shape = (1 if self.members is None else self.members, len(self.process.example))
        self._held = self._held._replace(rows=array(rows, "rows", shape))

    @property
    def P(self) -> np.ndarray:
        """The covariances of the errors, (members, n, n), of one filter (1, n, n); others may be set."""
        return self._held.P

    @P.setter
    def P(self, P: np.ndarray) -> None:
        n = self.process.width
        shape = (1 if self.members is None else self.members, n, n)
        self._held = self._held._replace(P=array(P, "P", shape))

    @property
    def t(self) -> float:
        """The time of the estimate, s."""
        return float(self.process.time(self.rows[0]))

    @property
    def state(self) -> State:
        """The estimated state; of many members with a leading axis in every leaf."""
        return self.process.state(self.rows[0] if self.members is None else self.rows)

    @property
    def covariance(self) -> np.ndarray:
        """P, (n, n), of the errors by the `names` of the process; (members, n, n) of many."""
        return self.P[0].copy() if self.members is None else self.P.copy()

    @property
    def deviations(self) -> dict[str, PyTree]:
        """Standard deviations by the names of the coordinates of the error."""
        roots = np.sqrt(np.maximum(np.diagonal(self.P, axis1=1, axis2=2), 0.0))
        rows = roots[0].tolist() if self.members is None else roots.T
        return dict(zip(self.process.names, rows, strict=True))

    def expected(self, rows: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Name of a measurement → its values without noise, (…, m), at rows of the process (…, size).

        rows: by default the estimate's, with an axis of members if there are many. Values are numbers as `update` takes
        them. Raises ArgumentError for others.
        """
        return self._readings(rows, None)

    def drawn(self, rows: np.ndarray, random: np.random.Generator) -> dict[str, np.ndarray]:
        """As `expected`, with noise from `random`: measurements of true states, on the side on which each errs.

        Raises ArgumentError for other rows, and unless `random` is an np.random.Generator.
        """
        checks.instance(random, "random", np.random.Generator, "np.random.default_rng(seed)")
        return self._readings(rows, random)

    def _readings(self, rows: PyTree, random: np.random.Generator | None) -> dict[str, np.ndarray]:
        here = self.rows[0] if self.members is None else self.rows
        return self._measured.readings(here if rows is None else rows, random)
