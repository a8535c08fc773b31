"""The functions of which strains are made, against their integrals."""

import jax
import numpy as np
import pytest

from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models.rods.strains import _arctangent_ratio

NODES, WEIGHTS = np.polynomial.legendre.leggauss(60)
U = 0.5 * (NODES + 1)


def integral(k: int, n: int, t: float) -> float:
    """dⁿ/dtⁿ ∫₀¹ u²ᵏ/(1 + tu²) du by Gauss's rule."""
    factor = np.prod([-float(i) for i in range(1, n + 1)])
    return float(0.5 * WEIGHTS @ (factor * U ** (2 * k + 2 * n) / (1 + t * U**2) ** (n + 1)))


@pytest.mark.parametrize("t", [0.0, 1e-9, 0.03, 0.249, 0.251, 1.0, 4.0])
@pytest.mark.parametrize("k", [0, 1])
def test_ratios_of_the_arctangent_and_two_derivatives_are_their_integrals(k: int, t: float):
    def ratio(t):
        return _arctangent_ratio(k, t)

    for n, function in enumerate([ratio, jax.grad(ratio), jax.grad(jax.grad(ratio))]):
        found = float(evaluate(function, np.float64(t)))
        bound = 1e-15 * 4 ** (n + k)  # each further ratio loses as much where it leaves its series
        assert abs(found - integral(k, n, t)) < bound
