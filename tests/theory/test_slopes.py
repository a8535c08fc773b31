"""The slope of Λ along the ends of a step, and what a curve changes beyond them."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.theory.slopes import _through


@pytest.mark.parametrize("inner", [0, 2])
def test_a_slope_along_unknowns_is_one_along_the_ends_and_what_the_ends_do_not_see(inner):
    """∂_z = Eᵀ(D_F, ∂_s) + rest, E rest = 0."""
    random = np.random.default_rng(5)
    ends, slope = random.normal(size=(4, 4 + inner)), random.normal(size=4)
    _, _, free = np.linalg.svd(ends)
    rest = random.normal(size=inner) @ free[4:]
    group_part, shift, left = _through(jnp.asarray(ends), jnp.asarray(ends.T @ slope + rest), 3)
    np.testing.assert_allclose(np.append(group_part, shift), slope, rtol=1e-5)
    assert len(left) == (4 + inner if inner else 0)
    np.testing.assert_allclose(left, rest[: len(left)], atol=1e-5)
