"""Zeros of functions of one number."""

import numpy as np
import pytest
from scipy.optimize import brentq

from coadjoint.roots import brent


def functions():
    random = np.random.default_rng(3)
    for _ in range(200):
        c, (a, b) = random.normal(size=5), sorted(random.uniform(-3, 3, 2))
        for f in (
            lambda x, c=c: float(np.polyval(c, x) + np.sin(5 * x)),
            lambda x, c=c: float(np.tanh(40 * (x - c[0]))),
        ):
            if f(a) * f(b) < 0:
                yield f, a, b


@pytest.mark.parametrize("rtol", [4 * np.finfo(float).eps, 1e-14])
def test_the_zero_is_the_number_that_scipy_finds(rtol):
    found = [(brent(f, a, b, rtol=rtol), brentq(f, a, b, xtol=1e-15, rtol=rtol)) for f, a, b in functions()]
    assert len(found) > 100
    assert all(own == scipys for own, scipys in found)


def test_a_triple_zero_between_far_ends_is_found_where_interpolation_fails():
    assert brent(lambda x: (x - 0.3) ** 3, -1e3, 2e3) == pytest.approx(0.3, abs=1e-5)


def test_equal_signs_and_nan_are_refused():
    with pytest.raises(ValueError, match="different signs"):
        brent(lambda x: x * x + 1, -1.0, 1.0)
    with pytest.raises(ValueError, match="No zero"):
        brent(lambda x: x if abs(x) == 1 else float("nan"), -1.0, 1.0)
    with pytest.raises(ValueError, match="must be a number at a = 0 and b = 1"):
        brent(lambda x: float("nan") if x else -1.0, 0.0, 1.0)


def test_an_end_that_is_a_zero_is_the_zero():
    assert brent(lambda x: x - 2, 2.0, 5.0) == 2.0 and brent(lambda x: x - 5, 2.0, 5.0) == 5.0
