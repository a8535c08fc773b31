"""Measurements: a function of the motion, the space of its values, their noise, and a gate for outliers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.numbers import numbers
from coadjoint.kernels.emit.filter_correction import INFLATE, RESET, STOP
from coadjoint.log import logger
from coadjoint.losses import Loss, require_loss
from coadjoint.spaces.measured import MeasuredSpace

_LOG = logger(__name__)

RECOVERIES = {"inflate": INFLATE, "reset": RESET, "stop": STOP}


@dataclass(frozen=True, eq=False)
class Measurement:
    """y = function(motion [, p [, biases]]) with an error e, normal with a covariance R, in a space.

        Measurement(lambda motion: motion.q[2], deviation=0.05)
        Measurement(lambda motion: motion.g, space=co.SO3(), deviation=0.01, error_side="body", coordinates="wxyz")
        Measurement(lambda motion: motion.a.north, space=co.Sphere(), deviation=0.02)

    Of vectors y = h + e; on a group y = h exp(e), or exp(e) h, and the innovation is ν = log(h⁻¹y), or log(yh⁻¹); a
    direction is on the sphere, and its e in the tangent plane. R, NIS and gates are of the dimension m of e, 3 of an
    attitude, 2 of a direction. H = −∂ν/∂(error of the state) holds the inverse differential dlog at y.

    function: of a `co.mechanics.NodeMotion`, if it takes more arguments of the parameters of the system, and of the
        biases of the process by their names; arguments with defaults do not count. It returns a value of the space,
        written with `jax.numpy`. A measured value that contains a NaN is left out completely.
    covariance: R, (m, m), or the variances (m,), or one number for all.
    deviation: instead of it standard deviations of e, (m,), or one number for all, in rad where e is an angle.
    gate: the probability with which a correct value is accepted, as 0.999: a value whose νᵀS⁻¹ν, with S the
        covariance of ν, is beyond this quantile of χ² of m is left out. By default None, all are accepted.
    of_state: whether the function takes a `co.State` instead of the motion, as observations of a `co.Stepper` do. By
        default False.
    space: None for vectors, a number or an array; a group, whose elements the function returns, as co.SO3(), co.SE3();
        co.SO2() also for numbers, angles in rad; co.Sphere() for directions (3,), of which only the direction counts;
        or a tuple of spaces, for a function that returns a tuple.
    error_side: "body", y = h exp(e), e in the axes that g leads from, or "space", y = exp(e) h. By default "body".
    coordinates: the numbers that values are on co.SO3(), and on co.SE3() followed by the position: "wxyz" or "xyzw",
        unit quaternions, of which q and −q are one attitude; "zyx", (yaw, pitch, roll); "rpy", (roll, pitch, yaw). On
        co.Sphere() "bearing", (bearing, elevation) from x to y and up, with e along both. Of a tuple a tuple. By
        default None: the arrays of an element, flat.
    after_rejections: (n, "inflate"), (n, "reset") or (n, "stop"): what happens with the n-th value in a row beyond the
        gate. "inflate" multiplies P by its NIS/m and takes the value; "reset" moves the estimate onto the value, with
        HP⁺Hᵀ = R, as if what was known of it before were wrong; "stop" raises StepError. By default all such values are
        left out. `found.nis[name].recovered` and `Innovation.recovered` say where it happened.
    iterations: how many times an update linearises the function, each time at the estimate that the last one found, as
        Gauss and Newton do, for a prior that is vague and a sensor that is precise. By default 2 with a `space`, and 1
        without, Kalman's own update.
    loss: `co.losses.Huber()` or `Student()`, with which a value far off counts less; by default least squares.

    Raises ArgumentError for covariances that are not positive and for a gate that is not a probability.
    """

    function: Callable[..., PyTree]
    covariance: Any = None
    gate: float | None = None
    of_state: bool = False
    deviation: Any = field(default=None, kw_only=True)
    space: Any = field(default=None, kw_only=True)
    error_side: str = field(default="body", kw_only=True)
    coordinates: Any = field(default=None, kw_only=True)
    after_rejections: tuple[int, str] | None = field(default=None, kw_only=True)
    loss: Loss | None = field(default=None, kw_only=True)
    iterations: int | None = field(default=None, kw_only=True)

    def __post_init__(self):
        checks.function(self.function, "The function of co.estimation.Measurement", "a function of the motion")
        if (self.covariance is None) == (self.deviation is None):
            raise ArgumentError("Give co.estimation.Measurement either a `covariance` or a `deviation` of its noise.")
        if self.deviation is not None and not (np.ndim(self.deviation) < 2 and positive(numbers(self.deviation))):
            raise ArgumentError(
                "Argument `deviation` of co.estimation.Measurement must be a positive number, or one for each number "
                f"of the noise, but is {shown(self.deviation)}."
            )
        found = numbers(self.covariance) if self.deviation is None else numbers(self.deviation) ** 2
        if not positive(found):
            raise ArgumentError(
                "Argument `covariance` of co.estimation.Measurement must be a positive number, positive variances (m,) "
                f"or a symmetric positive definite matrix (m, m), but is {shown(self.covariance)}."
            )
        object.__setattr__(self, "covariance", found)
        require_loss(self.loss, "Argument `loss` of co.estimation.Measurement")
        if self.gate is not None:
            checks.number(
                self.gate, "Argument `gate` of co.estimation.Measurement, a probability,", above=0.0, below=1.0
            )

        if self.iterations is not None:
            checks.whole(self.iterations, "Argument `iterations` of co.estimation.Measurement", 1)
        if self.after_rejections is not None:
            self._require_rejections()

    def _require_rejections(self) -> None:
        given, what = self.after_rejections, "`after_rejections` of co.estimation.Measurement"
        if not (isinstance(given, tuple) and len(given) == 2):
            raise ArgumentError(f'{what} must be a count and a word, as (10, "reset"), but is {shown(given)}.')
        checks.whole(given[0], f"The count of {what}", 1)
        checks.choice(given[1], f"The word of {what}", tuple(RECOVERIES))
        if self.gate is None:
            raise ArgumentError(f"{what} needs a `gate`: without one no value is left out.")

    @property
    def recovery(self) -> tuple[int, int]:
        """How many values in a row beyond the gate bring an action, and which one; 0 for none."""
        count, word = (0, "") if self.after_rejections is None else self.after_rejections
        return count, RECOVERIES.get(word, 0)

    @property
    def trips(self) -> int:
        """How many times an update linearises the function."""
        return (1 if self.space is None else 2) if self.iterations is None else self.iterations

    def noise(self, space: MeasuredSpace, name: str) -> np.ndarray:
        """R, (m, m), of values in a space."""
        R, m = self.covariance, space.dim
        if R.ndim == 2 and R.shape == (m, m):
            return R
        if R.shape not in ((), (m,)):
            raise ArgumentError(
                f"`{name}` has a covariance of the shape {R.shape}, but its noise has {m} numbers, on {space.title}."
            )
        return np.diag(np.broadcast_to(R, (m,)))


def report_recovery(name: str, measurement: Measurement, t: float) -> None:
    """Log that `after_rejections` acted at t, s."""
    count, word = measurement.after_rejections or (0, "")
    did = {"inflate": "P was inflated for it", "reset": "the estimate was reset to it"}[word]
    _LOG.info("`%s` at t = %g s is value %d in a row beyond its gate, and %s.", name, t, count, did)


def positive(R: np.ndarray) -> bool:
    """Whether these are variances or a covariance that is symmetric and positive definite."""
    if not np.all(np.isfinite(R)) or R.ndim > 2:
        return False
    if R.ndim < 2:
        return bool(np.all(R > 0))
    return R.shape[0] == R.shape[1] and semidefinite(R) and bool(np.all(np.linalg.eigvalsh(R) > 0))


def semidefinite(P: np.ndarray) -> bool:
    """Whether a square matrix is symmetric and has no negative eigenvalues, both up to round-off of its diagonal."""
    variances = np.diag(P)
    if not np.all(np.isfinite(P)) or np.any(variances < 0):
        return False
    roots = np.sqrt(np.where(variances > 0, variances, 1.0))
    relative = P / np.outer(roots, roots)
    return bool(np.all(np.abs(relative - relative.T) < 1e-9) and np.linalg.eigvalsh(relative)[0] > -1e-9)
