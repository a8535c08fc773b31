"""Functions run by NumPy agree with XLA on the language of mechanics."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from functions import LANGUAGE

from coadjoint.kernels.trace.evaluate import evaluate, tabulate

SEED = 20260101
print(f"seed {SEED}")
_random = np.random.default_rng(SEED)
A, B = _random.normal(size=(3, 3)), _random.normal(size=3)


@pytest.fixture
def without_xla(monkeypatch):
    """What has no rule fails, where it would be computed by XLA and compared with itself."""

    def refused(function):
        raise AssertionError("a primitive without a rule here went to XLA")

    monkeypatch.setattr("coadjoint.kernels.trace.evaluate.compiled", refused)


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", LANGUAGE)
def test_evaluate_agrees_with_xla(name, without_xla):
    function = LANGUAGE[name]
    ours = evaluate(function, A, B)
    with jax.enable_x64(True):
        theirs = jax.jit(function)(A, B)
    for x, y in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        assert type(x) is np.ndarray
        assert x.dtype == y.dtype
        np.testing.assert_allclose(x, y, rtol=1e-12, atol=1e-13)


def test_an_unknown_primitive_goes_through_xla():
    values, vectors = evaluate(lambda a: jnp.linalg.eigh(a + a.T), A)
    np.testing.assert_allclose(vectors @ np.diag(values) @ vectors.T, A + A.T, atol=1e-13)


def test_a_tabulated_function_follows_new_values_and_branches():
    function = tabulate(lambda x: jax.lax.cond(x > 0, lambda: jnp.sqrt(x), lambda: -x), 1.0)
    assert function(4.0) == 2.0
    assert function(-4.0) == 4.0


def test_a_tabulated_function_refuses_other_shapes():
    function = tabulate(lambda x: 2 * x, np.ones(3))
    with pytest.raises(ValueError, match="shapes"):
        function(np.ones(4))


def test_results_are_float64_whatever_the_configuration():
    assert not jax.config.jax_enable_x64
    assert evaluate(lambda x: x["a"] + 1, {"a": np.float32(0.5)}).dtype == np.float64
    assert not jax.config.jax_enable_x64


@pytest.mark.parametrize("batch", [(), (5,), (2, 3)])
@pytest.mark.parametrize("unit_diagonal", [False, True])
@pytest.mark.parametrize("transpose_a", [False, True])
@pytest.mark.parametrize("lower", [False, True])
@pytest.mark.parametrize("left_side", [False, True])
def test_triangular_systems_are_solved_over_all_leading_axes(left_side, lower, transpose_a, unit_diagonal, batch):
    a = _random.normal(size=(*batch, 4, 4)) + 3 * np.eye(4)
    b = _random.normal(size=(*batch, 4, 2) if left_side else (*batch, 2, 4))
    flags = {"left_side": left_side, "lower": lower, "transpose_a": transpose_a, "unit_diagonal": unit_diagonal}
    x = evaluate(lambda a, b: jax.lax.linalg.triangular_solve(a, b, **flags), a, b)
    triangle = np.tril(a) if lower else np.triu(a)
    if unit_diagonal:
        triangle = triangle * (1 - np.eye(4)) + np.eye(4)
    if transpose_a:
        triangle = np.swapaxes(triangle, -1, -2)
    np.testing.assert_allclose(triangle @ x if left_side else x @ triangle, b, atol=1e-12)


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (20, 20), (3, 5), (5, 3), (0, 0)])
def test_a_matrix_is_factorised_as_by_lapack_with_its_pivots(shape, without_xla):
    a = np.random.default_rng(SEED).normal(size=shape)
    factors, pivots, order = evaluate(jax.lax.linalg.lu, a)
    expected, swaps, _ = scipy.linalg.lapack.dgetrf(a) if a.size else (a, pivots, None)
    np.testing.assert_allclose(factors, expected, rtol=1e-11, atol=1e-12)
    assert np.array_equal(pivots, swaps)
    size = len(pivots)
    lower, upper = np.tril(factors, -1)[:, :size] + np.eye(shape[0], size), np.triu(factors)[:size]
    np.testing.assert_allclose(lower @ upper, a[order], atol=1e-12)


def test_several_matrices_are_factorised_one_by_one_and_a_singular_one_has_a_zero_on_its_diagonal(without_xla):
    a = np.random.default_rng(SEED).normal(size=(2, 4, 4))
    a[1, 3] = a[1, 0]
    factors, pivots, order = evaluate(jax.lax.linalg.lu, a)
    for i in range(2):
        for found, alone in zip((factors[i], pivots[i], order[i]), evaluate(jax.lax.linalg.lu, a[i]), strict=True):
            assert np.array_equal(found, alone)
    assert abs(factors[1, 3, 3]) < 1e-15
    assert not np.any(np.isfinite(evaluate(jnp.linalg.solve, np.array([[1.0, 2.0], [2.0, 4.0]]), np.ones(2))))


def test_long_loops_go_to_xla_and_give_the_same(monkeypatch):
    sent = []
    monkeypatch.setattr("coadjoint.kernels.trace.evaluate.compiled", lambda f: sent.append(f) or jax.jit(f))

    def summed(x):
        return jax.lax.scan(lambda total, y: (total + y, total), 0.0, x)

    x = np.arange(6.0)
    here, there = (tabulate(summed, x, long=long)(x) for long in (False, True))
    assert sent == [summed] and here[0] == there[0] == 15.0
    assert np.array_equal(here[1], there[1]) and there[1].dtype == np.float64
