"""Elements whose places depend on values are those that JAX takes, inside, at the ends and beyond them."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from test_tracer import traced, values

from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.trace import indexing
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.indexing import _require_few, window
from coadjoint.kernels.untraceable import Untraceable

X = np.arange(12.0).reshape(4, 3) + 0.5
INDICES = np.array([[0.0, 2.0], [3.0, 1.0], [2.0, 0.0], [-1.0, 1.0], [4.0, 5.0], [1.0, -2.0]])
"""Rows that are inside, at the ends, and beyond them."""


def slices(x, at):
    return lax.dynamic_slice(x, (at[0].astype(int), at[1].astype(int)), (2, 2))


def clipped(x, at):
    return x.at[at[0].astype(int), at[1].astype(int)].get(mode="clip")


def filled(x, at):
    return x.at[at[0].astype(int), at[1].astype(int)].get(mode="fill", fill_value=-7.0)


def added(x, at):
    return x.at[at[0].astype(int)].add(jnp.arange(3.0) + at[1], mode="drop")


def added_clipped(x, at):
    return x.at[at[0].astype(int), at[1].astype(int)].add(2.5, mode="clip")


@pytest.mark.cases(6)
@pytest.mark.parametrize("constant", [False, True], ids=["of values", "of constants"])
@pytest.mark.parametrize("function", [slices, clipped, filled, added, added_clipped], ids=lambda f: f.__name__)
def test_elements_are_those_of_jax(function, constant):
    given = (lambda at: function(jnp.asarray(X), at),) if constant else (function, X)
    for at in INDICES:
        expected = evaluate(given[0], *given[1:], at)
        _, roots, _, numbers = traced(given[0], *given[1:], at)
        assert np.array_equal(values(roots, numbers), np.ravel(expected), equal_nan=True), at


def test_negative_indices_count_from_the_end_as_in_numpy():
    for at in np.array([[-1.0, -3.0], [-4.0, 2.0]]):
        _, roots, _, numbers = traced(lambda x, at: x[at[0].astype(int), at[1].astype(int)], X, at)
        assert values(roots, numbers) == [X[int(at[0]), int(at[1])]]


def test_more_places_than_a_step_is_worth_are_left_to_xla(monkeypatch):
    monkeypatch.setattr(indexing, "MAX_SELECTIONS", 12)
    _require_few("gather", 3, (2, 2))
    _require_few("gather", 12, ())
    with pytest.raises(Untraceable, match="gather"):
        _require_few("gather", 13, ())
    with pytest.raises(Untraceable, match="gather"):
        _require_few("gather", 3, (5, 1))
    g = Graph()
    x = np.array([g.constant(float(k)) for k in range(14)], object)
    assert window(g, x[:13], [g.symbol("i")], [1]).shape == (1,)
    with pytest.raises(Untraceable, match="dynamic_slice"):
        window(g, x, [g.symbol("i")], [1])


def test_a_gather_counts_all_of_its_rows(monkeypatch):
    """(2, 3) places of an array of 12: 72 selections."""
    rows = np.array([[0.0, 1.0, 2.0], [3.0, 0.0, 1.0]])
    monkeypatch.setattr(indexing, "MAX_SELECTIONS", 72)
    taken = lambda x, at: x.ravel()[at.astype(int)]  # noqa: E731
    _, roots, _, numbers = traced(taken, X, rows)
    assert np.array_equal(values(roots, numbers), np.ravel(X)[rows.astype(int)].ravel())
    monkeypatch.setattr(indexing, "MAX_SELECTIONS", 71)
    with pytest.raises(Untraceable, match="too many places"):
        traced(taken, X, rows)
