"""Linear systems of more unknowns than elimination with selections takes: by blocks, with pivots where these fail."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest
from equations import Equations, Still

from coadjoint.kernels.run import ensemble
from coadjoint.kernels.run.function import NativeFunction

SIZE = 14
RANDOM = np.random.default_rng(35)
BAND = np.abs(np.subtract.outer(np.arange(SIZE), np.arange(SIZE))) < 3
SOUND = np.where(BAND, RANDOM.normal(size=(SIZE, SIZE)), 0.0) + 8 * np.eye(SIZE)
UNSOUND = SOUND - 8 * np.eye(SIZE) * (np.arange(SIZE) < 3)  # replaced below: the first pivot block is singular
UNSOUND[:3, :3] = np.outer([1, 2, 3], [1, 1, 1])
RIGHT = RANDOM.normal(size=SIZE)


def solution(x, y):
    return jnp.linalg.solve(jnp.where(BAND, y[SIZE:].reshape(SIZE, SIZE), 0.0), x * y[:SIZE])


@pytest.mark.parametrize("matrix", [SOUND, UNSOUND], ids=["sound", "unsound"])
def test_the_solution_is_that_of_numpy_and_its_derivative_that_of_the_right_side(matrix):
    function = NativeFunction(solution, np.ones(SIZE), np.ones(SIZE + SIZE**2))
    given = np.concatenate([np.ones(SIZE), matrix.ravel()])
    value, slopes = function(RIGHT[None], given[None])
    np.testing.assert_allclose(value[0], np.linalg.solve(matrix, RIGHT), rtol=1e-12, atol=1e-13)
    if matrix is SOUND:
        np.testing.assert_allclose(slopes[0], np.linalg.inv(matrix), rtol=1e-11, atol=1e-13)


@dataclass(frozen=True)
class Solving(Equations):
    """A state that is divided by the matrix of its parameters."""

    def residual(self, p, s, h, z):
        return z - s

    def advance(self, p, s, h, z, sound=1.0):
        return jnp.linalg.solve(jnp.where(BAND, p, 0.0), s)


def test_only_lanes_whose_pivots_are_not_sound_are_solved_with_pivots():
    matrices, axes = np.stack([SOUND, UNSOUND, 2 * SOUND]), (True, False)
    end = ensemble.run_ensemble(Still((Solving(0.0),)), matrices, RIGHT, 1.0, 1, 1, True, axes=axes).final
    for matrix, found in zip(matrices, end, strict=True):
        np.testing.assert_allclose(found, np.linalg.solve(matrix, RIGHT), rtol=1e-12, atol=1e-13)
    alone = ensemble.run_ensemble(Still((Solving(0.0),)), matrices[::2], RIGHT, 1.0, 1, 1, True, axes=axes).final
    assert np.array_equal(alone, end[::2])
