"""The primitives on numbers, by NumPy."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, reduce
from typing import Any

import numpy as np

from coadjoint.kernels.expressions.operations import BINARY, UNARY, special
from coadjoint.kernels.trace.interpreter import Array, Rule
from coadjoint.kernels.trace.jaxprs import EquationParameters
from coadjoint.kernels.trace.movement import MOVEMENT, scatters
from coadjoint.kernels.untraceable import Untraceable


def _special(name: str) -> Rule:
    function = special(name)
    return lambda p, x: function(x)


def _divide(p: EquationParameters, x: Array, y: Array) -> Any:
    if np.issubdtype(x.dtype, np.floating):
        return np.divide(x, y)
    return np.trunc(np.divide(x, y)).astype(x.dtype)


def _select(p: EquationParameters, which: Array, *cases: Array) -> Array:
    return np.where(which, cases[1], cases[0]) if which.dtype == bool else np.choose(which, cases)


def round_name(parameters: EquationParameters) -> str:
    """The name of the rounding that a `round` equation specifies."""
    even = parameters.choice("rounding_method") == "TO_NEAREST_EVEN"
    return "round_even" if even else "round_away"


def matricize(p: EquationParameters, x: Array, y: Array) -> tuple[Array, Array, tuple[int, ...]]:
    """The factors of a dot_general as stacks (b, m, k) and (b, k, n), and the shape of the result."""
    order_x, order_y, left, right, shape = _stacks(p["dimension_numbers"], x.shape, y.shape)
    return x.transpose(order_x).reshape(left), y.transpose(order_y).reshape(right), shape


@cache
def _stacks(dimensions: tuple, x: tuple[int, ...], y: tuple[int, ...]) -> tuple[tuple[int, ...], ...]:
    """The orders of the axes of both factors of these shapes, the shapes of their stacks, and that of the result."""
    (cx, cy), (bx, by) = dimensions
    free_x = [axis for axis in range(len(x)) if axis not in (*cx, *bx)]
    free_y = [axis for axis in range(len(y)) if axis not in (*cy, *by)]
    batch, m, n, k = ([a[i] for i in axes] for a, axes in ((x, bx), (x, free_x), (y, free_y), (x, cx)))
    stack, rows, columns, count = map(math.prod, (batch, m, n, k))
    order_x, order_y = (*bx, *free_x, *cx), (*by, *cy, *free_y)
    return order_x, order_y, (stack, rows, count), (stack, count, columns), (*batch, *m, *n)


def _dot(p: EquationParameters, x: Array, y: Array) -> Array:
    if not (x.ndim and y.ndim):
        return x * y + 0  # the zeros of a sum are positive
    left, right, shape = matricize(p, x, y)
    return np.matmul(left, right).reshape(shape)


def _sum(p: EquationParameters, x: Array) -> Array:
    """Along a short last axis entry after entry, which is NumPy's order there, for all rows together."""
    axes = tuple(p["axes"])
    if axes != (x.ndim - 1,) or x.dtype != np.float64 or not 0 < x.shape[-1] < 8 or x.ndim < 2:
        return np.sum(x, axis=axes)
    total = x[..., 0] + 0.0
    for k in range(1, x.shape[-1]):
        total += x[..., k]
    return total


def _reduction(function: Callable) -> Rule:
    return lambda p, x: function(x, axis=tuple(p["axes"]))


def _extremum(function: Callable, lowest: bool) -> Rule:
    """XLA reduces an empty array to the identity of the reduction, −∞ for a maximum."""

    def rule(p: EquationParameters, x: Array) -> Array:
        if x.size:
            return function(x, axis=tuple(p["axes"]))
        info = np.iinfo(x.dtype) if x.dtype.kind in "iu" else None
        ends = (info.min, info.max) if info else (-np.inf, np.inf)
        return function(x, axis=tuple(p["axes"]), initial=ends[0] if lowest else ends[1])

    return rule


def _arg(function: Callable) -> Rule:
    return lambda p, x: function(x, axis=p["axes"][0])


def _cumulative(function: Callable) -> Rule:
    def rule(p: EquationParameters, x: Array) -> Array:
        axis = p["axis"]
        return np.flip(function(np.flip(x, axis), axis=axis), axis) if p["reverse"] else function(x, axis=axis)

    return rule


def _iota(p: EquationParameters) -> Array:
    line = [1] * len(p["shape"])
    line[p["dimension"]] = -1
    return np.broadcast_to(np.arange(p["shape"][p["dimension"]]).reshape(line), p["shape"])


def _polynomial(p: EquationParameters, x: Array, *coefficients: Array) -> Array:
    """a₀ + x (a₁ + x (a₂ + …))."""
    return np.broadcast_arrays(reduce(lambda y, a: y * x + a, coefficients[::-1]), x)[0]


