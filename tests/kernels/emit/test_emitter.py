"""Machine code computes every function as NumPy does, one trajectory at a time and in lanes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from equations import Equations, Still
from functions import SMOOTH, TABLES

from coadjoint.kernels.expressions.expression import reachable
from coadjoint.kernels.run import native
from coadjoint.kernels.run.ensemble import lanes, run_ensemble
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.symbolic import nodes
from coadjoint.kernels.trace.tracer import Tracer

SEED = 9
_random = np.random.default_rng(SEED)

OTHERS = {
    "rounding": lambda x: jnp.round(7 * x) + jnp.floor(5 * x) + jnp.ceil(3 * x) + jnp.trunc(9 * x) + jnp.sign(x),
    "half away": lambda x: jax.lax.round(x * 10, jax.lax.RoundingMethod.AWAY_FROM_ZERO),
    "logic": lambda x: jnp.where(((x > 0) & (x < 1)) | ~(x > -1) ^ (x == x[0]), x, -x) + jnp.isfinite(1 / (x - x[0])),
    "powers": lambda x: x**5 + (x + 3.0) ** -2 + jnp.abs(x) ** 0.3 + x ** jnp.array([0.0, 2.0, 3.0]),
    "extrema": lambda x: jnp.max(x) * jnp.min(x) + jnp.argmax(x) + jnp.any(x > 1) + jnp.all(x < 9),
    "remainders": lambda x: jnp.mod(x, 0.3) + jnp.fmod(-x, 0.7) + jnp.arctan2(x, -x[::-1]),
}
FUNCTIONS = {**{name: f for name, f in SMOOTH.items() if name != "own index"}, **OTHERS, **TABLES}


@dataclass(frozen=True)
class Keeping(Equations):
    """Stands still and records functions of its state; a record, unlike a monitor, may be infinite or NaN."""

    functions: tuple = tuple(FUNCTIONS.items())

    def residual(self, p, s, h, z):
        return z - s

    def record(self, p, s, h, z):
        return {name: function(p * s) for name, function in self.functions}


PROGRAM = Still((Keeping(0.0),))


def test_every_function_in_machine_code():
    x = _random.uniform(-2, 2, size=3)
    seen = native.run(PROGRAM, 1.5, x, 0.1, 1, 1).records
    for name, function in FUNCTIONS.items():
        np.testing.assert_allclose(seen[name][0], evaluate(function, 1.5 * x), rtol=1e-13, atol=1e-14, err_msg=name)


@pytest.mark.long
def test_every_function_in_lanes():
    xs = _random.uniform(-2, 2, size=(lanes() + 1, 3))
    seen = run_ensemble(PROGRAM, 1.5, xs, 0.1, 1, 1, axes=(False, True)).records
    for name, function in FUNCTIONS.items():
        for i, x in enumerate(xs):
            expected = evaluate(function, 1.5 * x)
            np.testing.assert_allclose(seen[name][i, 0], expected, rtol=1e-13, atol=1e-13, err_msg=name)


def test_infinities_and_nan_keep_their_meaning():
    x = np.array([0.0, -1.0, 2.0])
    functions = {
        "log": lambda x: jnp.log(x),
        "ratio": lambda x: 1.0 / x - 1.0 / jnp.abs(x),
        "greatest": lambda x: jnp.maximum(jnp.sqrt(x), 0.5),
        "chosen": lambda x: jnp.where(jnp.sqrt(x) >= 0, 1.0, 2.0),
    }

    seen = native.run(Still((Keeping(0.0, functions=tuple(functions.items())),)), 1.5, x, 0.1, 1, 1).records
    for name, function in functions.items():
        np.testing.assert_allclose(seen[name][0], evaluate(function, 1.5 * x), err_msg=name)


def test_extrema_of_sizes_keep_nan_and_the_sign_of_zero():
    def greatest(x, y):
        return np.where((x == 0) & (y == 0), x + y, np.maximum(x, y))  # NumPy leaves open which zero is greater

    def least(x, y):
        return -greatest(-x, -y)

    x = np.array([0.0, -1.0, 2.0])
    numbers = {"any": lambda x: jnp.concatenate([x, -x, jnp.sqrt(-x)]), "size": lambda x: jnp.abs(jnp.sqrt(x) - 1.0)}
    numbers |= {"positive": lambda x: jnp.maximum(-x, 0.0), "least": lambda x: jnp.minimum(jnp.abs(x), -x)}
    functions, expected = {}, {}
    for first, second in product(numbers, repeat=2):
        for function, exact in ((jnp.maximum, greatest), (jnp.minimum, least)):
            one, other, name = numbers[first], numbers[second], f"{exact.__name__} of {first} and {second}"
            functions[name] = lambda x, f=function, a=one, b=other: f(a(x)[:, None], b(x)[None])
            y, z = (np.asarray(evaluate(given, x)) for given in (one, other))
            expected[name] = exact(y[:, None], z[None])
    seen = native.run(Still((Keeping(0.0, functions=tuple(functions.items())),)), 1.0, x, 0.1, 1, 1).records
    for name, given in expected.items():
        np.testing.assert_array_equal(seen[name][0], given, err_msg=name)
        known = ~np.isnan(given)
        np.testing.assert_array_equal(np.signbit(seen[name][0])[known], np.signbit(given)[known], err_msg=name)


def test_an_extremum_of_many_is_taken_by_pairs():
    graph = Tracer().graph
    numbers = nodes([graph.symbol(f"x{i}") for i in range(33)], (33,))
    for name, function in (("max", jnp.max), ("min", jnp.min)):
        (found,) = Tracer(graph).trace(function, numbers).ravel()
        depth = {}
        for node in reachable([found]):
            depth[node] = max((depth[a] for a in node.args), default=-1) + 1
        assert depth[found] == 6 and sum(node.op == name for node in depth) == 32
