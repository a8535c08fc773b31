"""The functions of θ² behind the closed forms, against exact series in rational arithmetic."""

from __future__ import annotations

from fractions import Fraction
from math import comb, factorial

import jax
import numpy as np
import pytest

from coadjoint.groups import small_angle
from coadjoint.kernels.trace.evaluate import evaluate

TERMS = 60


def _bernoulli(count):
    numbers = [Fraction(1)]
    for m in range(1, count + 1):
        numbers.append(-sum((comb(m + 1, k) * numbers[k] for k in range(m)), Fraction(0)) / (m + 1))
    return numbers


SERIES = {
    "sine_ratio": [Fraction((-1) ** k, factorial(2 * k + 1)) for k in range(TERMS)],
    "versine_ratio": [Fraction((-1) ** k, factorial(2 * k + 2)) for k in range(TERMS)],
    "cubic_ratio": [Fraction((-1) ** k, factorial(2 * k + 3)) for k in range(TERMS)],
    "cotangent_ratio": [abs(b) / factorial(2 * n) for n, b in enumerate(_bernoulli(2 * TERMS)[::2]) if n > 0],
}


def exact(name: str, t: float, order: int) -> float:
    """The order-th derivative of the series at t, summed without round-off; at t ≤ 9 the rest is under 1e-30."""
    total = Fraction(0)
    for k, c in enumerate(SERIES[name]):
        if k >= order:
            total += c * (factorial(k) // factorial(k - order)) * Fraction(t) ** (k - order)
    return float(total)


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", SERIES)
@pytest.mark.parametrize("t", [0.0, 1e-18, 1e-6, 0.3, 3.999999, 4.0, 4.000001, 6.0, 9.0])
def test_value_and_two_derivatives(name, t):
    """The k-th derivative is a difference of terms like f/tᵏ, to which round-off is relative."""
    function = getattr(small_angle, name)
    found = evaluate(lambda t: (function(t), jax.grad(function)(t), jax.grad(jax.grad(function))(t)), t)
    for order, value in enumerate(found):
        terms = exact(name, t, 0) / max(t, 1.0) ** order
        np.testing.assert_allclose(value, exact(name, t, order), rtol=1e-14, atol=1e-14 * terms)


def test_derivative_of_the_cotangent_ratio():
    for t in (0.0, 1.0, 5.0):
        found = evaluate(small_angle.cotangent_ratio_derivative, t)
        np.testing.assert_allclose(found, exact("cotangent_ratio", t, 1), rtol=1e-14)
