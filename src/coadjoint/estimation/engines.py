"""Engines that execute the orders of filters: machine code, or NumPy for functions that cannot be compiled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coadjoint.errors import StepError
from coadjoint.estimation.process import Process
from coadjoint.kernels.emit.kalman import CORRECT, PREDICT, SAVE, SET
from coadjoint.kernels.run.function import RowFunction
from coadjoint.kernels.run.kalman import Filters, MeasurementCode


def predicted(P: np.ndarray, Phi: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Φ P Φᵀ + Q, each (members, n, n)."""
    return symmetric(Phi @ P @ Phi.transpose(0, 2, 1) + Q)


def symmetric(P: np.ndarray) -> np.ndarray:
    """½ (P + Pᵀ)."""
    return 0.5 * (P + P.transpose(0, 2, 1))


class Correction(NamedTuple):
    """e (members, n) = K ν, P after it, and νᵀS⁻¹ν (members,)."""

    e: np.ndarray
    P: np.ndarray
    nis: np.ndarray


def corrected(P: np.ndarray, H: np.ndarray, R: np.ndarray, nu: np.ndarray) -> Correction:
    """By Joseph's form, P⁺ = (1 − KH) P (1 − KH)ᵀ + K R Kᵀ with K = P Hᵀ S⁻¹, S = H P Hᵀ + R.

    P: (members, n, n). H: (members, m, n). R: (m, m). nu: ν = y − ŷ, (members, m).
    """
    Ht = H.transpose(0, 2, 1)
    PHt = P @ Ht
    S = H @ PHt + R
    K = np.linalg.solve(S, PHt.transpose(0, 2, 1)).transpose(0, 2, 1)
    nis = np.einsum("bi,bi->b", nu, np.linalg.solve(S, nu[:, :, None])[:, :, 0])
    rest = np.eye(P.shape[1]) - K @ H
    after = rest @ P @ rest.transpose(0, 2, 1) + K @ R @ K.transpose(0, 2, 1)
    return Correction((K @ nu[:, :, None])[:, :, 0], symmetric(after), nis)


class PreparedMeasurement(NamedTuple):
    """A measurement with its function of (e, row), R (m, m), the largest NIS that is accepted, and each number's turn.

    The turn, (m,), is 2π of an angle and 0 of what does not turn.
    """

    name: str
    function: RowFunction
    covariance: np.ndarray
    gate: float
    turns: np.ndarray


class FilterEngine:
    """Orders for filters with rows (members, size) and P (members, n, n), which change in place."""

    def __init__(self, process: Process, measurements: Sequence[PreparedMeasurement]):
        self._process, self._measurements = process, list(measurements)
        model, functions = process.native(), [one.function.native for one in measurements]
        self._filters = None
        if model is not None and None not in functions:
            seen = [
                MeasurementCode(one.function.native, one.covariance, one.gate, one.turns)
                for one in measurements
                if one.function.native
            ]
            self._filters = Filters(model, seen)

    def follow(self, rows: np.ndarray, P: np.ndarray, orders: np.ndarray, data: np.ndarray, output: np.ndarray) -> None:
        """Execute orders (count, 4) of `kernels.emit.kalman`; data: (1 or members, …), output (members, …).

        Raises StepError where a step of the model, or a covariance, fails.
        """
        if self._filters is None:
            self._by_arrays(rows, P, orders, data, output)
            return
        for i in range(len(rows)):
            failed = self._filters.follow(rows[i], P[i], orders, data[i % len(data)], output[i])
            if failed >= 0:
                self._fail(rows[i], int(orders[failed, 0]))

    def _fail(self, row: np.ndarray, order: int) -> None:
        t = float(self._process.time(row))
        what = "the model has no step from the estimate" if order == PREDICT else "a measurement has no finite NIS"
        raise StepError(
            f"The filter failed at t = {t:g} s: {what}, or the covariance is not finite. A shorter dt, or deviations "
            "and noise closer to those of the measurements, may help."
        )

    def _by_arrays(self, rows: np.ndarray, P: np.ndarray, orders: np.ndarray, data: np.ndarray, output: np.ndarray):
        for order, a, b, c in orders.tolist():
            if order == PREDICT:
                h = float(data[0, a])
                after, course = self._process.stepped(rows, h)
                Phi, Q = self._process.linearised(rows, after, h, course)
                rows[:], P[:] = after, predicted(P, Phi, Q)
            elif order == SET:
                rows[:, self._process.commanded[a : a + b]] = data[:, c : c + b]
            elif order == CORRECT:
                self._correct(rows, P, self._measurements[a], data[:, b:], output[:, c : c + 2])
            elif order == SAVE:
                output[:, a : a + rows.shape[1]] = rows
                kept = P.reshape(len(P), -1) if c else np.diagonal(P, axis1=1, axis2=2)
                output[:, b : b + kept.shape[1]] = kept
            if not np.all(np.isfinite(np.trace(P, axis1=1, axis2=2))):
                self._fail(rows[0], order)

    def _correct(
        self, rows: np.ndarray, P: np.ndarray, one: PreparedMeasurement, values: np.ndarray, out: np.ndarray
    ) -> None:
        seen, H = one.function(np.zeros((len(rows), self._process.width)), rows)
        nu = values[:, : seen.shape[1]] - seen
        nu = nu - one.turns * np.floor(nu / np.where(one.turns > 0, one.turns, 1.0) + 0.5)
        known = np.all(np.isfinite(nu), axis=1)
        found = corrected(P, H, one.covariance, np.where(known[:, None], nu, 0.0))
        used = known & ~(found.nis > one.gate)
        out[:, 0], out[:, 1] = np.where(known, found.nis, np.nan), used
        if used.any():
            rows[used] = self._process.moved(rows[used], found.e[used])
            P[used] = self._process.admitted(rows[used], found.P[used])
