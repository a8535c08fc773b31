"""What a filter estimated over a log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np


class Consistency(NamedTuple):
    """times (K,) s, NIS = νᵀS⁻¹ν (K,), NaN where nothing was measured, and whether it was used (K,).

    Of many members NIS and `used` are (K, members).
    """

    times: np.ndarray
    nis: np.ndarray
    used: np.ndarray


@dataclass(frozen=True, eq=False)
class Filtered:
    """What a filter estimated at the nodes of a log.

    t: (K,) s. rows: (K, size), the states as rows of the process, after the measurements at each node. deviations:
    (K, n), by `names`. covariances: P, (K, n, n), or None. nis: name of a measurement → `Consistency`.
    Of many members rows, deviations and covariances have an axis of members behind that of times.
    """

    t: np.ndarray
    rows: np.ndarray
    deviations: np.ndarray
    covariances: Any
    nis: dict[str, Consistency]
    names: tuple[str, ...]
    _state: Callable[[np.ndarray], Any] = field(repr=False)

    @property
    def states(self) -> Any:
        """The states, with a leading axis of nodes in every leaf."""
        return self._state(self.rows)


def filtered(process: Any, plan: Any, output: np.ndarray, whole: bool, one: bool) -> Filtered:
    """From an output (members, …) of orders; one: whether there is no axis of members."""
    count, members = len(plan.times), len(output)
    size, n = len(process.example), process.width

    def rows(place: int, length: int, width: int) -> np.ndarray:
        found = output[:, place : place + length * width].reshape(members, length, width).transpose(1, 0, 2)
        return found[:, 0] if one else found

    P = rows(plan.P, count, n * n if whole else n)
    covariances = P.reshape(*P.shape[:-1], n, n) if whole else None
    variances = P if covariances is None else np.diagonal(covariances, axis1=-2, axis2=-1)
    nis = {}
    for name, (times, place) in plan.nis.items():
        told = rows(place, len(times), 2)
        nis[name] = Consistency(times, told[..., 0], told[..., 1] > 0)
    return Filtered(
        plan.times, rows(plan.rows, count, size), np.sqrt(np.maximum(variances, 0.0)), covariances, nis, process.names,
        process.state,
    )  # fmt: skip
