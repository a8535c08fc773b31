"""The language of mechanics: functions of arrays that are traced, differentiated and made machine code."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.kernels.trace.while_loops import keep_loop, with_slope


def heron(x):
    """√(3 + x) by Heron's iteration in a loop that stays one, with the derivative of the root."""
    y = 3.0 + x
    root, _ = keep_loop(
        lambda s: (s[1] < 12) & (jnp.max(jnp.abs(s[0] ** 2 - y)) > 1e-12),
        lambda s: ((s[0] + y / s[0]) / 2, s[1] + 1),
        (y, 0),
    )
    return with_slope(root, jnp.sqrt(y))


def doubled_within(a, b):
    """A kept loop in a kept loop, and one without a trip."""

    def doubled(x):
        return keep_loop(lambda s: s[0] < 10, lambda s: (2 * s[0], s[1] + b), (jnp.abs(x) + 1, b))

    found = keep_loop(lambda s: jnp.sum(s[0]) < 99, lambda s: (s[0] + doubled(s[0][0])[1], s[1] + 1), (jnp.abs(b), 0.0))
    return *found, keep_loop(lambda x: x[0] > 1e9, lambda x: a @ x, b)


LANGUAGE = {
    "kept loops": doubled_within,
    "solve": lambda a, b: jnp.linalg.solve(a, b),
    "solve for a matrix": lambda a, b: jnp.linalg.solve(a, a @ a.T),
    "derivative of solve": lambda a, b: jax.jacfwd(lambda x: jnp.linalg.solve(a, x * x))(b),
    "inverse": lambda a, b: jnp.linalg.inv(a),
    "determinant": lambda a, b: jnp.linalg.det(a),
    "factors": lambda a, b: jax.lax.linalg.lu(jnp.stack([a, a.T])),
    "gradient of a determinant": lambda a, b: jax.grad(jnp.linalg.det)(jnp.kron(a, a[:2, :2])),
    "Cholesky": lambda a, b: jnp.linalg.cholesky(a @ a.T),
    "matrix exponential": lambda a, b: jax.scipy.linalg.expm(a),
    "cross products": lambda a, b: jax.vmap(jnp.cross, (None, 0))(b, a),
    "scatter": lambda a, b: (
        a.at[0, 1].set(b[0]) + a.at[jnp.array([0, 0, 2])].add(b) + a.at[:, jnp.array([2, 0])].add(a[:, :2])
    ),
    "scatter to places of values": lambda a, b: a.at[:, jnp.stack([jnp.argmax(b), jnp.argmin(b)])].add(a[:, :2]),
    "gather": lambda a, b: a[:, jnp.array([2, 0, -1])],
    "gather from outside": lambda a, b: jnp.take(a, jnp.array([1, 7, -9]), axis=0, mode="clip"),
    "loop": lambda a, b: jax.lax.fori_loop(0, 3, lambda i, x: x * b[i], 1.0),
    "while": lambda a, b: jax.lax.while_loop(lambda x: x < 10, lambda x: 2 * x, jnp.abs(b[0])),
    "a while for each row": lambda a, b: jax.vmap(
        lambda row: jax.lax.while_loop(lambda x: x[0] < 10, lambda x: (2 * x[0], x[1] + b), (jnp.abs(row[0]), row))
    )(a),
    "scan": lambda a, b: jax.lax.scan(lambda c, x: (c + x, c * x), b[0], b, reverse=True),
    "branch": lambda a, b: jax.lax.cond(b[0] > 0, lambda: a, lambda: 2 * a),
    "rounding": lambda a, b: jnp.round(3 * b) + jnp.sign(b) + jnp.mod(b, 0.3) + jax.lax.clamp(-0.1, b, 0.1),
    "gradient of a norm": lambda a, b: jax.grad(jnp.linalg.norm)(b),
    "reductions": lambda a, b: jnp.prod(b) + a.min() + a.max() + jnp.argmax(b) + jnp.trace(a),
    "cumulative": lambda a, b: (jnp.cumsum(a, 1), jnp.cumprod(b)),
    "cumulative from the end": lambda a, b: (jax.lax.cumsum(a, reverse=True), jax.lax.cummax(b, reverse=True)),
    "triangular": lambda a, b: (
        jax.scipy.linalg.solve_triangular(a, b, lower=True),
        jax.scipy.linalg.solve_triangular(a, a, trans=1),
        jax.lax.linalg.triangular_solve(a, a.T, left_side=False, lower=True, transpose_a=True, unit_diagonal=True),
    ),
    "several triangular": lambda a, b: jax.vmap(lambda s: jax.scipy.linalg.solve_triangular(s * a, b, lower=True))(b),
    "update of a window": lambda a, b: jax.lax.dynamic_update_slice(a, 2 * a[:2, :2], (1, 0)),
    "reductions along axes": lambda a, b: (
        jnp.argmin(a, axis=0),
        jnp.sum(a, axis=0),
        jnp.prod(a, axis=1),
        jnp.max(a, axis=0),
        jnp.all(a > b, axis=1),
    ),
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
"""Functions of a 3×3 matrix and three numbers."""

SMOOTH = {
    "kept loop": heron,
    "polynomial": lambda x: x[0] ** 3 * x[1] - x[2] / (1.0 + x[0] ** 2),
    "trigonometric": lambda x: jnp.sin(x) * jnp.cos(2 * x) + jnp.tan(x / 3) + jnp.arctan2(x[0], x[1]),
    "inverse": lambda x: jnp.arcsin(x / 4) + jnp.arccos(x / 5) + jnp.arctan(x) + jnp.arcsinh(x) + jnp.arctanh(x / 6),
    "hyperbolic": lambda x: jnp.sinh(x) + jnp.cosh(x) * jnp.tanh(x) + jnp.arccosh(2 + x**2),
    "exponential": lambda x: jnp.exp(x) + jnp.log(3 + x) + jnp.expm1(x) + jnp.log1p(x**2) + jnp.exp2(x),
    "roots": lambda x: jnp.sqrt(2 + x) + jnp.cbrt(3 + x) + (2 + x) ** 1.7 + jax.lax.rsqrt(3 + x),
    "piecewise": lambda x: jnp.where(x > 0, x**2, jnp.sin(x)) + jnp.maximum(x, 0.3) + jnp.abs(x) + jnp.clip(x, -1, 1),
    "remainder": lambda x: jnp.fmod(3 * x, 0.7) + jnp.floor(x) * x,
    "remainder by a variable": lambda x: jnp.fmod(7 * x, 0.7 + x**2) - 2 * jnp.fmod(-5.0, 0.6 + x**2),
    "both arguments": lambda x: (3 + x[0]) ** x[1] + jnp.arctan2(x[1], x[2]) * jnp.hypot(*x[:2]),
    "error function": lambda x: jax.scipy.special.erf(x) - jax.scipy.special.erfc(2 * x),
    "linear algebra": lambda x: jnp.linalg.solve(jnp.eye(3) * 2 + jnp.outer(x, x), x),
    "large system": lambda x: jnp.linalg.solve(
        jnp.eye(5) * 2 + jnp.vander(jnp.sin(jnp.arange(5) + x[0]), 5), jnp.ones(5)
    ),
    "custom derivative": lambda x: jax.nn.relu(x) + jax.nn.sigmoid(x),
    "table": lambda x: jnp.interp(x[0], jnp.array([-3.0, 0.0, 3.0]), jnp.array([1.0, 2.0, 5.0])),
    "own index": lambda x: x[jnp.argmax(x)] * jnp.arange(4.0)[jnp.argmin(x)],
}
"""Functions of three numbers with derivatives."""


LINE, SHEET = np.sin(np.arange(3000.0)), np.cos(np.arange(70.0 * 40)).reshape(70, 40)
GRID = np.linspace(-2.5, 2.5, 3000)


def whole(x):
    """A whole number, negative or beyond the ends of short arrays for some x."""
    return jnp.floor(20 * x).astype(int)


TABLES = {
    "entry": lambda x: jnp.asarray(LINE)[whole(x[0]) + 1000] * x,
    "entry beyond the ends, clipped": lambda x: jnp.asarray(LINE[:30]).at[whole(x)].get(mode="clip"),
    "entry beyond the ends, filled": lambda x: jnp.asarray(LINE[:30]).at[whole(x)].get(mode="fill", fill_value=7.0),
    "entry from the end": lambda x: jnp.asarray(LINE)[whole(-jnp.abs(x)) - 1],
    "row and column": lambda x: jnp.asarray(SHEET)[whole(x[0]) + 35, whole(x[1]) % 40] * x,
    "row": lambda x: jnp.asarray(SHEET)[whole(x[0]) + 35] @ jnp.arange(40.0) * x,
    "column": lambda x: jnp.asarray(SHEET)[:, whole(x[2]) % 40].sum() + x,
    "window": lambda x: jax.lax.dynamic_slice(jnp.asarray(SHEET), (whole(x[0]), whole(x[1])), (2, 3)).sum(0),
    "window of whole numbers": lambda x: jax.lax.dynamic_slice(jnp.arange(900), (whole(x[0]) + 300,), (3,)) * x,
    "place in a row": lambda x: jnp.searchsorted(jnp.asarray(GRID), x) * x,
    "long interpolation": lambda x: jnp.interp(x, jnp.asarray(GRID), jnp.asarray(LINE)),
}
"""Functions of three numbers that look something up in constants."""
