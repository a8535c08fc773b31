"""A function that is called many times: the same numbers as equation by equation, by fewer operations."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.kernels.trace.control import CONTROL
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.kernels.trace.interpreter import Interpreter
from coadjoint.kernels.trace.jaxprs import jaxpr_of
from coadjoint.kernels.trace.numeric import NUMERIC
from coadjoint.kernels.trace.straight_line import Straight
from coadjoint.kernels.untraceable import Untraceable

NUMBERS = Interpreter(NUMERIC, CONTROL)
TABLE = np.linspace(-1, 2, 5)


@jax.jit
def called(x, y):
    return jnp.sin(x) * y + jnp.sum(TABLE)


def everything(x, k):
    turned = jax.lax.fori_loop(0, 3, lambda i, z: called(z, x) - i, x)
    halved = jax.lax.while_loop(lambda z: jnp.max(jnp.abs(z)) > 0.5, lambda z: z / 2, x)
    picked = jax.lax.cond(x[0] > 0, lambda z: jnp.cumsum(z), lambda z: -z, x)
    solved = jnp.linalg.solve(jnp.eye(3) + 0.1 * jnp.outer(x, x), x)
    clipped = jnp.clip(jnp.where(x > 0.3, x**3, jnp.abs(x)), 0.1, 0.9)[k]
    return {"a": turned + halved, "b": picked @ solved, "c": clipped, "d": jnp.linalg.det(jnp.outer(x, x) + jnp.eye(3))}


@pytest.mark.parametrize(
    "function", [everything, lambda x, k: jax.jacfwd(lambda x: everything(x, k))(x)], ids=["value", "slope"]
)
def test_the_numbers_are_those_of_the_interpreter(function):
    random = np.random.default_rng(2)
    closed = jaxpr_of(function, np.zeros(3), np.int32(0))[0]
    straight = Straight(NUMBERS, closed)
    for k in range(3):
        inputs = [random.normal(size=3), np.int32(k)]
        for found, expected in zip(straight(inputs), NUMBERS.run(closed, inputs), strict=True):
            assert found.dtype == expected.dtype
            np.testing.assert_array_equal(found, expected)


def test_what_is_equal_constant_or_unused_is_not_computed_again(monkeypatch):
    counted = []
    sine = NUMERIC["sin"]
    monkeypatch.setitem(NUMERIC, "sin", lambda p, x: counted.append(x) or sine(p, x))

    def function(x):
        unused = jnp.sin(3 * x)  # noqa: F841
        return called(x, x) + called(x, 2 * x) + jnp.sin(jnp.asarray(TABLE[0]))

    straight = Straight(NUMBERS, jaxpr_of(function, np.float64(0))[0])
    counted.clear()
    straight([np.array(0.7)])
    assert len(counted) == 1


def test_functions_with_their_own_derivative_are_inlined(monkeypatch):
    straight = Straight(NUMBERS, jaxpr_of(lambda x: jax.nn.relu(x) + jnp.sinc(x), np.float64(0))[0])
    monkeypatch.setattr(NUMBERS, "run", None)
    assert straight([np.array(0.5)])[0] == pytest.approx(0.5 + np.sinc(0.5), rel=1e-15)


def test_a_table_is_the_same_at_every_call_and_its_results_are_its_own():
    at = tabulate(lambda x: (TABLE * x, jnp.asarray(TABLE)), np.float64(0))
    results = [at(np.float64(0.3)) for _ in range(3)]
    for product, table in results:
        np.testing.assert_array_equal(product, 0.3 * TABLE)
        np.testing.assert_array_equal(table, TABLE)
        table[:] = 0.0
    np.testing.assert_array_equal(at(np.float64(0.3))[1], np.linspace(-1, 2, 5))


@pytest.mark.parametrize(
    "also",
    [lambda x: x[::-1], lambda x: jax.pure_callback(np.sin, jax.ShapeDtypeStruct(x.shape, x.dtype), x)],
    ids=["by_numpy", "by_xla"],
)
def test_rows_in_batches_are_those_of_full_batches_and_share_one_factorisation(also, monkeypatch):
    random, factorised, lu = np.random.default_rng(5), [], NUMERIC["lu"]
    matrix, rows = random.normal(size=(4, 4)), random.normal(size=(11, 4))
    monkeypatch.setitem(NUMERIC, "lu", lambda p, a: factorised.append(a) or lu(p, a))
    at = tabulate(lambda a, x: (jax.vmap(lambda v: jnp.linalg.solve(a, v))(x), also(x)), matrix, rows[:3])
    for one in (matrix, matrix.T):
        full = [at(one, np.resize(rows[k : k + 3], (3, 4))) for k in range(0, 11, 3)]
        factorised.clear()
        for found, *parts in zip(at.of_rows(one, rows, 3), *full, strict=True):
            np.testing.assert_array_equal(found, np.concatenate(parts)[:11])
        assert len(factorised) <= 1


def test_a_primitive_without_a_rule_is_named():
    closed = jaxpr_of(lambda x: jax.pure_callback(np.sin, jax.ShapeDtypeStruct((), np.float64), x), np.float64(0))[0]
    with pytest.raises(Untraceable, match="pure_callback"):
        Straight(NUMBERS, closed)
