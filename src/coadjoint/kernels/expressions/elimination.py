"""Small linear systems over expressions: closed forms up to 3×3, elimination with pivots chosen by value beyond.

Closed forms need one division and no branches; like the determinant they do not depend on the scaling of rows and
columns. Larger systems are split into their independent parts first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import Graph

Matrix = list[list[Expr]]

MAX_SIZE = 12
"""A larger coupled system, with pivoting written out, would be mostly selections: it is solved as Newton's are."""


def dot(graph: Graph, xs: Sequence[Expr], ys: Sequence[Expr]) -> Expr:
    """Σ x·y, left to right."""
    total = graph.zero
    for x, y in zip(xs, ys, strict=True):
        total = graph.add(total, graph.mul(x, y))
    return total


def cofactors(graph: Graph, a: Matrix) -> Matrix:
    """The adjugate of a matrix up to 3×3, transposed: a⁻¹ = cofactorsᵀ / det."""
    n = len(a)
    if n == 1:
        return [[graph.one]]
    if n == 2:
        return [[a[1][1], graph.neg(a[1][0])], [graph.neg(a[0][1]), a[0][0]]]

    def minor(i: int, j: int) -> Expr:
        (r, s), (c, d) = ((i + 1) % 3, (i + 2) % 3), ((j + 1) % 3, (j + 2) % 3)
        return graph.sub(graph.mul(a[r][c], a[s][d]), graph.mul(a[r][d], a[s][c]))

    return [[minor(i, j) for j in range(3)] for i in range(3)]


def inverse(graph: Graph, a: Matrix) -> Matrix:
    """The inverse of a matrix up to 3×3, with one division."""
    adjugate = cofactors(graph, a)
    over = graph.div(graph.one, dot(graph, a[0], adjugate[0]))
    n = range(len(a))
    return [[graph.mul(adjugate[j][i], over) for j in n] for i in n]


def _solve_closed(graph: Graph, a: Matrix, right: list[Expr]) -> list[Expr]:
    adjugate = cofactors(graph, a)
    over = graph.div(graph.one, dot(graph, a[0], adjugate[0]))
    n = range(len(a))
    return [graph.mul(dot(graph, [adjugate[j][i] for j in n], right), over) for i in n]


def _swap_up(graph: Graph, rows: Matrix, k: int, i: int) -> Expr:
    """Exchanges rows k and i where |rows[i][k]| is larger; returns the condition."""
    pivot, other = rows[k][k], rows[i][k]
    if other is graph.zero:
        return graph.false
    swap = graph.true
    if pivot is not graph.zero:
        swap = graph.apply("lt", graph.apply("abs", pivot), graph.apply("abs", other))
    pairs = list(zip(rows[k], rows[i], strict=True))
    rows[k] = [graph.select(swap, y, x) for x, y in pairs]
    rows[i] = [graph.select(swap, x, y) for x, y in pairs]
    return swap


def _eliminate(graph: Graph, rows: Matrix, n: int) -> Expr:
    """Upper triangular form of the first n columns with the largest pivots; returns the sign of the exchanges."""
    sign = graph.one
    for k in range(n):
        for i in range(k + 1, n):
            swap = _swap_up(graph, rows, k, i)
            sign = graph.select(swap, graph.neg(sign), sign)
        over = graph.div(graph.one, rows[k][k])
        for i in range(k + 1, n):
            if rows[i][k] is graph.zero:
                continue
            factor = graph.mul(rows[i][k], over)
            for j in range(k + 1, len(rows[i])):
                rows[i][j] = graph.sub(rows[i][j], graph.mul(factor, rows[k][j]))
            rows[i][k] = graph.zero
    return sign


def solve(graph: Graph, a: Matrix, right: Sequence[Sequence[Expr]]) -> list[list[Expr]]:
    """x with a x = b for every b of `right`; a singular system gives infinities or NaN, as division does."""
    if len(a) <= 3:
        return [_solve_closed(graph, a, list(b)) for b in right]
    n = len(a)
    rows = [[*row, *(b[i] for b in right)] for i, row in enumerate(a)]
    _eliminate(graph, rows, n)
    solutions = []
    for column in range(n, n + len(right)):
        x: list[Expr] = [graph.zero] * n
        for i in reversed(range(n)):
            known = dot(graph, rows[i][i + 1 : n], x[i + 1 :])
            x[i] = graph.div(graph.sub(rows[i][column], known), rows[i][i])
        solutions.append(x)
    return solutions


