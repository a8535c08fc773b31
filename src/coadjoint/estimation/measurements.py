"""Measurements: a function of the motion, its covariance, and a gate for outliers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.numbers import numbers


@dataclass(frozen=True, eq=False)
class Measurement:
    """y = function(motion [, p [, biases]]) + v, v normal with a covariance R.

    function: of a `co.mechanics.NodeMotion`, if it takes more arguments of the parameters of the system, and of the
        biases of the process by their names; arguments with defaults do not count. A number or an array, written with
        `jax.numpy`. A value that contains a NaN is left out completely.
    covariance: R, (m, m), or the variances (m,), or one number for all.
    gate: the probability with which a correct value is accepted, as 0.999: a value whose νᵀS⁻¹ν, with ν = y − ŷ
        and S its covariance, is beyond this quantile of χ² is left out. By default None, all are accepted.
    angles: whether the numbers are angles in rad, one truth value or (m,): then ν is the shorter way round. By default
        False.
    of_state: whether the function takes a `co.State` instead of the motion, as observations of a `co.Stepper` do. By
        default False.

    Raises ArgumentError for covariances that are not positive and for a gate that is not a probability.
    """

    function: Callable[..., PyTree]
    covariance: Any
    gate: float | None = None
    angles: Any = False
    of_state: bool = False

    def __post_init__(self):
        if not callable(self.function):
            raise ArgumentError(
                f"co.estimation.Measurement takes a function of the motion, but got {shown(self.function)}."
            )
        found = numbers(self.covariance)
        if not positive(found):
            raise ArgumentError(
                "Argument `covariance` of co.estimation.Measurement must be a positive number, positive variances (m,) "
                f"or a symmetric positive definite matrix (m, m), but is {shown(self.covariance)}."
            )
        object.__setattr__(self, "covariance", found)
        if self.gate is not None:
            checks.number(
                self.gate, "Argument `gate` of co.estimation.Measurement, a probability,", above=0.0, below=1.0
            )

    def turns(self, size: int, name: str) -> np.ndarray:
        """2π of each number that is an angle, 0 of others, (m,), of a function with m values."""
        angles = np.asarray(self.angles)
        if angles.dtype != bool or angles.shape not in ((), (size,)):
            raise ArgumentError(
                f"`angles` of `{name}` must be a truth value, or one for each of {size} numbers, but is "
                f"{shown(self.angles)}."
            )
        return np.broadcast_to(np.where(angles, 2 * np.pi, 0.0), (size,))

    def noise(self, size: int, name: str) -> np.ndarray:
        """R, (m, m), of a function with m values."""
        R = self.covariance
        if R.ndim == 2 and R.shape == (size, size):
            return R
        if R.shape not in ((), (size,)):
            raise ArgumentError(
                f"`{name}` has a covariance of the shape {R.shape}, but its function returns {size} numbers."
            )
        return np.diag(np.broadcast_to(R, (size,)))


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
