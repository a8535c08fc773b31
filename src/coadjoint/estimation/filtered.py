"""The estimates of a filter over a log, and the true states to compare them with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.estimation.process import Process
from coadjoint.estimation.timetable import SAME
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.simulation.run import Run

FAR = 10.0
"""The factor by which a mean NIS may differ from its expectation before the printed line says so."""

EXACT = (
    "The NEES needs covariances that can be inverted, but a combination of coordinates is known exactly: give every "
    "error of the start a deviation, or the model noise."
)
SINGULAR, ROUND_OFF = 1e-12, 1e-9
"""The parts of the largest eigenvalue of a covariance that is scaled by deviations, and of the largest deviation of a
name, up to which constraints exclude a direction."""


class Consistency(NamedTuple):
    """times (K,) s, NIS = νᵀS⁻¹ν (K,), NaN where nothing was measured, and whether it was used (K,).

    recovered: whether `after_rejections` let it be used, (K,). Of many members all but `times` are (K, members).
    """

    times: np.ndarray
    nis: np.ndarray
    used: np.ndarray
    recovered: np.ndarray | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Filtered:
    """The estimates of a filter at the nodes of a log; `print` shows the measurements used and their mean NIS.

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
    _process: Process = field(repr=False)
    every: int = 1
    """Every how many nodes were kept."""
    _sizes: Mapping[str, int] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        return f"<Filtered: {len(self.t):,} nodes to {self.t[-1]:.6g} s; print it for the NIS of its measurements>"

    def __str__(self) -> str:
        """The used part of every measurement, and its mean NIS next to its expectation, the count of its numbers."""
        lines = [("nodes", f"{len(self.t):,} from {self.t[0]:.6g} s to {self.t[-1]:.6g} s, every {self.every}")]
        for name, one in self.nis.items():
            measured, again = np.isfinite(one.nis), np.zeros(0, int)
            if one.recovered is not None and one.recovered.any():
                again = np.flatnonzero(one.recovered.reshape(len(one.times), -1).any(axis=1))
                measured &= ~one.recovered
            nis, m = one.nis[measured & one.used], self._sizes.get(name, 1)
            text = f"{np.count_nonzero(one.used):,} of {np.size(one.used):,} used"
            if len(nis):
                text += f", their mean NIS {np.mean(nis):.3g}, of a consistent filter {m}"
            if (len(nis) and np.mean(nis) > FAR * m) or len(nis) < 0.5 * np.count_nonzero(measured):
                text += ": its values differ from those of the model; check units, axes, signs, gravity and noise"
            elif len(nis) and np.mean(nis) < m / FAR:
                text += ": far less; its covariance, or process noise, is too large, or times are not in seconds"
            if len(again):
                text += f"; recovered after rejections at {len(again)} times, first at {one.times[again[0]]:.6g} s"
            lines.append((name, text))
        width = max(len(name) for name, _ in lines)
        return "\n".join(f"{name:<{width}}  {text}" for name, text in lines)

    def replaced(self, rows: np.ndarray, deviations: np.ndarray, covariances: np.ndarray) -> Filtered:
        """A copy with other estimates of the same shapes."""
        return replace(self, rows=rows, deviations=deviations, covariances=covariances)

    @property
    def states(self) -> State:
        """The states, with a leading axis of nodes in every leaf."""
        return self._process.state(self.rows)

    def nees(self, truth: object, known: Mapping[str, object] | None = None) -> tuple[np.ndarray, int]:
        """(eᵀP⁻¹e, its degrees of freedom) at the nodes, (K,) or (K, members).

        truth: rows of the same shape; of a `ModelProcess` a run of co.simulate, read at the nodes, or states (K,); of a
            `StrapdownProcess` an `InertialState` (K,). Without an axis of members it is that of all of them.
        known: in addition to a run or states, true values of drifting numbers, name → number, (size,) or (K, size): of
            biases, which no run contains, and of parameters that changed; by default those of the run's system.

        Of a filter whose model and noise are those of the truth it is χ² with as many degrees of freedom: those of the
        directions that are not known exactly. Raises ArgumentError where the covariances were not kept, and where some
        combination of coordinates is known exactly and no coordinate by itself.
        """
        if self.covariances is None:
            raise ArgumentError("The NEES needs the covariances: run the filter with covariances=True.")
        if known is not None:
            checks.instance(known, "known", Mapping, "a dictionary of names and numbers")
        truth = self._process.rows_of(truth, self.t, known)
        if self.rows.ndim == 3 and np.shape(truth) == (len(self.t), self.rows.shape[2]):
            truth = np.broadcast_to(truth[:, None], self.rows.shape)
        checks.shape(truth, "truth", self.rows.shape)
        if not np.all(np.isfinite(truth)):
            raise ArgumentError("Argument `truth` must be finite at all nodes: end the run where the truth ends.")
        free = np.flatnonzero(np.all(self._doubtful, axis=tuple(range(self.deviations.ndim - 1))))
        e = (self._process.errors(self.rows, truth) / np.where(self.deviations > 0, self.deviations, 1.0))[..., free]
        spread = self.deviations[..., free]
        P = self.covariances[..., free[:, None], free] / (spread[..., :, None] * spread[..., None, :])
        if self._process.projector is not None:
            return _within(e, P)
        try:
            weighted = np.linalg.solve(P, e[..., None])[..., 0]
        except np.linalg.LinAlgError:
            raise ArgumentError(EXACT) from None
        return np.einsum("...i,...i->...", e, weighted), len(free)

    @property
    def _doubtful(self) -> np.ndarray:
        """Whether coordinates are not known exactly, (K, n), nor excluded by constraints, to round-off."""
        if self._process.projector is None:
            return self.deviations > 0
        largest = np.max(self.deviations, axis=tuple(range(self.deviations.ndim - 1)))
        sizes = np.concatenate(
            [np.full(one.stop - one.start, largest[one].max()) for one in self._process.places.values()]
        )
        return self.deviations > ROUND_OFF * sizes


