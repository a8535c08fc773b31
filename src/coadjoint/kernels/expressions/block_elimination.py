"""Linear systems over expressions by elimination of blocks of up to three unknowns, whose pivots are watched."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from coadjoint.kernels.expressions import elimination
from coadjoint.kernels.expressions.elimination import Matrix, dot
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import Graph

Pivots = Callable[[Graph, Matrix], list[int]]
"""Which unknowns of a matrix are eliminated first, up to three."""

CANCELLATION = 1e-4
"""A pivot block whose determinant loses more digits than this is not used: pivoted elimination takes over."""


class Changing:
    """Expressions that change at every step: some symbols, and the requested expressions that depend on them."""

    def __init__(self, symbols: set[Expr]) -> None:
        self.nodes = set(symbols)
        self._seen: set[Expr] = set()

    def mark(self, roots: Iterable[Expr]) -> None:
        """Find the expressions that change, among the roots and all that they depend on."""
        stack, found = [x for x in roots if x not in self._seen], []
        while stack:
            node = stack.pop()
            if node not in self._seen:
                self._seen.add(node)
                found.append(node)
                stack.extend(x for x in node.args if x not in self._seen)
        for node in sorted(found, key=lambda node: node.number):
            if any(x in self.nodes for x in node.args):
                self.nodes.add(node)


def guarded_solve(graph: Graph, matrix: Matrix, right: Sequence[Expr]) -> list[Expr]:
    """x with matrix x = right, of a system that no permutation splits; with pivots where a pivot block is not sound."""
    quick, sound, last = solve(graph, matrix, list(right), sparse_pivots)
    safe = graph.apply("and", sound, last) if len(matrix) > 3 else sound
    return graph.guarded(quick, safe, matrix, list(right))


def solve(graph: Graph, a: Matrix, b: list[Expr], pivots: Pivots) -> tuple[list[Expr], Expr, Expr]:
    """x with a x = b by elimination in blocks of up to three, whether the pivot blocks were sound, and whether the last
    one was, by which nothing is eliminated."""
    n = len(a)
    if n <= 3:
        return elimination.solve(graph, a, [b])[0], graph.true, graph.true if n == 1 else _sound(graph, a)
    first = pivots(graph, a)
    k = len(first)
    order = [*first, *(i for i in range(n) if i not in first)]
    moved = [[a[i][j] for j in order] for i in order]
    values, sound, last = _eliminate(graph, moved, [b[i] for i in order], k, pivots)
    return [value for _, value in sorted(zip(order, values, strict=True), key=lambda pair: pair[0])], sound, last


def steady_pivots(changing: Changing, graph: Graph, a: Matrix) -> list[int]:
    """Unknowns to eliminate first: a block that never changes, such as a mass matrix, is inverted once in a run."""
    changing.mark(x for row in a for x in row)
    dependent = changing.nodes
    chosen: list[int] = []
    for i in range(len(a)):
        steady = all(a[x][y] not in dependent for j in (*chosen, i) for x, y in ((i, j), (j, i)))
        if steady and a[i][i] is not graph.zero and len(chosen) < 3:
            chosen.append(i)
    return chosen or list(range(2 if len(a) == 4 else 3))


def sparse_pivots(graph: Graph, a: Matrix) -> list[int]:
    """Unknowns to eliminate first: those with a pivot whose elimination couples the fewest others (minimum degree).

    Multipliers have no pivot before the unknowns that they couple are eliminated.
    """
    n, zero = range(len(a)), graph.zero
    near = [{j for j in n if a[i][j] is not zero or a[j][i] is not zero} - {i} for i in n]
    open_ = [i for i in n if a[i][i] is not zero]
    if not open_:
        return list(n[:3])
    chosen = [min(open_, key=lambda i: len(near[i]))]
    while len(chosen) < 3:
        reached = set().union(*(near[i] for i in chosen))
        further = [j for j in open_ if j in reached and j not in chosen]
        if not further:
            break
        chosen.append(min(further, key=lambda j: len(reached | near[j])))
    return sorted(chosen)


def _eliminate(graph: Graph, a: Matrix, b: list[Expr], k: int, pivots: Pivots) -> tuple[list[Expr], Expr, Expr]:
    """`solve` with the leading k×k block as pivot."""
    corner, right = [row[:k] for row in a[:k]], [row[k:] for row in a[:k]]
    inverse = elimination.inverse(graph, corner)
    # The Schur complement of the corner, and its right side.
    first = [dot(graph, row, b[:k]) for row in inverse]
    across = [[dot(graph, row, column) for column in zip(*right, strict=True)] for row in inverse]
    columns = {j: c for j, c in enumerate(zip(*across, strict=True)) if any(x is not graph.zero for x in c)}
    rest = [list(row[k:]) for row in a[k:]]
    for left, row in zip(rest, a[k:], strict=True):
        if any(x is not graph.zero for x in row[:k]):
            for j, column in columns.items():
                left[j] = graph.sub(left[j], dot(graph, row[:k], column))
    left = [graph.sub(b[k + i], dot(graph, row[:k], first)) for i, row in enumerate(a[k:])]
    tail, sound, last = solve(graph, rest, left, pivots)
    head = [graph.sub(x, dot(graph, row, tail)) for x, row in zip(first, across, strict=True)]
    return [*head, *tail], graph.apply("and", sound, _sound(graph, corner)), last


def _sound(graph: Graph, a: Matrix) -> Expr:
    """Whether the determinant keeps its digits; the test does not depend on how rows and columns are scaled."""
    signed = elimination.determinant(graph, a)
    sizes = [[graph.apply("abs", x) for x in row] for row in a]
    bound = _permanent(graph, sizes)
    return graph.apply("lt", graph.mul(graph.constant(CANCELLATION), bound), graph.apply("abs", signed))


def _permanent(graph: Graph, a: Matrix) -> Expr:
    if len(a) == 1:
        return a[0][0]
    minors = [_permanent(graph, [row[:j] + row[j + 1 :] for row in a[1:]]) for j in range(len(a))]
    return dot(graph, a[0], minors)
