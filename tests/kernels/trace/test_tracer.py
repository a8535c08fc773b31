"""Expressions have the values and the derivatives of the functions they were traced from."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from functions import LANGUAGE, SMOOTH, TABLES

from coadjoint.kernels.expressions.differentiation import backward, forward
from coadjoint.kernels.expressions.expression import reachable
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.expressions.operations import BINARY, UNARY
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.kernels.trace.while_loops import keep_loop
from coadjoint.kernels.untraceable import Untraceable

SEED = 5
_random = np.random.default_rng(SEED)
A, B = _random.normal(size=(3, 3)), _random.normal(size=3)

UNKNOWN = {
    "while": "while",
    "a while for each row": "while",
    "sorting": "sort",
    "gradient of a determinant": "lu",
}
"""Functions that run on numbers but have no expressions, and the primitive to blame."""


def values(roots, given):
    """The numbers that expressions stand for."""
    known = {}
    for node in reachable(roots):
        args = [known[a] for a in node.args]
        if node.op == "const":
            known[node] = node.value
        elif node.op == "symbol":
            known[node] = given[node]
        elif node.op == "div":
            known[node] = np.divide(*args)
        elif node.op == "select":
            known[node] = args[1] if args[0] else args[2]
        elif node.op == "entry":
            known[node] = node.value.numbers[int(args[0])]
        elif node.op == "loop":
            known[node] = ended(node.value, args)
        elif node.op in ("outcome", "sloped"):
            known[node] = args[0][node.value[0]] if node.op == "outcome" else args[0]
        else:
            known[node] = (UNARY if len(args) == 1 else BINARY)[node.op](*args)
    return np.array([known[root] for root in roots], dtype=float)


def ended(loop, state):
    """The numbers at the end of a loop."""
    while values([loop.test], given := dict(zip(loop.carried, state, strict=True)))[0]:
        state = values(loop.results, given)
    return state


def traced(function, *args):
    """The expressions of function(*args), its symbols, and their values."""
    tracer = Tracer()
    symbols = tracer.symbols("x", args)
    roots = flat(tracer.trace(function, *symbols))
    return tracer.graph, roots, flat(symbols), dict(zip(flat(symbols), flat_numbers(args), strict=True))


def flat_numbers(tree):
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(tree)])


@pytest.mark.parametrize("fill", [None, 2.0])
def test_numbers_that_fill_places_outside_of_an_array_are_left_to_xla(fill):
    def function(a, b):
        return jnp.take(b, jnp.array([1, 7]), mode="fill", fill_value=fill) + a[0, 0]

    with pytest.raises(Untraceable, match="it reads outside its array"):
        traced(function, A, B)
    np.testing.assert_allclose(evaluate(function, A, B), [B[1] + A[0, 0], (fill or np.nan) + A[0, 0]])


@pytest.mark.parametrize("name", [name for name in LANGUAGE if name not in UNKNOWN])
def test_expressions_have_the_values_of_their_function(name):
    _, roots, _, given = traced(LANGUAGE[name], A, B)
    with np.errstate(all="ignore"):
        ours = values(roots, given)
    np.testing.assert_allclose(ours, flat_numbers(evaluate(LANGUAGE[name], A, B)), rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_has_no_expression_is_named(name):
    with pytest.raises(Untraceable, match=UNKNOWN[name]):
        traced(LANGUAGE[name], A, B)


@pytest.mark.parametrize("kind", ["while", "scan"])
def test_a_loop_has_as_many_trips_as_the_sentence_says(kind):
    def loop(trips):
        if kind == "scan":
            return lambda x: jax.lax.scan(lambda c, _: (-c, None), x, length=trips)[0]
        return lambda x: jax.lax.while_loop(lambda c: c[0] < trips, lambda c: (c[0] + 1, -c[1]), (0, x))[1]

    _, roots, symbols, _ = traced(loop(2000), B)
    assert roots == symbols
    with pytest.raises(Untraceable, match="more than 2000 trips"):
        traced(loop(2001), B)


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", TABLES)
def test_constants_are_looked_up_where_jax_looks_by_few_operations(name):
    function = TABLES[name]
    for x in (B, -B, 2 * B):
        _, roots, _, given = traced(function, x)
        np.testing.assert_allclose(values(roots, given), flat_numbers(evaluate(function, x)), rtol=1e-14)
        with jax.enable_x64(True):
            np.testing.assert_allclose(values(roots, given), jax.jit(function)(x), rtol=1e-13, atol=1e-13)
        assert len(reachable(roots)) < 1000


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", {**SMOOTH, **TABLES})
def test_forward_and_backward_derivatives_agree_with_jax(name):
    function = {**SMOOTH, **TABLES}[name]
    graph, roots, symbols, given = traced(function, B)
    theirs = evaluate(jax.jacfwd(function), B).reshape(len(roots), 3)
    rows = forward(graph, roots, symbols)
    ours = [values([row.get(i, graph.zero) for i in range(3)], given) for row in rows]
    np.testing.assert_allclose(np.array(ours), theirs, rtol=1e-10, atol=1e-11)
    weights = np.arange(1.0, len(roots) + 1)
    bars: dict = {}
    for root, weight in zip(roots, weights, strict=True):
        bars[root] = graph.add(bars.get(root, graph.zero), graph.constant(weight))
    np.testing.assert_allclose(values(backward(graph, bars, symbols), given), weights @ theirs, rtol=1e-10, atol=1e-11)


def test_a_kept_loop_has_no_derivative_of_its_own():
    def loop(x):
        return keep_loop(lambda y: jnp.max(y) < 10, lambda y: 2 * y + 1, jnp.abs(x))

    graph, roots, symbols, _ = traced(lambda x: loop(x) + jnp.floor(x), B)
    for derivative in (lambda: forward(graph, roots, symbols), lambda: backward(graph, {roots[0]: graph.one}, symbols)):
        with pytest.raises(Untraceable, match="has no derivative"):
            derivative()
    graph, roots, symbols, _ = traced(lambda x: jnp.where(loop(x) > 12, x, jnp.floor(loop(x))), B)
    assert all(set(row) <= {i} for i, row in enumerate(forward(graph, roots, symbols)))


def test_equal_expressions_are_one_node():
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    assert graph.mul(x, y) is graph.mul(y, x)
    assert graph.sub(x, graph.neg(y)) is graph.add(y, x)
    assert graph.neg(graph.sub(x, y)) is graph.sub(y, x)
    assert graph.mul(graph.zero, graph.apply("exp", x)) is graph.zero
    assert graph.mul(graph.neg(x), graph.neg(y)) is graph.mul(x, y)


def test_constants_fold_in_float64():
    graph = Graph()
    third = graph.div(graph.one, graph.constant(3.0))
    assert third.value == 1.0 / 3.0
    assert graph.apply("sin", third).value == np.sin(1.0 / 3.0)
    assert np.isnan(graph.apply("sqrt", graph.constant(-1.0)).value)
    assert graph.apply("lt", graph.one, third) is graph.false


def test_structural_zeros_remove_what_they_multiply():
    _, roots, _, _ = traced(lambda x: jnp.diag(jnp.array([1.0, 0.0, 2.0])) @ x, B)
    assert len(reachable(roots)) == 5  # two elements, a zero, a two, one product


def test_float32_and_integers_that_depend_on_values_are_refused():
    with pytest.raises(Untraceable, match="float32"):
        traced(lambda x: x.astype(jnp.float32), B)
    with pytest.raises(Untraceable, match="integers"):
        traced(lambda x: jnp.argmax(x) << 2, B)


def test_long_loops_are_refused_rather_than_unrolled():
    with pytest.raises(Untraceable, match="more than"):
        traced(lambda x: jax.lax.fori_loop(0, 100_000, lambda i, y: 0.5 * y, x), B)
