"""Derivatives of expressions: forward along tangents that are sparse, and backward from cotangents."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from coadjoint.kernels.expressions.block_elimination import guarded_solve
from coadjoint.kernels.expressions.elimination import Matrix
from coadjoint.kernels.expressions.expression import TRUTH, Expr, reachable
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.untraceable import Untraceable

Partial = Callable[[Graph, Expr], Sequence[Expr]]


def _reciprocal_of_root(sign: float) -> Partial:
    """1/√(1 + sign·x²), the derivative of asin (−1) and asinh (+1)."""

    def rule(g: Graph, n: Expr) -> Sequence[Expr]:
        square = g.mul(n.args[0], n.args[0])
        inner = g.add(g.one, square) if sign > 0 else g.sub(g.one, square)
        return (g.div(g.one, g.apply("sqrt", inner)),)

    return rule


def _pow(g: Graph, n: Expr) -> Sequence[Expr]:
    a, b = n.args
    by_base = g.mul(b, g.apply("pow", a, g.sub(b, g.one)))
    by_exponent = g.zero if b.op == "const" else g.mul(n, g.apply("log", a))
    return by_base, by_exponent


def _atan2(g: Graph, n: Expr) -> Sequence[Expr]:
    y, x = n.args
    square = g.add(g.mul(x, x), g.mul(y, y))
    return g.div(x, square), g.neg(g.div(y, square))


def _extremum(op: str) -> Partial:
    """The share of each argument; at a tie each takes half, as in JAX."""

    def rule(g: Graph, n: Expr) -> Sequence[Expr]:
        a, b = n.args
        half = g.constant(0.5)
        first = g.select(g.apply("eq", a, b), half, g.select(g.apply(op, a, b), g.one, g.zero))
        return first, g.sub(g.one, first)

    return rule


def _rem(g: Graph, n: Expr) -> Sequence[Expr]:
    a, b = n.args
    return g.one, g.neg(g.apply("truncate", g.div(a, b)))


def _sign_of(g: Graph, n: Expr) -> Sequence[Expr]:
    return (g.apply("sign", n.args[0]),)


def _gauss(factor: float) -> Partial:
    scale = factor * 2.0 / math.sqrt(math.pi)

    def rule(g: Graph, n: Expr) -> Sequence[Expr]:
        x = n.args[0]
        return (g.mul(g.constant(scale), g.apply("exp", g.neg(g.mul(x, x)))),)

    return rule


def _unary(rule: Callable[[Graph, Expr, Expr], Expr]) -> Partial:
    """From (graph, argument, value) to the derivative."""
    return lambda g, n: (rule(g, n.args[0], n),)


_FLAT = ("sign", "floor", "ceil", "round_even", "round_away", "truncate", "entry")

PARTIALS: dict[str, Partial] = {
    "neg": lambda g, n: (g.constant(-1.0),),
    "add": lambda g, n: (g.one, g.one),
    "sub": lambda g, n: (g.one, g.constant(-1.0)),
    "mul": lambda g, n: (n.args[1], n.args[0]),
    "div": lambda g, n: (g.div(g.one, n.args[1]), g.neg(g.div(n, n.args[1]))),
    "pow": _pow,
    "atan2": _atan2,
    "min": _extremum("lt"),
    "max": _extremum("gt"),
    "rem": _rem,
    "abs": _sign_of,
    "sqrt": _unary(lambda g, x, y: g.div(g.constant(0.5), y)),
    "cbrt": _unary(lambda g, x, y: g.div(g.constant(1 / 3), g.mul(y, y))),
    "exp": _unary(lambda g, x, y: y),
    "exp2": _unary(lambda g, x, y: g.mul(g.constant(math.log(2)), y)),
    "expm1": _unary(lambda g, x, y: g.add(y, g.one)),
    "log": _unary(lambda g, x, y: g.div(g.one, x)),
    "log2": _unary(lambda g, x, y: g.div(g.constant(1 / math.log(2)), x)),
    "log1p": _unary(lambda g, x, y: g.div(g.one, g.add(g.one, x))),
    "sin": _unary(lambda g, x, y: g.apply("cos", x)),
    "cos": _unary(lambda g, x, y: g.neg(g.apply("sin", x))),
    "tan": _unary(lambda g, x, y: g.add(g.one, g.mul(y, y))),
    "asin": _reciprocal_of_root(-1.0),
    "acos": lambda g, n: (g.neg(_reciprocal_of_root(-1.0)(g, n)[0]),),
    "atan": _unary(lambda g, x, y: g.div(g.one, g.add(g.one, g.mul(x, x)))),
    "sinh": _unary(lambda g, x, y: g.apply("cosh", x)),
    "cosh": _unary(lambda g, x, y: g.apply("sinh", x)),
    "tanh": _unary(lambda g, x, y: g.sub(g.one, g.mul(y, y))),
    "asinh": _reciprocal_of_root(1.0),
    "acosh": _unary(
        lambda g, x, y: g.div(g.one, g.mul(g.apply("sqrt", g.sub(x, g.one)), g.apply("sqrt", g.add(x, g.one))))
    ),
    "atanh": _unary(lambda g, x, y: g.div(g.one, g.sub(g.one, g.mul(x, x)))),
    "erf": _gauss(1.0),
    "erfc": _gauss(-1.0),
    **{op: lambda g, n: (g.zero,) for op in _FLAT},
}
"""The partial derivatives of a node by its arguments; `select`, "solution", "sloped", loops and truth values are
treated where they occur."""


class _System:
    """A linear system A x = b of a "pivoted" node, (n, n), with its solution."""

    def __init__(self, graph: Graph, node: Expr) -> None:
        assert isinstance(node.value, tuple)
        count = len(node.value)
        self.right = node.args[1 + count :]
        self.entries = {divmod(place, len(self.right)): x for place, x in zip(node.value, node.args[1:], strict=False)}
        self._graph = graph
        self.solution = self.solved(self.right)

    def solved(self, right: Sequence[Expr], transposed: bool = False) -> list[Expr]:
        """y (n,) with A y = right, or Aᵀ y = right, with pivots where A x = b needs them."""
        n = len(right)
        matrix: Matrix = [[self._graph.zero] * n for _ in range(n)]
        for (i, j), x in self.entries.items():
            i, j = (j, i) if transposed else (i, j)
            matrix[i][j] = x
        return guarded_solve(self._graph, matrix, right)

    def tangents(self, known: Mapping[Expr, dict[int, Expr]]) -> dict[int, list[Expr]]:
        """The tangents ẋ = A⁻¹(ḃ − Ȧx) of the solution, from those of A and b."""
        graph = self._graph
        sides: dict[int, list[Expr]] = {}

        def side(i: int) -> list[Expr]:
            return sides.setdefault(i, [graph.zero] * len(self.right))

        for k, b in enumerate(self.right):
            for i, d in known.get(b, {}).items():
                side(i)[k] = d
        for (k, j), x in self.entries.items():
            for i, d in known.get(x, {}).items():
                side(i)[k] = graph.sub(side(i)[k], graph.mul(d, self.solution[j]))
        zero = graph.zero
        return {i: self.solved(right) for i, right in sides.items() if any(x is not zero for x in right)}

    def cotangents(self, bars: Mapping[int, Expr]) -> list[tuple[Expr, Expr]]:
        """Arguments and what they receive from the cotangents of the solution: b̄ = A⁻ᵀx̄, Ā = −b̄ xᵀ."""
        graph = self._graph
        found = self.solved([bars.get(i, graph.zero) for i in range(len(self.right))], transposed=True)
        of_matrix = [(x, graph.neg(graph.mul(found[k], self.solution[j]))) for (k, j), x in self.entries.items()]
        return [*zip(self.right, found, strict=True), *of_matrix]


def _inputs(node: Expr) -> tuple[Expr, ...]:
    """The arguments of which the value of a node depends; of a solution the system alone, not how it is solved."""
    return node.args[{"solution": 2, "sloped": 1}.get(node.op, 0) :]


def _lacks(node: Expr, lacking: set[Expr]) -> bool:
    """Whether a node has no derivative because one of its arguments has none."""
    given = node.args[1:] if node.op == "select" else _inputs(node)
    return node.op not in TRUTH and node.op not in _FLAT and any(a in lacking for a in given)


def _partials(graph: Graph, node: Expr) -> Sequence[Expr]:
    if node.op == "sloped":
        return graph.zero, graph.one
    rule = PARTIALS.get(node.op)
    if rule is None:
        raise Untraceable(node.op, "it has no derivative here")
    return rule(graph, node)


def forward(graph: Graph, roots: Sequence[Expr], by: Sequence[Expr]) -> list[dict[int, Expr]]:
    """For each root its derivatives by the symbols `by`, {index in by: derivative}; absent entries are zero."""
    return _pushed(graph, roots, {symbol: {i: graph.one} for i, symbol in enumerate(by)})


def directional(graph: Graph, roots: Sequence[Expr], along: Mapping[Expr, Expr]) -> list[Expr]:
    """For each root its derivative along one direction: `along` maps symbols to their tangents."""
    found = _pushed(graph, roots, {symbol: {0: tangent} for symbol, tangent in along.items()})
    return [row.get(0, graph.zero) for row in found]


def _pushed(graph: Graph, roots: Sequence[Expr], tangents: dict[Expr, dict[int, Expr]]) -> list[dict[int, Expr]]:
    """The sparse tangents of the roots from those of the symbols, to which all others on the way are added."""
    solved: dict[Expr, dict[int, list[Expr]]] = {}
    lacking: set[Expr] = set()  # nodes that depend on the symbols through loops, which have no derivatives
    for node in reachable(roots, _inputs):
        if node in tangents:
            continue
        inner = [tangents.get(a) for a in node.args]
        if _lacks(node, lacking) or (node.op == "loop" and any(inner)):
            lacking.add(node)
        elif node.op == "solution":
            columns = solved.get(node.args[2], {})
            tangents[node] = {i: column[node.value] for i, column in columns.items()}  # pyright: ignore
        elif not any(inner):
            continue
        elif node.op == "pivoted":
            solved[node] = _System(graph, node).tangents(tangents)
        elif node.op == "select":
            tangents[node] = _select_tangent(graph, node, inner[1] or {}, inner[2] or {})
        elif node.op not in TRUTH:
            tangents[node] = _tangent(graph, node, inner)
    if any(root in lacking for root in roots):
        raise Untraceable("while", "the number of its trips depends on values, so that it has no derivative")
    return [{i: d for i, d in tangents.get(root, {}).items() if d is not graph.zero} for root in roots]


def _tangent(graph: Graph, node: Expr, inner: list[dict[int, Expr] | None]) -> dict[int, Expr]:
    if node.op == "div":
        # (ȧ − (a/b) ḃ)/b has one division where ȧ/b − ḃ (a/b)/b would have two.
        top, bottom = inner[0] or {}, inner[1] or {}
        keys = {**top, **bottom}
        over = {i: graph.sub(top.get(i, graph.zero), graph.mul(node, bottom.get(i, graph.zero))) for i in keys}
        return {i: graph.div(d, node.args[1]) for i, d in over.items()}
    total: dict[int, Expr] = {}
    for partial, tangent in zip(_partials(graph, node), inner, strict=True):
        for i, d in (tangent or {}).items():
            term = graph.mul(partial, d)
            total[i] = graph.add(total[i], term) if i in total else term
    return total


def _select_tangent(graph: Graph, node: Expr, yes: dict[int, Expr], no: dict[int, Expr]) -> dict[int, Expr]:
    zero = graph.zero
    return {i: graph.select(node.args[0], yes.get(i, zero), no.get(i, zero)) for i in {**yes, **no}}


def backward(graph: Graph, roots: Mapping[Expr, Expr], by: Sequence[Expr]) -> list[Expr]:
    """Σ cotangent·∂root/∂symbol for every symbol of `by`; `roots` maps each root to its cotangent."""
    wanted = set(by)
    order = reachable(roots, _inputs)
    active = set(wanted)
    for node in order:
        if any(a in active for a in _inputs(node)):
            active.add(node)
    bars: dict[Expr, Expr] = dict(roots)
    solutions: dict[Expr, dict[int, Expr]] = {}

    def send(to: Expr, bar: Expr) -> None:
        if to in active and bar is not graph.zero:
            bars[to] = graph.add(bars[to], bar) if to in bars else bar

    for node in reversed(order):
        bar = bars.get(node)
        if node.op == "pivoted" and node in solutions:
            for argument, part in _System(graph, node).cotangents(solutions[node]):
                send(argument, part)
        if bar is None or node not in active or node in wanted or node.op in TRUTH:
            continue
        if node.op == "solution":
            solutions.setdefault(node.args[2], {})[node.value] = bar  # pyright: ignore
            continue
        if node.op == "select":
            send(node.args[1], graph.select(node.args[0], bar, graph.zero))
            send(node.args[2], graph.select(node.args[0], graph.zero, bar))
            continue
        if node.op == "outcome":
            raise Untraceable("while", "the number of its trips depends on values, so that it has no derivative")
        for argument, partial in zip(node.args, _partials(graph, node), strict=True):
            send(argument, graph.mul(bar, partial))
    return [bars.get(symbol, graph.zero) for symbol in by]