def _lu(p: EquationParameters, a: Array) -> list[Array]:
    """P a = L U with partial pivoting, as LAPACK's getrf: L and U in one, pivots, P. SciPy takes long to load.

    Column after column, over all leading axes together.
    """
    *leading, rows, columns = a.shape
    factors = np.array(a).reshape(int(np.prod(leading)), rows, columns)
    each, order = np.arange(len(factors)), np.tile(np.arange(rows), (len(factors), 1))
    pivots = np.zeros((len(factors), min(rows, columns)), dtype=np.int32)
    for k in range(pivots.shape[1]):
        pivots[:, k] = chosen = k + np.argmax(np.abs(factors[:, k:, k]), axis=1)
        for table in (factors, order):
            table[each, k], table[each, chosen] = table[each, chosen], table[each, k]
        # A singular matrix has zeros below, too, and gives infinities, as by XLA.
        pivot = np.where(factors[:, k, k] == 0, 1.0, factors[:, k, k])
        factors[:, k + 1 :, k] /= pivot[:, None]
        factors[:, k + 1 :, k + 1 :] -= factors[:, k + 1 :, k, None] * factors[:, k, None, k + 1 :]
    return [factors.reshape(a.shape), pivots.reshape(*leading, pivots.shape[1]), order.reshape(*leading, rows)]


def _triangular(p: EquationParameters, a: Array, b: Array) -> Array:
    """a x = b, or x a = b, for triangular a by substitution: row after row, over all leading axes together."""
    lower = p["lower"]
    if p["transpose_a"] == p["left_side"]:  # aᵀ x = b, or x a = b, which is aᵀ xᵀ = bᵀ
        a, lower = np.swapaxes(a, -1, -2), not lower
    x = np.array(b if p["left_side"] else np.swapaxes(b, -1, -2))
    size = a.shape[-1]
    for i in range(size) if lower else reversed(range(size)):
        known = slice(0, i) if lower else slice(i + 1, size)
        if known.start < known.stop:
            x[..., i, :] -= np.einsum("...k,...kj->...j", a[..., i, known], x[..., known, :])
        if not p["unit_diagonal"]:
            x[..., i, :] /= a[..., i, i, None]
    return x if p["left_side"] else np.swapaxes(x, -1, -2)


def _sort(p: EquationParameters, *operands: Array) -> list[Array]:
    keys = operands[: p["num_keys"]]
    if operands[0].ndim == 1 or p["num_keys"] == 1:
        order = np.argsort(keys[0], axis=p["dimension"], kind="stable") if len(keys) == 1 else np.lexsort(keys[::-1])
        return [np.take_along_axis(x, order, p["dimension"]) for x in operands]
    raise Untraceable("sort", "several keys along one of several axes")


def _cholesky(a: np.ndarray) -> np.ndarray:
    """L with LLᵀ = a; NaN where a is not positive definite, as JAX has it."""
    try:
        return np.linalg.cholesky(a)
    except np.linalg.LinAlgError:
        return np.full_like(a, np.nan)


NUMERIC: dict[str, Rule] = {
    **MOVEMENT,
    **{name: (lambda p, x, f=f: f(x)) for name, f in UNARY.items()},
    **{name: (lambda p, x, y, f=f: f(x, y)) for name, f in BINARY.items()},
    **scatters(np.add, np.subtract, np.multiply, np.minimum, np.maximum),
    "add_any": lambda p, x, y: np.add(x, y),
    "argmax": _arg(np.argmax),
    "argmin": _arg(np.argmin),
    "cholesky": lambda p, a: _cholesky(a),
    "clamp": lambda p, low, x, high: np.minimum(np.maximum(x, low), high),
    "convert_element_type": lambda p, x: x.astype(p["new_dtype"]),
    "cummax": _cumulative(np.maximum.accumulate),
    "cummin": _cumulative(np.minimum.accumulate),
    "cumprod": _cumulative(np.cumprod),
    "cumsum": _cumulative(np.cumsum),
    "digamma": _special("digamma"),
    "erf_inv": _special("erfinv"),
    "lgamma": _special("gammaln"),
    "det": lambda p, a: np.linalg.det(a),
    "div": _divide,
    "dot_general": _dot,
    "eq_to": lambda p, x, y: np.equal(x, y),
    "le_to": lambda p, x, y: np.less_equal(x, y),
    "lt_to": lambda p, x, y: np.less(x, y),
    "integer_pow": lambda p, x: x ** p["y"] if p["y"] >= 0 else 1.0 / x ** -p["y"],
    "empty": lambda p: np.zeros(p["shape"], p["dtype"]),
    "iota": _iota,
    "logistic": _special("expit"),
    "lu": _lu,
    "one_minus_square": lambda p, x: (1 - x) * (1 + x),
    "polynomial": _polynomial,
    "reduce_and": _reduction(np.all),
    "reduce_max": _extremum(np.max, lowest=True),
    "reduce_min": _extremum(np.min, lowest=False),
    "reduce_or": _reduction(np.any),
    "reduce_prod": _reduction(np.prod),
    "reduce_sum": _sum,
    "round": lambda p, x: UNARY[round_name(p)](x),
    "rsqrt": lambda p, x: 1.0 / np.sqrt(x),
    "select_n": _select,
    "sort": _sort,
    "square": lambda p, x: x * x,
    "triangular_solve": _triangular,
}
"""The rules that `evaluate` uses, and that fold constants in the tracer."""
