"""Like terms collected, and the factors that never change gathered in front: (p x)(q y) = (p q)(x y).

A node is Σ c_i b_i, with coefficients c_i that are the same at every step and products b_i of all that is not. A sum of
two nodes with the same b_i has the sums of their coefficients; a product of two multiplies coefficients and rest apart.
Then machine code computes the coefficients once, before its loop. The form of a node depends on nothing but the node,
so that programs which share a node compute the same bits.
"""

from __future__ import annotations

from collections.abc import Iterable

from coadjoint.kernels.expressions.expression import Expr, Graph, reachable

Terms = dict[Expr, Expr]
"""Coefficients by what they multiply."""

MOST = 6
"""Sums of more terms are not compared with others."""


class Collector:
    """Rewrites expressions of a graph; `fixed` are the symbols that never change."""

    def __init__(self, graph: Graph, fixed: Iterable[Expr]) -> None:
        self.graph = graph
        self._fixed = set(fixed)
        self._terms: dict[Expr, Terms] = {}
        self._new: dict[Expr, Expr] = {}

    def __call__(self, roots: Iterable[Expr]) -> list[Expr]:
        """The roots, rewritten."""
        roots = list(roots)
        for node in reachable(roots):
            if node not in self._new:
                self._new[node], self._terms[node] = self._rewritten(node)
        return [self._new[root] for root in roots]

    def _rewritten(self, node: Expr) -> tuple[Expr, Terms]:
        graph, op = self.graph, node.op
        if op == "const" or node in self._fixed or (node.args and all(self._steady(a) for a in node.args)):
            return node, {graph.one: node}
        terms = [self._terms[a] for a in node.args]
        if op == "neg":
            return self._summed({b: graph.neg(c) for b, c in terms[0].items()}, graph.neg(self._new[node.args[0]]))
        if op == "mul":
            return self._product(*node.args)
        if op in ("add", "sub"):
            return self._sum(node, *terms)
        new = graph.again(node, [self._new[a] for a in node.args]) if node.args else node
        return new, {new: graph.one}

    def _steady(self, node: Expr) -> bool:
        return list(self._terms[node]) == [self.graph.one]

    def _single(self, node: Expr) -> tuple[Expr, Expr]:
        """A node as coefficient and rest."""
        terms = self._terms[node]
        if len(terms) == 1:
            ((base, factor),) = terms.items()
            return factor, base
        return self.graph.one, self._new[node]

    def _product(self, first: Expr, second: Expr) -> tuple[Expr, Terms]:
        graph = self.graph
        (c, x), (d, y) = self._single(first), self._single(second)
        factor, base = graph.mul(c, d), graph.mul(x, y)
        new = graph.mul(factor, base)
        for steady, other in ((first, second), (second, first)):
            if self._steady(steady) and len(self._terms[other]) > 1:
                return new, {b: graph.mul(self._new[steady], e) for b, e in self._terms[other].items()}
        return new, {base: factor}

    def _sum(self, node: Expr, first: Terms, second: Terms) -> tuple[Expr, Terms]:
        graph = self.graph
        combine = graph.add if node.op == "add" else graph.sub
        if set(first) == set(second):
            merged = {b: combine(c, second[b]) for b, c in first.items()}
            kept = {b: c for b, c in merged.items() if not c.is_constant(0.0)}
            return self._summed(kept, None)
        new = combine(*(self._new[a] for a in node.args))
        if len({*first, *second}) != len(first) + len(second) or len(first) + len(second) > MOST:
            return new, {new: graph.one}
        signed = {b: c if node.op == "add" else graph.neg(c) for b, c in second.items()}
        return new, {**first, **signed}

    def _summed(self, terms: Terms, new: Expr | None) -> tuple[Expr, Terms]:
        """Terms as an expression, that of `new` where it is known."""
        graph = self.graph
        if not terms:
            return graph.zero, {graph.one: graph.zero}
        if new is None or len(terms) == 1:
            new = graph.zero
            for base, factor in terms.items():
                new = graph.add(new, graph.mul(factor, base))
        return new, terms
