"""Functions are unchanged only if all that they reach is: code, closures, defaults, globals, and what these hold."""

from __future__ import annotations

import functools
import random
import time
import types
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.reached import numbers_of, reached

FACTOR, TABLE = 0.1, np.full(3, 0.1)
THREE, ONE = jnp.ones(3), 1
outside = types.SimpleNamespace(factor=0.1)


def helper(x):
    return FACTOR * x


def by_helper(x):
    return jnp.sum(helper(x))


def by_table(x):
    return TABLE @ x


def by_default(x, *, factor=0.1):
    return factor * x


def by_nested(x):
    return jax.vmap(lambda y: FACTOR * y)(x)


def by_closure():
    factor = [0.1, {"more": np.ones(2)}]

    def function(x):
        return factor[0] * x

    return function


def other(x):
    return 0.7 * x


CLOSURE: Any = by_closure()
CELL = CLOSURE.__closure__[0]
CHANGES = {
    "body": (helper, lambda patch: patch.setattr(helper, "__code__", other.__code__)),
    "global": (helper, lambda patch: patch.setitem(globals(), "FACTOR", 0.7)),
    "global of a helper": (by_helper, lambda patch: patch.setitem(globals(), "FACTOR", 0.7)),
    "global of a function within": (by_nested, lambda patch: patch.setitem(globals(), "FACTOR", 0.7)),
    "helper": (by_helper, lambda patch: patch.setitem(globals(), "helper", other)),
    "array": (by_table, lambda patch: patch.setitem(globals(), "TABLE", np.full(3, 0.7))),
    "array in place": (by_table, lambda patch: TABLE.fill(0.7)),
    "default": (by_default, lambda patch: patch.setitem(by_default.__kwdefaults__, "factor", 0.7)),
    "closure": (CLOSURE, lambda patch: patch.setattr(CELL, "cell_contents", [0.7])),
    "array in place in a closure": (CLOSURE, lambda patch: CELL.cell_contents[1]["more"].fill(0.7)),
    "argument of a partial": (functools.partial(np.dot, TABLE), lambda patch: TABLE.fill(0.7)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_of_anything_that_a_function_reaches_is_seen(change):
    function, mutate = CHANGES[change]
    before = reached(function)
    assert before is not None
    assert reached(function) == before
    assert hash(reached(function)) == hash(before)
    with pytest.MonkeyPatch.context() as patch:
        mutate(patch)
        assert reached(function) not in (before, None)
    TABLE.fill(0.1)
    CELL.cell_contents[1]["more"].fill(1.0)
    assert reached(function) == before


@pytest.mark.parametrize(
    ("one", "two"), [(1, 1.0), (1, True), (0.0, -0.0), ((1, 2), [1, 2]), (np.zeros(2), np.zeros(2, int)), ("1", 1)]
)
def test_values_that_compare_equal_but_trace_differently_differ(one, two):
    assert reached(one) != reached(two)
    assert reached({"a": one}) != reached({"a": two})


def test_two_functions_of_one_body_differ():
    assert reached(by_closure()) != reached(by_closure())


class Own:
    factor = 0.1

    def method(self, x):
        return self.factor * x


def test_what_cannot_be_compared_is_unknown():
    def by_object(x):
        return outside.factor * x

    def by_clock(x):
        return time.time() * x

    def by_random(x):
        return random.random() * x

    def by_numpy_random(x):
        return np.random.uniform() * x

    def by_file(x):
        return np.load("table.npy") @ x

    def by_import(x):
        import math

        return math.pi * x

    def by_name(x):
        return globals()["FACTOR"] * x

    def by_class(x):
        return Own.factor * x

    unknown = [by_object, by_clock, by_random, by_numpy_random, by_file, by_import, by_name, by_class]
    for function in (*unknown, Own().method, jax.jit(other), functools.cache(other)):
        assert reached(function) is None, function


def test_objects_of_the_library_count_by_what_they_hold():
    group, held = co.SO3(), co.Held([0.0, 1.0], [1.0, 2.0])
    assert reached(group) == reached(co.SO3())
    assert reached(held) is not None
    assert reached(held) != reached(co.Held([0.0, 1.0], [1.0, 2.5]))
    assert reached(THREE, jnp.sum, co.Midpoint()) is not None
    assert reached(THREE) != reached(2 * THREE)


def test_numbers_count_by_type_shape_and_bytes():
    assert numbers_of([1.0, np.ones(2)]) == numbers_of([np.float64(1.0), np.ones(2)])
    assert len({numbers_of([x]) for x in (1.0, -0.0, 0.0, 0, np.zeros(1), np.zeros((1, 1)))}) == 6


def test_a_traced_value_is_unknown():
    found = []
    jax.make_jaxpr(lambda x: found.append(reached(x)) or x)(1.0)
    assert found == [None]
