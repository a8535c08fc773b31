"""Simplified expressions have the values of what was written, and derivatives those of JAX, at ties too."""

from __future__ import annotations

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.kernels.expressions.differentiation import PARTIALS, backward, forward
from coadjoint.kernels.expressions.expression import reachable
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.expressions.operations import BINARY, UNARY
from coadjoint.kernels.trace.indexing import inside

NUMBERS = {"x": 0.7, "y": -1.3, "c": True, "d": False}


def value(root, given):
    """The number of an expression, by NumPy."""
    known = {}
    for node in reachable([root]):
        args = [known[a] for a in node.args]
        if node.op == "const":
            known[node] = node.value
        elif node.op == "symbol":
            known[node] = given[node.value]
        elif node.op == "div":
            known[node] = np.divide(*args)
        elif node.op == "select":
            known[node] = args[1] if args[0] else args[2]
        else:
            known[node] = (UNARY if len(args) == 1 else BINARY)[node.op](*args)
    return known[root]


def operands(g):
    """Numbers of all forms that are simplified: constants, symbols, and what is negative or a difference."""
    x, y = g.symbol("x"), g.symbol("y")
    return [*(g.constant(k) for k in (0.0, 1.0, -1.0, 2.0, -0.25, 3.0)), x, y, g.neg(x), g.sub(x, y), g.apply("abs", y)]


def conditions(g):
    """Truth values of all forms: constants, symbols, comparisons, and what is not so."""
    x, y = g.symbol("x"), g.symbol("y")
    less = g.apply("lt", x, y)
    return [g.true, g.false, less, g.apply("not", less), g.apply("le", y, x), g.apply("is_finite", x)]


@pytest.mark.parametrize("op", ["add", "sub", "mul", "div", "pow", "min", "max", "atan2", "lt", "le", "gt", "ge"])
def test_an_operation_on_any_two_forms_has_the_value_of_its_arguments(op):
    g = Graph()
    function = np.divide if op == "div" else BINARY[op]
    for a, b in itertools.product(operands(g), repeat=2):
        first, second = value(a, NUMBERS), value(b, NUMBERS)
        if (op == "div" and second == 0) or (op == "pow" and first <= 0):
            continue
        np.testing.assert_allclose(value(g.apply(op, a, b), NUMBERS), function(first, second), rtol=1e-15)


@pytest.mark.parametrize("op", ["neg", "abs", "sin", "cos", "exp", "floor", "sign"])
def test_a_function_of_any_form_has_the_value_of_its_argument(op):
    g = Graph()
    for a in [*operands(g), g.neg(g.sub(g.symbol("y"), g.symbol("x"))), g.apply("abs", g.neg(g.symbol("y")))]:
        np.testing.assert_allclose(value(g.apply(op, a), NUMBERS), UNARY[op](value(a, NUMBERS)), rtol=1e-15)


def test_a_selection_has_the_value_of_the_case_that_holds():
    g = Graph()
    for condition, yes, no in itertools.product(conditions(g), operands(g)[::2], operands(g)[1::2]):
        expected = value(yes if value(condition, NUMBERS) else no, NUMBERS)
        assert value(g.select(condition, yes, no), NUMBERS) == expected
    for condition, yes, no in itertools.product(conditions(g), repeat=3):
        expected = value(yes if value(condition, NUMBERS) else no, NUMBERS)
        assert value(g.select(condition, yes, no), NUMBERS) == expected
    condition = conditions(g)[2]
    assert g.select(condition, g.true, g.false) is condition
    assert g.select(condition, g.false, g.true) is g.apply("not", condition)
    assert g.select(condition, yes, yes) is yes and g.select(g.apply("not", condition), yes, no) is g.select(
        condition, no, yes
    )


