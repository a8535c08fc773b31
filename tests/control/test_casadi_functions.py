"""Functions written with JAX are the same functions of CasADi, and so are their derivatives."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import jax.scipy.special
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.while_loops import keep_loop

POINTS = np.array([[0.3, 0.7], [-0.4, 0.2], [0.9, -0.6]])

FUNCTIONS = {
    "arithmetic": lambda x: x[0] * x[1] - x[0] / x[1] + x[0] ** 3 - 2 * x[1],
    "powers": lambda x: jnp.abs(x[0]) ** 1.3 + jnp.sqrt(x[1] ** 2 + 1) + jnp.cbrt(2 + x[0]),
    "exponentials": lambda x: jnp.exp(x[0]) + jnp.log(2 + x[1]) + jnp.expm1(x[0]) + jnp.exp2(x[1]),
    "logarithms": lambda x: jnp.log2(3 + x[0]) + jnp.log10(3 + x[1]) + jnp.log1p(x[1] ** 2),
    "circular": lambda x: jnp.sin(x[0]) * jnp.cos(x[1]) + jnp.tan(x[0]) + jnp.arctan2(x[0], x[1]),
    "inverse": lambda x: jnp.arcsin(x[0] / 2) + jnp.arccos(x[1] / 2) + jnp.arctan(x[0]),
    "hyperbolic": lambda x: jnp.sinh(x[0]) + jnp.cosh(x[1]) * jnp.tanh(x[0]) + jnp.arcsinh(x[1]),
    "inverse hyperbolic": lambda x: jnp.arccosh(2 + x[0]) + jnp.arctanh(x[1] / 2),
    "errors": lambda x: jax.scipy.special.erf(x[0]) + jax.scipy.special.erfc(x[1]),
    "steps": lambda x: jnp.abs(x[0]) * jnp.sign(x[1]) + jnp.floor(3 * x[0]) * x[1] + jnp.ceil(x[1]),
    "towards zero": lambda x: jnp.trunc(2 * x[0]) * x[1] + (3 * x[0]).astype(int) * x[0],
    "choices": lambda x: jnp.where((x[0] > x[1]) & (x[0] > 0), x[0] ** 2, jnp.where(x[1] < 0, x[1], -x[0])),
    "alternatives": lambda x: jnp.where((x[0] < 0) | ~(x[1] < 0.5) ^ (x[0] >= 0.8), x[0] * x[1], x[1]),
    "limits": lambda x: jnp.minimum(x[0], x[1]) + 2 * jnp.maximum(x[0], 0.1) + jnp.clip(x[1], -0.5, 0.5),
    "remainders": lambda x: jnp.fmod(3 * x[0], 0.7) + x[1],
    "tables": lambda x: jnp.interp(x[0], jnp.linspace(-1, 1, 9), jnp.sin(jnp.arange(9.0))) * x[1],
    "linear algebra": lambda x: jnp.linalg.solve(jnp.array([[2 + x[0], x[1]], [x[1], 3.0]]), x) @ x,
    "loops": lambda x: jax.lax.fori_loop(0, 4, lambda i, y: jnp.sin(y) + x * y[::-1], x)[0],
}


def test_a_loop_that_stays_one_in_machine_code_is_unrolled_as_far_as_its_count_goes():
    def heron(x, trips):
        y = 3.0 + x
        moved = (lambda s: (s[1] < trips) & (s[0] ** 2 - y > 1e-12)), (lambda s: ((s[0] + y / s[0]) / 2, s[1] + 1))
        return keep_loop(*moved, (y, 0))[0]

    found = co.control.casadi_function(lambda x: heron(x, 12), {"x": 0.0})
    assert float(found(0.7)) == pytest.approx(float(np.sqrt(3.7)), abs=1e-15)
    slope = found.factory("slope", ["x"], ["grad:value:x"])
    assert float(slope(0.7)) == pytest.approx(0.5 / np.sqrt(3.7), abs=1e-11)
    with pytest.raises(co.errors.LagrangianError, match="no known end within 2,000 trips"):
        co.control.casadi_function(lambda x: heron(x, jnp.inf * (2 + x)), {"x": 0.0})


@pytest.mark.parametrize("name", FUNCTIONS)
def test_values_and_derivatives_are_those_of_jax(name):
    function = FUNCTIONS[name]
    found = co.control.casadi_function(function, {"x": np.zeros(2)})
    slope = found.factory("slope", ["x"], ["grad:value:x"])
    curvature = found.factory("curvature", ["x"], ["hess:value:x:x"])
    for x in POINTS:
        value, first, second = (
            np.asarray(evaluate(f, x)) for f in (function, jax.grad(function), jax.hessian(function))
        )
        assert float(found(x)) == pytest.approx(float(value), abs=1e-13)
        assert slope(x).full().ravel() == pytest.approx(first, abs=1e-11)
        assert curvature(x).full() == pytest.approx(second, abs=1e-9)


def test_arguments_and_results_keep_their_names_and_shapes():
    found = co.control.casadi_function(
        lambda A, x: A @ x, {"A": np.zeros((2, 3)), "x": np.zeros(3)}, name="product", result="y"
    )
    A, x = np.arange(6.0).reshape(2, 3), np.array([1.0, -2.0, 0.5])
    assert (found.name(), found.name_in(), found.name_out()) == ("product", ["A", "x"], ["y"])
    assert found(A=A, x=x)["y"].full().ravel() == pytest.approx(A @ x)
    outer = co.control.casadi_function(lambda x, y: jnp.outer(x, y), {"x": np.zeros(2), "y": np.zeros(3)})
    assert outer([1, 2], [3, 4, 5]).full() == pytest.approx(np.outer([1, 2], [3, 4, 5]))


@pytest.mark.parametrize(
    ("function", "arguments", "told"),
    [
        (lambda x: jnp.round(x[0]), {"x": np.zeros(2)}, "no operation `round_even`"),
        (lambda x: jnp.linalg.eigvalsh(jnp.outer(x, x))[0], {"x": np.zeros(2)}, "`eigh`"),
        (lambda x: x[0] if x[0] > 0 else x[1], {"x": np.zeros(2)}, "cannot be differentiated by JAX"),
        (lambda x: jnp.zeros((2, 2, 2)) * x[0], {"x": np.zeros(2)}, "at most two axes"),
        (lambda x: x, {"x": np.zeros((2, 2, 2))}, "at most two axes"),
        ("x + 1", {"x": np.zeros(2)}, "must be a function"),
    ],
)
def test_what_casadi_cannot_have_is_told(function, arguments, told):
    with pytest.raises(co.errors.CoadjointError, match=told):
        co.control.casadi_function(function, arguments)


@pytest.mark.parametrize("several", [lambda x: {"a": x, "b": 2 * x}, lambda x: (x, x)])
def test_a_function_of_casadi_has_one_result(several):
    with pytest.raises(
        co.errors.LagrangianError, match="one number, a vector or a matrix, but returns several results"
    ):
        co.control.casadi_function(several, {"x": np.zeros(3)})


def test_arguments_of_a_function_of_casadi_have_names():
    with pytest.raises(co.errors.ArgumentError, match="`arguments` must be name → example"):
        co.control.casadi_function(lambda x: x, [np.zeros(3)])  # pyright: ignore[reportArgumentType]
