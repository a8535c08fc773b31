"""Functions run by NumPy agree with XLA on the language of mechanics."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.kernels.evaluate import evaluate, tabulate

SEED = 20260101
print(f"seed {SEED}")
_random = np.random.default_rng(SEED)
A, B = _random.normal(size=(3, 3)), _random.normal(size=3)

LANGUAGE = {
    "solve": lambda a, b: jnp.linalg.solve(a, b),
    "solve for a matrix": lambda a, b: jnp.linalg.solve(a, a @ a.T),
    "derivative of solve": lambda a, b: jax.jacfwd(lambda x: jnp.linalg.solve(a, x * x))(b),
    "inverse": lambda a, b: jnp.linalg.inv(a),
    "determinant": lambda a, b: jnp.linalg.det(a),
    "gradient of a determinant": lambda a, b: jax.grad(jnp.linalg.det)(jnp.kron(a, a[:2, :2])),
    "Cholesky": lambda a, b: jnp.linalg.cholesky(a @ a.T),
    "matrix exponential": lambda a, b: jax.scipy.linalg.expm(a),
    "cross products": lambda a, b: jax.vmap(jnp.cross, (None, 0))(b, a),
    "scatter": lambda a, b: a.at[0, 1].set(b[0]) + a.at[jnp.array([0, 0, 2])].add(b),
    "gather": lambda a, b: a[:, jnp.array([2, 0, -1])],
    "loop": lambda a, b: jax.lax.fori_loop(0, 3, lambda i, x: x * b[i], 1.0),
    "while": lambda a, b: jax.lax.while_loop(lambda x: x < 10, lambda x: 2 * x, jnp.abs(b[0])),
    "a while for each row": lambda a, b: jax.vmap(
        lambda row: jax.lax.while_loop(lambda x: x[0] < 10, lambda x: (2 * x[0], x[1] + b), (jnp.abs(row[0]), row))
    )(a),
    "scan": lambda a, b: jax.lax.scan(lambda c, x: (c + x, c * x), b[0], b, reverse=True),
    "branch": lambda a, b: jax.lax.cond(b[0] > 0, lambda: a, lambda: 2 * a),
    "rounding": lambda a, b: jnp.round(3 * b) + jnp.sign(b) + jnp.mod(b, 0.3) + jnp.clip(b, -0.1, 0.1),
    "gradient of a norm": lambda a, b: jax.grad(jnp.linalg.norm)(b),
    "reductions": lambda a, b: jnp.prod(b) + a.min() + a.max() + jnp.argmax(b) + jnp.trace(a),
    "cumulative": lambda a, b: (jnp.cumsum(a, 1), jnp.cumprod(b)),
    "padding": lambda a, b: jnp.pad(a, ((1, 2), (0, 1)), constant_values=3.0),
    "hessian": lambda a, b: jax.hessian(lambda x: jnp.sin(x @ a @ x))(b),
    "einsum": lambda a, b: jnp.einsum("ij,jk,k->i", a, a, b),
    "interpolation": lambda a, b: jnp.interp(0.3, jnp.array([0.0, 1.0, 2.0]), b),
    "sorting": lambda a, b: (jnp.sort(b), jnp.argsort(a, axis=1)),
    "polynomial": lambda a, b: jnp.polyval(b, a) + jax.grad(lambda x: jnp.polyval(b, x))(b[1]),
    "logarithms": lambda a, b: jnp.log2(jnp.abs(b)) + jnp.log10(jnp.abs(b)) + jax.grad(jnp.log2)(jnp.abs(b[0])),
    "derivative of tanh": lambda a, b: jax.vmap(jax.grad(jnp.tanh))(b),
    "elementary": lambda a, b: jax.nn.softplus(b) + jnp.hypot(b[0], b[1]) + jnp.cbrt(b) + jnp.arctan2(b, b[0]),
}


@pytest.mark.parametrize("name", LANGUAGE)
def test_evaluate_agrees_with_xla(name):
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