def determinant(graph: Graph, a: Matrix) -> Expr:
    """The determinant."""
    if len(a) <= 3:
        return dot(graph, a[0], cofactors(graph, a)[0])
    rows = [list(row) for row in a]
    result = _eliminate(graph, rows, len(a))
    for i in range(len(a)):
        result = graph.mul(result, rows[i][i])
    return result


def factors(graph: Graph, a: Matrix) -> tuple[Matrix, list[Expr], list[Expr]]:
    """L below the diagonal and U above it, the row taken as each pivot, and the order of the rows: a[order] = L U.

    As LAPACK does it: a column without a pivot is left unchanged.
    """
    n = len(a)
    rows, order, pivots = [list(row) for row in a], [graph.constant(float(i)) for i in range(n)], []
    for k in range(n):
        best, place = graph.apply("abs", rows[k][k]), graph.constant(float(k))
        for i in range(k + 1, n):
            size = graph.apply("abs", rows[i][k])
            larger = graph.apply("lt", best, size)
            best, place = graph.select(larger, size, best), graph.select(larger, graph.constant(float(i)), place)
        pivots.append(place)
        first, label = rows[k], order[k]
        for i in range(k + 1, n):
            here = graph.apply("eq", place, graph.constant(float(i)))
            rows[k] = [graph.select(here, y, x) for x, y in zip(rows[k], rows[i], strict=True)]
            rows[i] = [graph.select(here, x, y) for x, y in zip(first, rows[i], strict=True)]
            order[k], order[i] = graph.select(here, order[i], order[k]), graph.select(here, label, order[i])
        empty = graph.apply("eq", best, graph.zero)
        over = graph.select(empty, graph.zero, graph.div(graph.one, rows[k][k]))
        for i in range(k + 1, n):
            rows[i][k] = graph.mul(rows[i][k], over)
            for j in range(k + 1, n):
                rows[i][j] = graph.sub(rows[i][j], graph.mul(rows[i][k], rows[k][j]))
    return rows, pivots, order


def cholesky(graph: Graph, a: Matrix) -> Matrix:
    """The lower triangular L with L Lᵀ = a, from the lower triangle of a."""
    n = len(a)
    lower: Matrix = [[graph.zero] * n for _ in range(n)]
    for j in range(n):
        below = dot(graph, lower[j][:j], lower[j][:j])
        lower[j][j] = graph.apply("sqrt", graph.sub(a[j][j], below))
        over = graph.div(graph.one, lower[j][j])
        for i in range(j + 1, n):
            known = dot(graph, lower[i][:j], lower[j][:j])
            lower[i][j] = graph.mul(graph.sub(a[i][j], known), over)
    return lower


def triangular(graph: Graph, a: Matrix, b: list[Expr], lower: bool, unit: bool) -> list[Expr]:
    """x with a x = b for a triangular a."""
    n = len(a)
    x: list[Expr] = [graph.zero] * n
    for i in range(n) if lower else reversed(range(n)):
        done = range(i) if lower else range(i + 1, n)
        rest = graph.sub(b[i], dot(graph, [a[i][j] for j in done], [x[j] for j in done]))
        x[i] = rest if unit else graph.div(rest, a[i][i])
    return x


def parts(size: int, coupled: Callable[[int], Sequence[int]]) -> list[list[int]]:
    """Independent sets of unknowns, given which unknowns each row holds; row i belongs to unknown i."""
    label = list(range(size))

    def find(i: int) -> int:
        while label[i] != i:
            i = label[i]
        return i

    for i in range(size):
        for j in coupled(i):
            label[find(i)] = find(j)
    groups: dict[int, list[int]] = {}
    for i in range(size):
        groups.setdefault(find(i), []).append(i)
    return list(groups.values())
