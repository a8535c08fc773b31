"""Functions of t = θ² that the closed forms of rotations need, smooth through θ = 0.

Below t = 4 a power series, above it the closed form; both sides agree to round-off in value and in the first two
derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import comb, factorial
from typing import Any

import jax
import jax.numpy as jnp

Array = Any

_SWITCH = 4.0
_TERMS = 18


def _smooth(t: Array, series: Sequence[float], closed: Callable[[Array], Array]) -> Array:
    """Σ c_k tᵏ for t < 4, closed(θ) above; neither is evaluated outside its domain, so derivatives exist."""
    near = t < _SWITCH
    inner = jnp.where(near, t, 0.0)
    total = jnp.zeros_like(inner)
    for coefficient in reversed(series):
        total = total * inner + coefficient
    return jnp.where(near, total, closed(jnp.sqrt(jnp.where(near, _SWITCH, t))))


def sine_ratio(t: Array) -> Array:
    """sin θ / θ of t = θ², an array of any shape."""
    series = [(-1) ** k / factorial(2 * k + 1) for k in range(_TERMS)]
    return _smooth(t, series, lambda angle: jnp.sin(angle) / angle)


def versine_ratio(t: Array) -> Array:
    """(1 − cos θ) / θ² of t = θ², an array of any shape."""
    series = [(-1) ** k / factorial(2 * k + 2) for k in range(_TERMS)]
    return _smooth(t, series, lambda angle: 2 * (jnp.sin(angle / 2) / angle) ** 2)


def cubic_ratio(t: Array) -> Array:
    """(θ − sin θ) / θ³ of t = θ², an array of any shape."""
    series = [(-1) ** k / factorial(2 * k + 3) for k in range(_TERMS)]
    return _smooth(t, series, lambda angle: (angle - jnp.sin(angle)) / angle**3)


def quartic_ratio(t: Array) -> Array:
    """(θ²/2 − 1 + cos θ) / θ⁴ of t = θ², an array of any shape."""
    series = [(-1) ** k / factorial(2 * k + 4) for k in range(_TERMS)]
    return _smooth(t, series, lambda angle: (0.5 - 2 * (jnp.sin(angle / 2) / angle) ** 2) / angle**2)


def _bernoulli(count: int) -> list[Fraction]:
    """B₀, …, B_count by Σ_{k≤m} C(m+1, k) B_k = 0."""
    numbers = [Fraction(1)]
    for m in range(1, count + 1):
        numbers.append(-sum((comb(m + 1, k) * numbers[k] for k in range(m)), Fraction(0)) / (m + 1))
    return numbers


BERNOULLI = [float(b / factorial(n)) for n, b in enumerate(_bernoulli(2 * _TERMS))]
"""The coefficients B_n/n! of x/(eˣ − 1), which converge for |x| < 2π."""

_COTANGENT = [float(abs(b) / factorial(2 * n)) for n, b in enumerate(_bernoulli(2 * _TERMS)[::2]) if n > 0]


def cotangent_ratio(t: Array) -> Array:
    """β = (1 − (θ/2) cot(θ/2)) / θ² = Σ |B₂ₙ| t^{n−1} / (2n)! of t = θ², any shape; singular at θ = 2π.

    (P93), (P95) have it at θ = h‖ω‖.
    """
    return _smooth(t, _COTANGENT, lambda angle: (1 - angle / 2 / jnp.tan(angle / 2)) / angle**2)


def cotangent_ratio_derivative(t: Array) -> Array:
    """dβ/dt of t, an array of any shape."""
    return jax.jvp(cotangent_ratio, (t,), (jnp.ones_like(t),))[1]
