"""What filters hold, the innovation of a measurement, and the messages of a filter that fails. NumPy alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import StepError
from coadjoint.kernels.emit.filter_correction import STOP
from coadjoint.kernels.emit.kalman import PREDICT


class Innovation(NamedTuple):
    """The innovation of a measurement: NIS = νᵀS⁻¹ν with ν = y − ŷ, NaN where nothing was measured.

    used: whether it was used. recovered: whether `after_rejections` let it be. Of many members all are (members,).
    """

    nis: Any
    used: Any
    recovered: Any = False


class FilterMemory(NamedTuple):
    """What filters hold: rows (members, size), P (members, n, n), and counts of the values in a row beyond the gates of
    the measurements, (members, count)."""

    rows: np.ndarray
    P: np.ndarray
    rejected: np.ndarray


def failed_order(t: float, order: int, name: str, recovery: tuple[int, int], rejected: int) -> StepError:
    """The error of an order that failed at t, s: a prediction, or the correction by the measurement `name` with its
    `recovery`, of which so many values in a row were rejected."""
    if order != PREDICT and recovery[1] == STOP and rejected >= recovery[0]:
        return StepError(
            f"The filter stopped at t = {t:g} s: {recovery[0]} values of `{name}` in a row are beyond its "
            "gate. Check the sensor, its units and axes, and the noise of the process, or let "
            '`after_rejections` be "inflate" or "reset".'
        )
    what = "the model has no step from the estimate" if order == PREDICT else "a measurement has no finite NIS"
    return StepError(
        f"The filter failed at t = {t:g} s: {what}, or the covariance is not finite. A shorter dt, or deviations "
        "and noise closer to those of the measurements, may help."
    )


def require_finite(rows: np.ndarray, time: Callable[[np.ndarray], np.ndarray]) -> None:
    """Raise StepError where an estimate, a row of (members, size), is not finite, with the first time at which one
    was."""
    bad = ~np.all(np.isfinite(rows), axis=1)
    if np.any(bad):
        times = time(rows[bad])
        first = np.min(times, where=np.isfinite(times), initial=np.inf)
        when = f" up to t = {first:g} s" if np.isfinite(first) else ""
        raise StepError(
            f"The estimate does not stay finite{when}: a measurement is too far from its expectation; `gate` of "
            "its Measurement leaves such values out."
        )
