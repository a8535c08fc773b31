"""Drift models of numbers that a filter estimates with the motion: random walks and Gauss–Markov processes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree, Scalar
from coadjoint.estimation.numbers import numbers
from coadjoint.kernels.trace.evaluate import traced


class Drift(ABC):
    """θ between two nodes: θ_{k+1} = m + φ(h)(θ_k − m) + w, w normal with a variance q(h); each number by itself."""

    mean: PyTree = 0.0
    """m, one number or (k,)."""

    @abstractmethod
    def factor(self, h: Scalar) -> Scalar:
        """φ(h), one number."""

    @abstractmethod
    def variance(self, h: Scalar) -> Scalar:
        """q(h), one number or one for each of θ."""


@dataclass(frozen=True)
class RandomWalk(Drift):
    """θ̇ = w with a white w: a deviation of density·√t after t. density: unit of θ per √s, one number or an array.

    density = 0 is an unknown constant. Raises ArgumentError for a density that is negative or not finite.
    """

    density: Any = 0.0

    def __post_init__(self):
        object.__setattr__(self, "density", not_negative(self.density, "density", "co.estimation.RandomWalk"))

    def factor(self, h: Scalar) -> Scalar:
        """1."""
        return 1.0

    def variance(self, h: Scalar) -> Scalar:
        """density² h."""
        return self.density**2 * h


@dataclass(frozen=True)
class GaussMarkov(Drift):
    """θ̇ = −(θ − m)/τ + w, of first order: a stationary deviation about a mean m, and a correlation exp(−t/τ).

    deviation: in the unit of θ, one number or an array. time: τ, s, positive. mean: m, to which θ returns without
    measurements, in the unit of θ, one number or an array, by default 0. Raises ArgumentError for others.
    """

    deviation: Any
    time: float
    mean: PyTree = 0.0

    def __post_init__(self):
        object.__setattr__(self, "deviation", not_negative(self.deviation, "deviation", "co.estimation.GaussMarkov"))
        object.__setattr__(self, "time", checks.positive(self.time, "Argument `time` of co.estimation.GaussMarkov"))
        object.__setattr__(self, "mean", finite(self.mean, "mean", "co.estimation.GaussMarkov"))

    def factor(self, h: Scalar) -> Scalar:
        """exp(−h/τ)."""
        return _of(h).exp(-h / self.time)

    def variance(self, h: Scalar) -> Scalar:
        """deviation² (1 − exp(−2h/τ))."""
        return -(self.deviation**2) * _of(h).expm1(-2.0 * h / self.time)


def _of(h: Scalar) -> Any:
    """The module of functions of h: NumPy, unless JAX traces it."""
    return jnp if traced(h) else np


def require_drift(value: object, name: str) -> None:
    """Raise ArgumentError unless this is a drift."""
    checks.instance(value, f"The drift of `{name}`", Drift, "a co.estimation.RandomWalk or GaussMarkov")


def not_negative(value: object, name: str, whose: str) -> np.ndarray:
    """A standard deviation or a density as float64; raises ArgumentError unless it is finite and not negative."""
    found = numbers(value)
    fits = np.all(np.isfinite(found) & (found >= 0))
    checks.expect(fits, value, f"Argument `{name}` of {whose}", "numbers that are finite and not negative")
    return found


def finite(value: object, name: str, whose: str) -> np.ndarray:
    """Numbers as float64; raises ArgumentError unless they are finite."""
    found = numbers(value)
    checks.expect(np.all(np.isfinite(found)), value, f"Argument `{name}` of {whose}", "finite numbers")
    return found
