"""Engines that execute the orders of filters: machine code, or NumPy for functions that cannot be compiled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from coadjoint.estimation.innovation import FilterMemory, failed_order, require_finite
from coadjoint.estimation.prepared import PreparedMeasurement
from coadjoint.estimation.process import Process
from coadjoint.kernels.emit.filter_correction import INFLATE, RESET, SETTLED, STOP, SURE, TINY, TRIPS
from coadjoint.kernels.emit.kalman import CORRECT, PREDICT, SAVE, SET
from coadjoint.kernels.run.kalman import Filters, MeasurementCode, Model, OneFilter


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


def corrected(
    P: np.ndarray, H: np.ndarray, R: np.ndarray, nu: np.ndarray, sure: np.ndarray | None = None
) -> Correction:
    """By Joseph's form, P⁺ = (1 − KH) P (1 − KH)ᵀ + K R Kᵀ with K = P Hᵀ S⁻¹, S = H P Hᵀ + R, or R/sure (members,).

    P: (members, n, n). H: (members, m, n). R: (m, m), or (members, m, m). nu: ν, (members, m).
    """
    Ht = H.transpose(0, 2, 1)
    PHt = P @ Ht
    S = H @ PHt + (R if sure is None else R / sure[:, None, None])
    K = np.linalg.solve(S, PHt.transpose(0, 2, 1)).transpose(0, 2, 1)
    nis = np.einsum("bi,bi->b", nu, np.linalg.solve(S, nu[:, :, None])[:, :, 0])
    rest = np.eye(P.shape[1]) - K @ H
    after = rest @ P @ rest.transpose(0, 2, 1) + K @ R @ K.transpose(0, 2, 1)
    return Correction((K @ nu[:, :, None])[:, :, 0], symmetric(after), nis)


def robust(A: np.ndarray, R: np.ndarray, nu: np.ndarray, loss: tuple[float, float, float]) -> np.ndarray:
    """The weights w (members,) with which R/w is the covariance of the M-estimate: w = weight(s), s = d² = rᵀR⁻¹r, of
    the residual r = (R/w)S⁻¹ν that the correction leaves; of several the largest. A = HPHᵀ, (members, m, m).

    s is convex in w and s^(−½) concave, so that the root for the tangent of s (Student), or of s^(−½) (Huber), at a w
    above the solution lies above it too: Newton's steps from the largest weight pass no solution.
    """
    a, b, student = loss
    w = np.full(len(nu), a / b if student else 1.0)
    for _ in range(TRIPS):
        z = np.linalg.solve(A + R / w[:, None, None], nu[:, :, None])[:, :, 0]
        v = z @ R
        square = np.einsum("bi,bi->b", z, v) / w**2
        rest = np.einsum("bi,bi->b", v, np.linalg.solve(A + R / w[:, None, None], v[:, :, None])[:, :, 0]) / w**3
        if student:
            fall = np.maximum(square - rest, 0.0)  # −½ w ds/dw
            half = 0.5 * (b + square + 2 * fall)
            after = a / (half + np.sqrt(np.maximum(half**2 - 2 * a * fall / w, 0.0)))
        else:
            some = np.maximum(square, TINY)
            reach, kept = a / np.sqrt(some), np.where(square > TINY, rest / some, 1.0)
            near = np.minimum(reach / w, 1.0)
            after = np.minimum(1.0, reach * kept / (1 - near + near * kept))
        if np.all(np.abs(after - w) <= SETTLED * w):
            return after
        w = after
    return w


class CodedFilter(NamedTuple):
    """A filter as machine code: its model and its measurements."""

    model: Model
    measurements: list[MeasurementCode]


class FilterEngine:
    """Orders for filters, which change what these hold in place."""

    def __init__(self, process: Process, measurements: Sequence[PreparedMeasurement]):
        self._process, self._measurements = process, list(measurements)
        model, functions = process.native(), [one.function.native for one in measurements]
        self._filters, self.coded = None, None
        if model is not None and None not in functions:
            seen = [
                MeasurementCode(
                    one.function.native,
                    one.covariance,
                    one.gate,
                    one.space.size,
                    one.loss,
                    one.recovery,
                    one.trips,
                    one.effective,
                )
                for one in measurements
                if one.function.native
            ]
            self.coded = CodedFilter(model, seen)
            self._filters = Filters(model, seen)

    @property
    def unread(self) -> list[str]:
        """The inputs that neither a step nor a measurement reads."""
        functions = [self._process.tangent.native, *(one.function.native for one in self._measurements)]
        reads = [one.reads[: len(self._process.example)] for one in functions if one is not None]
        if len(reads) < len(functions):
            return []
        used, ends = np.any(reads, axis=0), np.cumsum([0, *self._process.input_sizes.values()])
        places = zip(self._process.input_sizes, ends, ends[1:], strict=False)
        names = [name for name, a, b in places if not used[self._process.commanded[a:b]].any()]
        return self._process.unread(names) if names else []

    coded: CodedFilter | None
    """The filter as machine code, None where it has none."""

    @cached_property
    def _alone(self) -> OneFilter | None:
        return None if self._filters is None else self._filters.alone()

    def once(
        self, memory: FilterMemory, order: int, number: int, data: np.ndarray | float
    ) -> tuple[FilterMemory, np.ndarray]:
        """Execute PREDICT, data h, or CORRECT of a measurement, data (1 or members, numbers).

        Returns what is held after it, and (NIS, used) (members, 2), which the next call overwrites. Raises StepError;
        `memory` is unchanged.
        """
        one = self._alone if len(memory.rows) == 1 else None
        if one is None:
            after, output = FilterMemory(*(part.copy() for part in memory)), np.empty((len(memory.rows), 2))
            orders = np.array([[order, number if order == CORRECT else 0, 0, 0]])
            self.follow(*after, orders, np.atleast_2d(data), output)
            return after, output
        one.row[:], one.P[:], one.rejected[:] = memory
        if isinstance(data, np.ndarray):
            one.data[: data.shape[1]] = data[0]
        else:
            one.data[0] = data
        if one(order, number):
            self._fail(one.row[0], np.array([order, number]), one.rejected[0])
        if not math.isfinite(one.flat.dot(one.flat)):
            require_finite(one.row, self._process.time)
        return FilterMemory(one.row.copy(), one.P.copy(), one.rejected.copy()), one.output

    def follow(
        self, rows: np.ndarray, P: np.ndarray, rejected: np.ndarray, orders: np.ndarray, data: np.ndarray,
        output: np.ndarray,
    ) -> None:  # fmt: skip
        """Execute orders (count, 4) of `kernels.emit.kalman`; data: (1 or members, …), output (members, …).

        Raises StepError where a step of the model, or a covariance, fails.
        """
        if self._filters is None:
            self._by_arrays(rows, P, rejected, orders, data, output)
            require_finite(rows, self._process.time)
            return
        for i in range(len(rows)):
            failed = self._filters.follow(rows[i], P[i], rejected[i], orders, data[i % len(data)], output[i])
            if failed >= 0:
                self._fail(rows[i], orders[failed], rejected[i])
        require_finite(rows, self._process.time)

    def _fail(self, row: np.ndarray, orders: np.ndarray, rejected: np.ndarray) -> None:
        t, order = float(self._process.time(row)), int(orders[0])
        if order == PREDICT:
            raise failed_order(t, order, "", (0, 0), 0)
        one = self._measurements[int(orders[1])]
        raise failed_order(t, order, one.name, one.recovery, int(rejected[orders[1]]))

    def _by_arrays(
        self, rows: np.ndarray, P: np.ndarray, rejected: np.ndarray, orders: np.ndarray, data: np.ndarray,
        output: np.ndarray,
    ) -> None:  # fmt: skip
        for number, (order, a, b, c) in enumerate(orders.tolist()):
            if order == PREDICT:
                h = float(data[0, a])
                after, course = self._process.stepped(rows, h)
                Phi, Q = self._process.linearised(rows, after, h, course)
                rows[:], P[:] = after, predicted(P, Phi, Q)
            elif order == SET:
                rows[:, self._process.commanded[a : a + b]] = data[:, c : c + b]
            elif order == CORRECT:
                given = data[:, b:], output[:, c : c + 2], rejected[:, a]
                stopped = self._correct(rows, P, self._measurements[a], *given)
                if stopped.any():
                    self._fail(rows[np.argmax(stopped)], orders[number], rejected[np.argmax(stopped)])
            elif order == SAVE:
                output[:, a : a + rows.shape[1]] = rows
                kept = P.reshape(len(P), -1) if c else np.diagonal(P, axis1=1, axis2=2)
                output[:, b : b + kept.shape[1]] = kept
            if not np.all(np.isfinite(np.trace(P, axis1=1, axis2=2))):
                self._fail(rows[0], orders[number], rejected[0])

    def _correct(
        self, rows: np.ndarray, P: np.ndarray, one: PreparedMeasurement, values: np.ndarray, out: np.ndarray,
        rejected: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """Returns which members stop, (members,)."""
        given = np.broadcast_to(values[:, : one.space.size], (len(rows), one.space.size))
        at = np.concatenate([rows, given], axis=1)
        off, H = one.function(np.zeros((len(rows), self._process.width)), at)
        known = np.all(np.isfinite(given), axis=1) & np.all(np.isfinite(off), axis=1)
        nu, H = np.where(known[:, None], -off, 0.0), np.where(known[:, None, None], H, 0.0)
        R, m, (limit, action) = one.covariance, one.space.dim, one.recovery
        nis = corrected(P, H, R, nu).nis
        beyond = known & (nis > one.gate)
        rejected[:] = np.where(beyond, rejected + 1, np.where(known, 0, rejected))
        acts = beyond & (action > 0) & (rejected >= limit)
        stopped, used = acts & (action == STOP), known & (~beyond | acts)
        rejected[acts & ~stopped] = 0
        P *= np.where(acts & (action == INFLATE), nis / m, 1.0)[:, None, None]
        R = R if one.effective is None else one.effective
        found = None
        for _ in range(one.trips):
            if found is not None:
                e = np.where(used[:, None], found.e, 0.0)
                off, H = one.function(e, at)
                nu = (H @ e[:, :, None])[:, :, 0] - off
                nu, H = np.where(known[:, None], nu, 0.0), np.where(known[:, None, None], H, 0.0)
            w = np.ones(len(rows)) if one.loss is None else robust(H @ P @ H.transpose(0, 2, 1), R, nu, one.loss)
            found = corrected(P, H, R / w[:, None, None], nu, np.where(acts & (action == RESET), SURE / w, 1.0))
        assert found is not None
        out[:, 0], out[:, 1] = np.where(known, nis, np.nan), np.where(acts, 2.0, used)
        if used.any():
            e, before = found.e[used], rows[used]
            rows[used] = self._process.moved(before, e)
            P[used] = self._process.admitted(rows[used], self._process.carried(found.P[used], e, before, rows[used]))
            P[used] = symmetric(P[used])
        return stopped
