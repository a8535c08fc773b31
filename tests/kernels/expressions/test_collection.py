"""Collected expressions have the values of the written ones, and what never changes stands in front of them."""

from __future__ import annotations

import numpy as np
import pytest
from test_simplification import value

from coadjoint.kernels.expressions.collection import Collector
from coadjoint.kernels.expressions.expression import reachable
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.untraceable import TooLarge

FIXED = ("p", "q", "h")
CHANGING = ("x", "y", "z")


def symbols(graph):
    return {name: graph.symbol(name) for name in (*FIXED, *CHANGING)}


def collector(graph):
    return Collector(graph, [graph.symbol(name) for name in FIXED])


def at_each_step(root, graph):
    """The operations on what changes."""
    changing = {graph.symbol(name) for name in CHANGING}
    found = []
    for node in reachable([root]):
        if any(a in changing for a in node.args):
            changing.add(node)
            found.append(node.op)
    return found


def random_expression(graph, random, depth):
    if depth == 0:
        name = random.choice([*FIXED, *CHANGING, "1", "0.5", "-2"])
        return symbols(graph).get(name) or graph.constant(float(name))
    op = random.choice(["add", "sub", "mul", "neg", "sin", "div"], p=[0.3, 0.25, 0.3, 0.05, 0.05, 0.05])
    first = random_expression(graph, random, depth - 1)
    if op in ("neg", "sin"):
        return graph.apply(op, first)
    second = random_expression(graph, random, depth - 1)
    return graph.apply(op, first, graph.add(graph.constant(3.0), graph.apply("abs", second)) if op == "div" else second)


@pytest.mark.parametrize("seed", range(20))
def test_collected_expressions_have_the_value_of_the_written_ones(seed):
    print(f"seed {seed}")
    random, graph = np.random.default_rng(seed), Graph()
    given = dict(zip((*FIXED, *CHANGING), random.uniform(0.5, 2.0, 6), strict=True))
    written = [random_expression(graph, random, depth) for depth in (2, 3, 4, 5, 6, 7)]
    for before, after in zip(written, collector(graph)(written), strict=True):
        assert value(after, given) == pytest.approx(value(before, given), rel=1e-10, abs=1e-10)


def test_a_gyroscopic_term_is_one_coefficient_times_the_product_of_two_velocities():
    graph = Graph()
    p, q, h, x, y, _ = symbols(graph).values()
    # (q y)(h x) − (p x)(h y) = h (q − p) x y
    written = graph.sub(graph.mul(graph.mul(q, y), graph.mul(h, x)), graph.mul(graph.mul(p, x), graph.mul(h, y)))
    (found,) = collector(graph)([written])
    assert len(at_each_step(written, graph)) == 7
    assert at_each_step(found, graph) == ["mul", "mul"]


def test_a_coefficient_is_not_distributed_over_a_difference_whose_terms_cancel():
    graph = Graph()
    p, q, _, x, y, _ = symbols(graph).values()
    difference = graph.sub(x, y)
    # p (x − y) + q (x − y) = (p + q)(x − y), which is exact where x and y are near
    written = graph.add(graph.mul(p, difference), graph.mul(q, difference))
    (found,) = collector(graph)([written])
    assert at_each_step(found, graph) == ["sub", "mul"]
    given = {"p": 0.1, "q": 0.2, "x": 1.0 + 2**-40, "y": 1.0}
    assert value(found, given) == (0.1 + 0.2) * 2**-40


def test_the_round_off_of_a_sum_that_a_compensated_sum_recovers_is_not_simplified_to_zero():
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    total = graph.add(x, y)
    lost = graph.sub(graph.sub(total, x), y)
    (found,) = collector(graph)([lost])
    assert value(found, {"x": 1.0, "y": 1e-17}) == -1e-17


def test_the_form_of_an_expression_does_not_depend_on_others():
    graph, other = Graph(), Graph()
    random = np.random.default_rng(3)
    roots = [random_expression(graph, random, 6) for _ in range(5)]
    random = np.random.default_rng(3)
    again = [random_expression(other, random, 6) for _ in range(5)]
    together, alone = collector(graph)(roots), [collector(other)([root])[0] for root in again]
    given = dict(zip((*FIXED, *CHANGING), np.random.default_rng(4).uniform(0.5, 2.0, 6), strict=True))
    assert [value(root, given) for root in together] == [value(root, given) for root in alone]


@pytest.mark.parametrize("truth", [False, True])
def test_a_truth_value_that_never_changes_stays_one(truth):
    graph = Graph()
    x, p = graph.symbol("x"), graph.symbol("p")
    for fixed in (graph.constant(truth), graph.apply("lt", p, graph.zero)):
        root = graph.apply("xor", graph.apply("lt", x, graph.zero), fixed)
        (found,) = collector(graph)([root])
        assert found is root and all(a.is_truth for a in found.args)


def test_nodes_that_are_collected_already_are_not_visited_again(monkeypatch):
    """Equations and certificates of a step are collected one by one, and share most of their nodes."""
    from coadjoint.kernels.expressions import collection

    graph, visits = Graph(), []
    x, root = graph.symbol("x"), graph.symbol("y")
    for _ in range(200):
        root = graph.add(graph.mul(root, x), x)

    def counted(roots, *how):
        found = reachable(roots, *how)
        visits.append(len(found))
        return found

    monkeypatch.setattr(collection, "reachable", counted)
    collect = collector(graph)
    first, second = collect([root]), collect([graph.add(root, graph.symbol("z"))])
    assert visits[0] > 400 and visits[1] <= 3
    assert second == [graph.add(first[0], graph.symbol("z"))]


def test_a_coefficient_of_two_terms_stands_in_front_of_their_sum():
    graph = Graph()
    p, _, h, x, y, z = symbols(graph).values()
    ph = graph.mul(p, h)
    written = graph.add(graph.mul(graph.mul(p, x), h), graph.mul(ph, graph.mul(y, z)))
    (found,) = collector(graph)([written])
    assert found is graph.mul(ph, graph.add(x, graph.mul(y, z)))


def test_rewriting_does_not_bring_a_program_over_its_limit():
    """A limit counts what a program computes; what is collected replaces it."""
    graph = Graph(limit=90)
    p, q, h, x, y, _ = symbols(graph).values()
    written = x
    for factor in [p, q, h] * 6:
        written = graph.mul(graph.add(graph.mul(factor, written), y), graph.mul(p, h))
    (found,) = collector(graph)([written])
    assert len(set(reachable([found]))) <= 90 < len(graph._table)
    with pytest.raises(TooLarge):
        for _ in range(90):
            written = graph.mul(graph.add(written, x), y)