@pytest.mark.parametrize("op", ["and", "or", "xor", "eq", "ne", "lt", "le", "gt", "ge"])
def test_truth_values_combine_as_in_logic_and_false_is_less_than_true(op):
    g = Graph()
    for a, b in itertools.product(conditions(g), repeat=2):
        first, second = bool(value(a, NUMBERS)), bool(value(b, NUMBERS))
        assert value(g.apply(op, a, b), NUMBERS) == BINARY[op](first, second)


@pytest.mark.parametrize("op", ["lt", "le", "eq", "ne", "gt", "ge"])
def test_a_truth_value_written_as_a_number_compares_as_that_number(op):
    g = Graph()
    for condition, k in itertools.product(conditions(g)[2:], (0.0, 0.5, 1.0)):
        number = g.select(condition, g.one, g.zero)
        for a, b in ((number, g.constant(k)), (g.constant(k), number)):
            assert value(g.apply(op, a, b), NUMBERS) == BINARY[op](value(a, NUMBERS), value(b, NUMBERS))


@pytest.mark.parametrize("exponent", [0, 1, 2, 7, -3, 64, 65, 0.5, -0.5])
def test_a_power_is_the_power(exponent):
    g = Graph()
    found = value(g.apply("pow", g.symbol("x"), g.constant(exponent)), NUMBERS)
    assert found == pytest.approx(0.7**exponent, rel=1e-14)


@pytest.mark.parametrize(("index", "place"), [(-3.0, 0), (0.0, 0), (2.0, 2), (4.0, 4), (5.0, 4), (np.nan, 0)])
def test_an_index_is_moved_into_its_array(index, place):
    g = Graph()
    assert value(inside(g, g.symbol("x"), 4), {"x": index}) == place


EXTREMA = [
    ("min", jnp.minimum, 1.5, 1.5),
    ("max", jnp.maximum, 1.5, 1.5),
    ("min", jnp.minimum, 1.0, 2.0),
    ("max", jnp.maximum, 1.0, 2.0),
]


@pytest.mark.parametrize(("op", "function", "x", "y"), EXTREMA)
def test_the_derivative_of_an_extremum_is_shared_at_a_tie_as_in_jax(op, function, x, y):
    g = Graph()
    symbols = [g.symbol("x"), g.symbol("y")]
    root = g.apply(op, *symbols)
    expected = jax.grad(function, (0, 1))(x, y)
    (row,) = forward(g, [root], symbols)
    given = {"x": x, "y": y}
    assert [float(value(row[i], given)) for i in (0, 1)] == [float(d) for d in expected]
    assert [float(value(d, given)) for d in backward(g, {root: g.one}, symbols)] == [float(d) for d in expected]


PLACES = {"acosh": 1.7, "log": 0.4, "log2": 0.4, "sqrt": 0.4, "cbrt": 0.4, "rem": 7.3, "pow": 1.4}


@pytest.mark.parametrize("op", sorted(PARTIALS.keys() - {"entry"}))
def test_a_derivative_is_the_slope(op):
    g = Graph()
    names = ["x", "y"] if op in BINARY or op == "div" else ["x"]
    symbols = [g.symbol(name) for name in names]
    root = g.apply(op, *symbols)
    at = {"x": PLACES.get(op, 0.3), "y": 1.9}
    for name, slope in zip(names, backward(g, {root: g.one}, symbols), strict=True):
        step = 1e-6
        ends = [float(value(root, at | {name: at[name] + s * step})) for s in (1, -1)]
        assert float(value(slope, at)) == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("chosen", [True, False])
def test_the_derivative_of_a_choice_is_that_of_what_was_chosen(chosen):
    g = Graph()
    x, y = symbols = [g.symbol("x"), g.symbol("y")]
    root = g.select(g.symbol("c"), g.mul(x, g.mul(y, y)), g.add(x, g.mul(g.constant(3.0), y)))
    found = backward(g, {root: g.constant(2.0)}, symbols)
    slopes = [float(value(one, NUMBERS | {"c": chosen})) for one in found]
    assert slopes == pytest.approx([2 * 1.69, 2 * 2 * 0.7 * -1.3] if chosen else [2.0, 6.0])
