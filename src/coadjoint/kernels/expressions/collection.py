"""Like terms collected, and the factors that never change gathered in front: (p x)(q y) = (p q)(x y).

A node is c b, with a coefficient c that is the same at every step and a product b of all that is not. A sum of two
nodes with the same b has the sum of their coefficients, and c x + c y is c(x + y); a product multiplies coefficients
and rest apart. Then machine code computes the coefficients once, before its loop. No coefficient is distributed over a
sum, whose terms may cancel: p(x − y) keeps the digits of the difference. The form of a node depends on nothing but the
node, so that programs which share a node compute the same bits.
"""

from __future__ import annotations

from collections.abc import Iterable

from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.expressions.graph import Graph


class Collector:
    """Rewrites expressions of a graph; `fixed` are the symbols that never change."""

    def __init__(self, graph: Graph, fixed: Iterable[Expr]) -> None:
        self.graph = graph
        self._fixed = set(fixed)
        self._parts: dict[Expr, tuple[Expr, Expr]] = {}

    def __call__(self, roots: Iterable[Expr]) -> list[Expr]:
        """The roots, rewritten."""
        roots, parts = list(roots), self._parts
        with self.graph.rewriting():
            for node in reachable(roots, lambda node: () if node in parts else node.args):
                if node not in parts:
                    parts[node] = self._split(node)
            return [self._whole(root) for root in roots]

    def _whole(self, node: Expr) -> Expr:
        coefficient, rest = self._parts[node]
        return coefficient if rest is self.graph.one else self.graph.mul(coefficient, rest)

    def _split(self, node: Expr) -> tuple[Expr, Expr]:
        """The coefficient and the rest of a node whose arguments are split."""
        graph, op = self.graph, node.op
        given = [self._parts[a] for a in node.args]
        if op == "const" or node in self._fixed or (given and all(rest is graph.one for _, rest in given)):
            return node, graph.one
        if op == "neg":
            return graph.neg(given[0][0]), given[0][1]
        if op == "mul":
            (c, x), (d, y) = given
            return graph.mul(c, d), graph.mul(x, y)
        if op in ("add", "sub"):
            combine = graph.add if op == "add" else graph.sub
            (c, x), (d, y) = given
            if x is y:
                return self._kept(combine(c, d), x)
            if c is d and c is not graph.one:
                return c, combine(x, y)
            return graph.one, combine(self._whole(node.args[0]), self._whole(node.args[1]))
        return graph.one, graph.again(node, map(self._whole, node.args)) if node.args else node

    def _kept(self, coefficient: Expr, rest: Expr) -> tuple[Expr, Expr]:
        """The parts of a product, those of zero where the coefficient is zero."""
        return (coefficient, self.graph.one) if coefficient is self.graph.zero else (coefficient, rest)
