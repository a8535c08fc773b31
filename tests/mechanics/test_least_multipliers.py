"""The least multipliers of redundant rows, in closed form."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.multipliers import _spread


@pytest.mark.parametrize("independent", [(0, 2), (1, 3), (2, 4)])
def test_redundant_rows_share_the_least_multipliers_with_the_reaction_of_the_independent_ones(independent):
    """λ = (Aᵀ)⁺ Aᵀλ₀ of A of rank 2, where λ₀ is zero at redundant rows and the matrix is A M⁻¹Aᵀ."""
    random = np.random.default_rng(8)
    A = random.normal(size=(5, 2)) @ random.normal(size=(2, 6))
    masses = np.array([1.0, 2.0, 3.0, 1.0, 5.0, 0.5])
    strength = np.zeros(5)
    strength[list(independent)] = random.normal(size=2)
    found = evaluate(lambda M, s: _spread(jnp.asarray(M), s, independent), A / masses @ A.T, strength)
    np.testing.assert_allclose(A.T @ found, A.T @ strength, atol=1e-12)
    np.testing.assert_allclose(found, np.linalg.pinv(A.T) @ (A.T @ strength), atol=1e-12)
    held = np.isin(np.arange(5), independent).astype(float)
    traced = evaluate(lambda M, s, held: _spread(jnp.asarray(M), s, held), A / masses @ A.T, strength, held)
    np.testing.assert_allclose(traced, found, atol=1e-12)


def test_without_redundant_rows_multipliers_stay():
    strength = np.arange(3.0)
    assert _spread(jnp.eye(3), strength, None) is strength  # pyright: ignore[reportArgumentType]
