"""Functions of t = θ², and of t = tan²(θ/2), that the closed forms of rotations need, smooth through θ = 0.

Below a switch a series, above it the closed form; both sides agree to round-off in value and in the first two
derivatives. The switch is t = 4 for power series in θ².
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache, partial, reduce
from math import comb, factorial

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array

_SWITCH = 4.0
_TERMS = 18
_TANGENT_SWITCH = 1 / 4
_LEVELS = 12


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
    return _smooth(t, _COTANGENT, lambda angle: (1 - angle / 2 * jnp.cos(angle / 2) / jnp.sin(angle / 2)) / angle**2)


def cotangent_ratio_derivative(t: Array) -> Array:
    """dβ/dt of t, an array of any shape."""
    return jax.jvp(cotangent_ratio, (t,), (jnp.ones_like(t),))[1]


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def arctangent_ratio(k: int, t: Array) -> Array:
    """A_k = ∫₀¹ u²ᵏ/(1 + tu²) du = Σ_j (−t)ʲ/(2j + 2k + 1), an array of any shape, smooth through t = 0.

    A₀ = arctan(τ)/τ of t = τ²; A_{k+1} = (1/(2k + 1) − A_k)/t; dA_k/dt = ½ ((2k + 1) A_{k+1} − 1/(1 + t)). Below
    t = 1/4 by Gauss's continued fraction, which is exact to round-off there, above it in closed form. The division
    comes last: XLA recomputes any other operation wherever its result is used.
    """
    near = t < _TANGENT_SWITCH
    inner, outer = jnp.where(near, t, 0.0), jnp.where(near, 1.0, t)
    tangent = jnp.sqrt(outer)
    above, below = jnp.arctan(tangent), tangent
    for j in range(k):
        above, below = 1 / (2 * j + 1) - above / below, outer
    numerator, denominator = (_horner(row, inner) for row in _convergent(k))
    return jnp.where(near, numerator, above) / jnp.where(near, denominator, below)


@cache
def _convergent(k: int) -> np.ndarray:
    """Coefficients of P and Q from the constant on, (2, 1 + LEVELS/2), with A_k = P(t)/Q(t).

    (2k + 1) A_k = 1/(1 + e₁t/(1 + e₂t/(1 + …))) with e_n = s²/((k + n − ½)(k + n + ½)), where s = n/2 of even n and
    k + n/2 of odd n; there are LEVELS of them.
    """
    size = 1 + _LEVELS // 2
    before, now = np.eye(1, size) * [[0.0], [1.0]], np.eye(1, size) * [[1.0], [1.0]]
    for n in range(1, _LEVELS + 1):
        half = n // 2 if n % 2 == 0 else k + n / 2
        e = half**2 / ((k + n - 0.5) * (k + n + 0.5))
        before, now = now, now + e * np.pad(before[:, :-1], ((0, 0), (1, 0)))
    return now / [[2 * k + 1], [1]]


def _horner(coefficients: np.ndarray, t: Array) -> Array:
    """Σ_i c_i tⁱ, an array of the shape of t."""
    return reduce(lambda value, c: value * t + c, coefficients[::-1].tolist())


@arctangent_ratio.defjvp
def _(k: int, primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    (t,), (along,) = primals, tangents
    slope = 0.5 * ((2 * k + 1) * arctangent_ratio(k + 1, t) - 1 / (1 + t))
    return arctangent_ratio(k, t), slope * along
