"""Linear systems of more unknowns than elimination with selections takes: by blocks, with pivots where these fail."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest
from equations import Equations, Still

from coadjoint.kernels.expressions.differentiation import backward
from coadjoint.kernels.run import ensemble
from coadjoint.kernels.run.function import NativeFunction, assembled
from coadjoint.kernels.run.machine import machine
from coadjoint.kernels.trace.tracer import Tracer, flat

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
    np.testing.assert_allclose(slopes[0], np.linalg.inv(matrix), rtol=1e-11, atol=1e-12)


def scaled(x, y):
    """A solution whose matrix depends on x."""
    matrix = jnp.where(BAND, y[SIZE:].reshape(SIZE, SIZE), 0.0) * x[:, None] + jnp.diag(x)
    return jnp.linalg.solve(matrix, x**2 * y[:SIZE])


@pytest.mark.parametrize("matrix", [SOUND, UNSOUND - np.eye(SIZE)], ids=["sound", "unsound"])
def test_slopes_and_gradients_by_the_matrix_are_those_of_the_implicit_function_theorem(matrix):
    y = np.concatenate([RIGHT, matrix.ravel()])
    x = np.ones(SIZE)
    # (A s)_k = x_k (B_k·s + s_k) = x_k² y_k: at x = 1, ∂s/∂x_k = A⁻¹ e_k (2y_k − B_k·s − s_k).
    full = np.where(BAND, matrix, 0.0)
    s = np.linalg.solve(full + np.eye(SIZE), RIGHT)
    exact = np.linalg.solve(full + np.eye(SIZE), np.diag(2 * RIGHT - full @ s - s))
    function = NativeFunction(scaled, x, y)
    np.testing.assert_allclose(function(x[None], y[None])[1][0], exact, rtol=1e-9, atol=1e-11)
    tracer = Tracer()
    symbols = tracer.symbols("x", x), tracer.symbols("y", y)
    values = flat(tracer.trace(scaled, *symbols))
    weights = np.arange(1.0, SIZE + 1)
    bars = backward(
        tracer.graph, {v: tracer.graph.constant(w) for v, w in zip(values, weights, strict=True)}, flat(symbols[0])
    )
    found = np.zeros((1, SIZE))
    code = machine(assembled([(flat(s), len(flat(s))) for s in symbols], [(dict(enumerate(bars)), SIZE)]))
    rows = [np.ascontiguousarray(part[None]) for part in (x, y)]
    code.function("function", *[ctypes.c_void_p] * 3, ctypes.c_int64)(*(a.ctypes.data for a in (*rows, found)), 1)
    np.testing.assert_allclose(found[0], weights @ exact, rtol=1e-9, atol=1e-10)


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