def _within(e: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, int]:
    """(eᵀP⁺e (…,), the rank of P) of errors e (…, n) and covariances P (…, n, n) that constraints make singular.

    Raises ArgumentError where the rank changes.
    """
    sizes, directions = np.linalg.eigh(P)
    within = sizes > SINGULAR * sizes[..., -1:]
    ranks = np.unique(np.sum(within, axis=-1))
    if len(ranks) != 1:
        raise ArgumentError(EXACT)
    along = np.einsum("...ij,...i->...j", directions, e)
    return np.sum(np.where(within, along**2, 0.0) / np.where(within, sizes, 1.0), axis=-1), int(ranks[0])


def filtered(
    process: Any, plan: Any, output: np.ndarray, full: bool, one: bool, every: int, of: Mapping[str, int]
) -> Filtered:
    """From an output (members, …) of orders; one: whether there is no axis of members. of: numbers of measurements."""
    count, members = len(plan.times), len(output)
    size, n = len(process.example), process.width

    def rows(place: int, length: int, width: int) -> np.ndarray:
        found = output[:, place : place + length * width].reshape(members, length, width).transpose(1, 0, 2)
        return found[:, 0] if one else found

    P = rows(plan.P, count, n * n if full else n)
    covariances = P.reshape(*P.shape[:-1], n, n) if full else None
    variances = P if covariances is None else np.diagonal(covariances, axis1=-2, axis2=-1)
    nis = {}
    for name, (times, place) in plan.nis.items():
        found = rows(place, len(times), 2)
        nis[name] = Consistency(times, found[..., 0], found[..., 1] > 0, found[..., 1] > 1)
    return Filtered(
        plan.times, rows(plan.rows, count, size), np.sqrt(np.maximum(variances, 0.0)), covariances, nis, process.names,
        process, every, of,
    )  # fmt: skip


def states_at(truth: object, times: np.ndarray, system: System) -> State | None:
    """The states of `truth`, a run of `co.simulate` or states with an axis of nodes, at `times`, (K,) s; None for
    others.

    Raises ArgumentError unless they are states of `system` at these times.
    """
    if isinstance(truth, Run):
        begin, end = truth.records.t[[0, -1]]
        if times[0] < begin - SAME or times[-1] > end + SAME:
            raise ArgumentError(
                f"Argument `truth` is a run from {begin:g} s to {end:g} s, but the filter has nodes from "
                f"{times[0]:g} s to {times[-1]:g} s: end both alike."
            )
        truth = truth.at(times)
    if not isinstance(truth, State):
        return None
    fits = truth.places == system.places and np.shape(truth.t) == np.shape(times)
    checks.expect(fits, truth, "truth", f"{len(times)} states of the system of the filter, one for each node")
    if not np.max(np.abs(truth.t - times)) < SAME:
        raise ArgumentError("Argument `truth` has states of other times than the nodes: give the run itself.")
    return truth
