"""Newton's increment as expressions: J δ = −r, solved block by block in block triangular order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from coadjoint.kernels.expressions import elimination
from coadjoint.kernels.expressions.differentiation import forward
from coadjoint.kernels.expressions.elimination import Matrix, dot
from coadjoint.kernels.expressions.expression import Expr, Graph, reachable, substitute


def matching(columns: Sequence[Sequence[int]]) -> list[int] | None:
    """A row for every unknown that holds it, or None; `columns[i]` are the unknowns of row i."""
    row_of: dict[int, int] = {}

    def place(row: int, tried: set[int]) -> bool:
        # The diagonal first: it is the natural pivot of a discrete Legendre transform.
        for j in sorted(columns[row], key=lambda j: j != row):
            if j in tried:
                continue
            tried.add(j)
            if j not in row_of or place(row_of[j], tried):
                row_of[j] = row
                return True
        return False

    if not all(place(row, set()) for row in range(len(columns))):
        return None
    return [row_of[j] for j in range(len(columns))]


def blocks(columns: Sequence[Sequence[int]]) -> list[list[int]]:
    """Strongly coupled sets of unknowns, those first that the later ones need (Tarjan).

    `columns[i]` are the unknowns in the row of unknown i.
    """
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    stack: list[int] = []
    found: list[list[int]] = []

    def visit(i: int) -> None:
        index[i] = low[i] = len(index)
        stack.append(i)
        for j in columns[i]:
            if j not in index:
                visit(j)
                low[i] = min(low[i], low[j])
            elif j in stack:
                low[i] = min(low[i], index[j])
        if low[i] == index[i]:
            start = stack.index(i)
            found.append(sorted(stack[start:]))
            del stack[start:]

    for i in range(len(columns)):
        if i not in index:
            visit(i)
    return found


CANCELLATION = 1e-4
"""A pivot block whose determinant loses more digits than this is not used: pivoted elimination takes over."""


@dataclass(frozen=True)
class Increment:
    """δ (n,) and the system J δ = −r (n, n), (n,) it solves; where `safe` fails, solve that with pivots."""

    delta: list[Expr]
    safe: Expr
    jacobian: Matrix
    right: list[Expr]

    @property
    def always_safe(self) -> bool:
        """Whether the closed form needs no check."""
        return self.safe.op == "const" and self.safe.value is True


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


@dataclass(frozen=True)
class Scheme:
    """The arrangement of Newton's method for one stage.

    Rows that are affine in unknowns which only they determine are solved by one increment at the guess, `first`, if
    there are any; `settled` maps those unknowns to the symbols of their values. The loop runs over the others, those
    in `looped`: `loop` is Newton's increment at the symbols z of the unknowns, J(z) δ = −r(z), and `chord` keeps its
    matrix at later iterates y, whose symbols are `iterate`: J(z) δ = −r(y).
    """

    first: Increment | None
    settled: dict[int, Expr]
    looped: list[int]
    loop: Increment | None = None
    chord: Increment | None = None
    iterate: list[Expr] = field(default_factory=list)


def scheme(
    graph: Graph,
    unknowns: Sequence[Expr],
    guess: Sequence[Expr],
    residual: Sequence[Expr],
    state: Sequence[Expr],
    collect: Callable[[list[Expr]], list[Expr]] = list,
) -> Scheme:
    """Arrange Newton for residual(unknowns) = 0 from `guess`; expressions that depend on `state` change at every
    step."""
    changing = {*unknowns, *state}
    rows = forward(graph, residual, unknowns)
    order = matching([list(row) for row in rows])
    if order is not None:
        residual, rows = [residual[i] for i in order], [rows[i] for i in order]
    n = range(len(unknowns))
    parts = blocks([list(row) for row in rows]) if order is not None else [list(n)]
    affine = _affine(parts, rows, unknowns)

    def increment(chosen: list[int], matrix: Mapping[Expr, Expr], right: Mapping[Expr, Expr]) -> Increment:
        """δ of the chosen unknowns, with the symbols in J and in r replaced."""
        place = {i: position for position, i in enumerate(chosen)}
        entries = collect(substitute(graph, [rows[i].get(j, graph.zero) for i in chosen for j in chosen], matrix))
        values = collect(substitute(graph, [residual[i] for i in chosen], right))
        k = len(chosen)
        jacobian = [entries[i * k : i * k + k] for i in range(k)]
        inside = [[place[i] for i in part] for part in parts if part[0] in place]
        return _increment(graph, inside, jacobian, values, changing)

    settled: dict[int, Expr] = {}
    first = None
    if affine:
        at_guess = dict(zip(unknowns, guess, strict=True))
        first = increment(sorted(affine), at_guess, at_guess)
        settled = {i: graph.symbol(f"{unknowns[i].value}'") for i in sorted(affine)}
        changing.update(settled.values())
    looped = [i for i in n if i not in settled]
    if not looped:
        return Scheme(first, settled, looped)
    known = {unknowns[i]: value for i, value in settled.items()}
    iterate = [graph.symbol(f"{unknowns[i].value}~") for i in looped]
    changing.update(iterate)
    later = {**known, **{unknowns[i]: symbol for i, symbol in zip(looped, iterate, strict=True)}}
    return Scheme(first, settled, looped, increment(looped, known, known), increment(looped, known, later), iterate)


def _affine(parts: list[list[int]], rows: list[dict[int, Expr]], unknowns: Sequence[Expr]) -> set[int]:
    """Unknowns whose rows have constant derivatives and hold only such unknowns."""
    variable = set(unknowns)
    found: set[int] = set()
    for part in parts:
        entries = [d for i in part for d in rows[i].values()]
        alone = all(j in found or j in part for i in part for j in rows[i])
        if alone and not any(node in variable for node in reachable(entries)):
            found.update(part)
    return found


def linear_solve(graph: Graph, matrix: Matrix, right: Sequence[Expr], changing: set[Expr]) -> Increment:
    """δ with matrix δ = −right, in the order that its zeros allow."""
    rows = [[j for j, x in enumerate(row) if x is not graph.zero] for row in matrix]
    order = matching(rows)
    if order is None:
        return _increment(graph, [list(range(len(right)))], matrix, right, changing)
    parts = blocks([rows[i] for i in order])
    return _increment(graph, parts, [matrix[i] for i in order], [right[i] for i in order], changing)


def _increment(
    graph: Graph, parts: list[list[int]], jacobian: Matrix, residual: Sequence[Expr], changing: set[Expr]
) -> Increment:
    marked = Changing(changing)
    delta: list[Expr] = [graph.zero] * len(residual)
    right = [graph.neg(r) for r in residual]
    safe = graph.true
    solved: list[int] = []
    for part in parts:
        b = [graph.sub(right[i], _known(graph, jacobian[i], delta, solved)) for i in part]
        values, sound = _solve(graph, [[jacobian[i][j] for j in part] for i in part], b, marked)
        safe = graph.apply("and", safe, sound)
        for i, value in zip(part, values, strict=True):
            delta[i] = value
        solved += part
    return Increment(delta, safe, jacobian, right)


def _known(graph: Graph, row: list[Expr], delta: list[Expr], solved: list[int]) -> Expr:
    """The contribution of the eliminated unknowns to a row."""
    there = [j for j in solved if row[j] is not graph.zero]
    return dot(graph, [row[j] for j in there], [delta[j] for j in there])


def _solve(graph: Graph, a: Matrix, b: list[Expr], changing: Changing) -> tuple[list[Expr], Expr]:
    """x with a x = b by elimination in blocks of up to three, and whether the pivot blocks were sound."""
    n = len(a)
    if n <= 3:
        return elimination.solve(graph, a, [b])[0], graph.true
    first = _pivots(graph, a, changing)
    k = len(first)
    order = [*first, *(i for i in range(n) if i not in first)]
    moved = [[a[i][j] for j in order] for i in order]
    values, sound = _eliminate(graph, moved, [b[i] for i in order], k, changing)
    return [value for _, value in sorted(zip(order, values, strict=True), key=lambda pair: pair[0])], sound


def _pivots(graph: Graph, a: Matrix, changing: Changing) -> list[int]:
    """Unknowns to eliminate first: a block that never changes, such as a mass matrix, is inverted once in a run."""
    changing.mark(x for row in a for x in row)
    dependent = changing.nodes
    chosen: list[int] = []
    for i in range(len(a)):
        steady = all(a[x][y] not in dependent for j in (*chosen, i) for x, y in ((i, j), (j, i)))
        if steady and a[i][i] is not graph.zero and len(chosen) < 3:
            chosen.append(i)
    return chosen or list(range(2 if len(a) == 4 else 3))


def _eliminate(graph: Graph, a: Matrix, b: list[Expr], k: int, changing: Changing) -> tuple[list[Expr], Expr]:
    """Solve with the leading k×k block as pivot."""
    n = len(a)
    corner, right = [row[:k] for row in a[:k]], [row[k:] for row in a[:k]]
    inverse = elimination.inverse(graph, corner)
    # The Schur complement of the corner, and its right side.
    first = [dot(graph, row, b[:k]) for row in inverse]
    across = [[dot(graph, row, column) for column in zip(*right, strict=True)] for row in inverse]
    columns = list(zip(*across, strict=True))
    rest = [
        row[k:]
        if all(x is graph.zero for x in row[:k])
        else [graph.sub(row[k + j], dot(graph, row[:k], columns[j])) for j in range(n - k)]
        for row in a[k:]
    ]
    left = [graph.sub(b[k + i], dot(graph, row[:k], first)) for i, row in enumerate(a[k:])]
    tail, sound = _solve(graph, rest, left, changing)
    head = [graph.sub(x, dot(graph, row, tail)) for x, row in zip(first, across, strict=True)]
    return [*head, *tail], graph.apply("and", sound, _sound(graph, corner))


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
