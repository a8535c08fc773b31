"""Measurements of one process: their innovations and readings as functions of its rows."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
from scipy.stats import chi2

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.estimation.measurements import Measurement
from coadjoint.estimation.process import Process
from coadjoint.kernels.run.function import RowFunction
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.trace_checks import in_words
from coadjoint.spaces.measured import MeasuredSpace
from coadjoint.spaces.measured_spaces import measured_space


class PreparedMeasurement(NamedTuple):
    """A measurement of a process.

    space: of its values. reading: h of a row. function: (e, (row, y)) ↦ h ⊖ y of `spaces.measured`, whose negative is
    ν. covariance: R (m, m). effective: that of the gain. gate: the largest NIS that is accepted. loss: its numbers.
    recovery: after how many values in a row beyond the gate what is done, of `kernels.emit.filter_correction`. trips:
    linearisations of an update.
    """

    name: str
    space: MeasuredSpace
    reading: Callable[[Array], PyTree]
    function: RowFunction
    covariance: np.ndarray
    effective: np.ndarray | None
    gate: float
    loss: tuple[float, float, float] | None
    recovery: tuple[int, int]
    trips: int

    def noise(self, count: int, random: np.random.Generator | None) -> np.ndarray:
        """Errors (count, m) with the covariance R, 0 without `random`."""
        e = np.zeros((count, self.space.dim))
        return e if random is None else random.normal(size=e.shape) @ np.linalg.cholesky(self.covariance).T

    def readings(self, example: np.ndarray) -> RowFunction:
        """(), (row, e) ↦ the numbers of the value with the error e."""

        def read(_: Array, y: Array) -> Array:
            return self.space.numbers(self.space.moved(self.reading(y[: len(example)]), y[len(example) :]))

        return RowFunction(read, np.zeros(0), np.concatenate([example, np.zeros(self.space.dim)]))


def prepared(process: Process, name: str, measurement: PyTree) -> PreparedMeasurement:
    """A measurement with its space, its innovation as a function, R and the largest NIS that is accepted."""
    checks.instance(measurement, f"`{name}` of `measurements`", Measurement, "a co.estimation.Measurement")
    what, example = f"the measurement `{name}`", process.example
    with in_words(f"The function of {what}"):
        reading = process.reading(measurement.function, measurement.of_state)
        value = evaluate(reading, example)
    space = measured_space(measurement.space, value, measurement.error_side, measurement.coordinates, what)
    if not all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(value)):
        raise ArgumentError(f"The function of {what} is not finite at the start of the process.")
    seen, R = evaluate(space.numbers, value), measurement.noise(space, name)

    def difference(e: Array, y: Array) -> Array:
        return space.difference(reading(process.retract(y[: len(example)], e)), y[len(example) :])

    with in_words(f"The function of {what}"):
        function = RowFunction(difference, np.zeros(process.width), np.concatenate([example, seen]))
    gate = np.inf if measurement.gate is None else float(chi2.ppf(measurement.gate, space.dim))
    loss = measurement.loss
    weights = None if loss is None else loss.numbers(space.dim)
    return PreparedMeasurement(
        name, space, reading, function, R, _effective(R, space), gate, weights, measurement.recovery, measurement.trips
    )


def _effective(R: np.ndarray, space: MeasuredSpace) -> np.ndarray | None:
    """R + R Ric R, the inverse of the information R⁻¹ − Ric that an element with the noise R has to first order in R;
    None where the space is flat.

    An update on a group by the inverse differentials of the logarithm at the residual e and at the correction η has the
    information (J⁻ᵀR⁻¹J⁻¹)(e) + (J⁻ᵀP⁻¹J⁻¹)(η). That of the posterior, whose density by Haar's measure has |J|⁻¹, has
    in addition eᵀR⁻¹∂²e + ηᵀP⁻¹∂²η, −⅔ Ric in the mean over all y for any P and R, and −⅓ Ric of log |J|.
    """
    curvature = space.curvature
    return R + R @ curvature @ R if curvature.any() else None
