"""Losses that outliers do not dominate: the cost ρ(d²) of the Mahalanobis distance d of a value from its expectation.

A least-squares problem has ρ = ½d². With another ρ its minimum is that of least squares whose covariances R are divided
by the weights w = 2ρ'(d²), found by iteration: R/w of a value far off is large.

Sources: P. J. Huber, *Robust estimation of a location parameter*, Ann. Math. Statist. 35 (1964); K. L. Lange,
R. J. A. Little, J. M. G. Taylor, *Robust statistical modeling using the t distribution*, J. Amer. Statist. Assoc. 84
(1989).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree


class Loss(ABC):
    """ρ of squared distances d² of values of m numbers."""

    @abstractmethod
    def weight(self, square: np.ndarray, m: int) -> np.ndarray:
        """w = 2ρ'(d²) of d², of its shape, for values of m numbers."""

    @property
    @abstractmethod
    def information(self) -> float:
        """The part that the curvature Σ w JᵀJ of iterated weights holds of the information of the noise."""

    @abstractmethod
    def scale(self, squares: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Σ of d² with which a variance is estimated, over its expectation for noise of this kind: (…,) along the last
        axis."""

    @abstractmethod
    def cost(self, square: PyTree, m: int, xp: PyTree) -> PyTree:
        """ρ of d² by the functions of a module, such as numpy or casadi."""

    @abstractmethod
    def numbers(self, m: int) -> tuple[float, float, float]:
        """(a, b, c) with w = min(1, a/d) where c = 0, and w = a/(b + d²) where c = 1."""


@dataclass(frozen=True)
class Huber(Loss):
    """ρ = ½d² up to d = k, and k d − ½k² beyond: as least squares near, as least absolute values far away.

    threshold: k of one number, in standard deviations, by default 1.345, which costs 5 % of the efficiency for normal
    noise. For values of m numbers k is the quantile of χ_m with the probability that one number is within `threshold`.
    Raises ArgumentError unless it is positive.
    """

    threshold: float = 1.345

    def __post_init__(self) -> None:
        checks.positive(self.threshold, "Argument `threshold` of co.losses.Huber")

    def reach(self, m: int) -> float:
        """k of values of m numbers."""
        from scipy.special import erfc, gammainccinv

        return float(np.sqrt(2 * gammainccinv(m / 2, erfc(self.threshold / np.sqrt(2)))))

    def weight(self, square: np.ndarray, m: int) -> np.ndarray:
        return np.minimum(1.0, self.reach(m) / np.sqrt(np.maximum(square, 1e-300)))

    @property
    def information(self) -> float:
        return 1.0

    def scale(self, squares: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Proposal 2 of Huber: Σ ψ²/E ψ², ψ = wd, of normal noise."""
        from scipy.special import erfc

        k = self.threshold
        beyond, density = erfc(k / np.sqrt(2)), np.exp(-(k**2) / 2) / np.sqrt(2 * np.pi)
        return np.sum(weights**2 * squares, axis=-1) / (1 - beyond - 2 * k * density + k**2 * beyond)

    def cost(self, square: PyTree, m: int, xp: PyTree) -> PyTree:
        k = self.reach(m)
        return 0.5 * xp.fmin(square, k * k) + k * (xp.sqrt(xp.fmax(square, k * k)) - k)

    def numbers(self, m: int) -> tuple[float, float, float]:
        return self.reach(m), 0.0, 0.0


@dataclass(frozen=True)
class Student(Loss):
    """ρ = ½(n + m) log(1 + d²/n) of Student's t with n degrees of freedom: a value far away has no influence.

    degrees: n, by default 4. Covariances are those of the scale, of which the noise has n/(n − 2).
    Raises ArgumentError unless n is at least 1.
    """

    degrees: float = 4.0

    def __post_init__(self) -> None:
        checks.number(self.degrees, "Argument `degrees` of co.losses.Student", least=1.0)

    def weight(self, square: np.ndarray, m: int) -> np.ndarray:
        return (self.degrees + m) / (self.degrees + square)

    @property
    def information(self) -> float:
        return (self.degrees + 1) / (self.degrees + 3)

    def scale(self, squares: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return np.sum(weights * squares, axis=-1)

    def cost(self, square: PyTree, m: int, xp: PyTree) -> PyTree:
        return 0.5 * (self.degrees + m) * xp.log(1 + square / self.degrees)

    def numbers(self, m: int) -> tuple[float, float, float]:
        return float(self.degrees + m), float(self.degrees), 1.0


def require_loss(value: object, name: str) -> None:
    """Raise ArgumentError unless it is None or a Loss."""
    checks.expect(value is None or isinstance(value, Loss), value, name, "co.losses.Huber() or co.losses.Student()")
