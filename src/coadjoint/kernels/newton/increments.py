"""Newton's increment as expressions: J δ = −r, solved block by block in block triangular order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from coadjoint.kernels.expressions import block_elimination
from coadjoint.kernels.expressions.block_elimination import Changing, steady_pivots
from coadjoint.kernels.expressions.differentiation import forward
from coadjoint.kernels.expressions.elimination import Matrix, dot
from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.expressions.graph import Graph, substitute


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


@dataclass(frozen=True)
class Increment:
    """δ (n,) and the system J δ = −r (n, n), (n,) it solves; where `safe` fails, solve that with pivots.

    `last`: whether the pivots by which nothing is eliminated are sound. What δ loses by them further iterations make
    up for; where there are none, or where they converge slowly, δ needs pivots where it fails, too.
    """

    delta: list[Expr]
    safe: Expr
    last: Expr
    jacobian: Matrix
    right: list[Expr]

    def alone(self, graph: Graph) -> Increment:
        """The increment that no other follows."""
        return replace(self, safe=graph.apply("and", self.safe, self.last), last=graph.true)

    @property
    def always_safe(self) -> bool:
        """Whether the closed form needs no check."""
        return self.safe.op == "const" and self.safe.value is True


@dataclass(frozen=True)
class Scheme:
    """The arrangement of Newton's method for one stage.

    Rows that are affine in unknowns which only they determine are solved by one increment at the guess, `first`, if
    there are any; `settled` maps those unknowns to the symbols of their values. `start` is the guess, but 0 for an
    unknown of such a row that holds no other. The loop runs over the others, those in `looped`: `loop` is Newton's
    increment at the symbols z of the unknowns, J(z) δ = −r(z), and `chord` keeps its matrix at later iterates y, whose
    symbols are `iterate`: J(z) δ = −r(y). `multipliers`: see `scheme`.
    """

    first: Increment | None
    settled: dict[int, Expr]
    start: list[Expr]
    looped: list[int]
    loop: Increment | None = None
    chord: Increment | None = None
    iterate: list[Expr] = field(default_factory=list)
    multipliers: bool = False


def scheme(
    graph: Graph,
    unknowns: Sequence[Expr],
    guess: Sequence[Expr],
    residual: Sequence[Expr],
    state: Sequence[Expr],
    collect: Callable[[list[Expr]], list[Expr]] = list,
    multipliers: bool = False,
) -> Scheme:
    """Arrange Newton for residual(unknowns) = 0 from `guess`; expressions that depend on `state` change at every
    step.

    multipliers: whether there are unknowns that their own equations do not hold; these get pivots by elimination.
    """
    changing = {*unknowns, *state}
    rows = forward(graph, residual, unknowns)
    n = range(len(unknowns))
    order = list(n) if multipliers else matching([list(row) for row in rows])
    if order is not None:
        residual, rows = [residual[i] for i in order], [rows[i] for i in order]
    parts = blocks([list(row) for row in rows]) if order is not None else [list(n)]
    affine = _affine(parts, rows, unknowns)
    # A division keeps all digits from anywhere; what elimination loses is part of an increment, small near the guess.
    single = {part[0] for part in parts if len(part) == 1 and part[0] in affine}
    start = [graph.zero if i in single else guess[i] for i in n]

    def increment(chosen: list[int], matrix: Mapping[Expr, Expr], right: Mapping[Expr, Expr]) -> Increment:
        """δ of the chosen unknowns, with the symbols in J and in r replaced."""
        place = {i: position for position, i in enumerate(chosen)}
        entries = collect(substitute(graph, [rows[i].get(j, graph.zero) for i in chosen for j in chosen], matrix))
        values = collect(substitute(graph, [residual[i] for i in chosen], right))
        k = len(chosen)
        jacobian = [entries[i * k : i * k + k] for i in range(k)]
        inside = [[place[i] for i in part] for part in parts if part[0] in place]
        return _increment(graph, inside, jacobian, values, changing, multipliers)

    settled: dict[int, Expr] = {}
    first = None
    if affine:
        at_guess = dict(zip(unknowns, start, strict=True))
        first = increment(sorted(affine), at_guess, at_guess).alone(graph)
        settled = {i: graph.symbol(f"{unknowns[i].value}'") for i in sorted(affine)}
        changing.update(settled.values())
    looped = [i for i in n if i not in settled]
    if not looped:
        return Scheme(first, settled, start, looped, multipliers=multipliers)
    known = {unknowns[i]: value for i, value in settled.items()}
    iterate = [graph.symbol(f"{unknowns[i].value}~") for i in looped]
    changing.update(iterate)
    later = {**known, **{unknowns[i]: symbol for i, symbol in zip(looped, iterate, strict=True)}}
    loop, chord = increment(looped, known, known), increment(looped, known, later)
    return Scheme(first, settled, start, looped, loop, chord, iterate, multipliers)


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


def linear_solve(
    graph: Graph, matrix: Matrix, right: Sequence[Expr], changing: set[Expr], multipliers: bool
) -> Increment:
    """δ with matrix δ = −right, in the order that its zeros allow; multipliers: as in `scheme`."""
    rows = [[j for j, x in enumerate(row) if x is not graph.zero] for row in matrix]
    order = list(range(len(right))) if multipliers else matching(rows)
    if order is None:
        return _increment(graph, [list(range(len(right)))], matrix, right, changing, multipliers)
    parts = blocks([rows[i] for i in order])
    return _increment(graph, parts, [matrix[i] for i in order], [right[i] for i in order], changing, multipliers)


def _increment(
    graph: Graph, parts: list[list[int]], jacobian: Matrix, residual: Sequence[Expr], changing: set[Expr], sparse: bool
) -> Increment:
    pivots = block_elimination.sparse_pivots if sparse else partial(steady_pivots, Changing(changing))
    delta: list[Expr] = [graph.zero] * len(residual)
    right = [graph.neg(r) for r in residual]
    safe = last = graph.true
    solved: list[int] = []
    for part in parts:
        b = [graph.sub(right[i], _known(graph, jacobian[i], delta, solved)) for i in part]
        matrix = [[jacobian[i][j] for j in part] for i in part]
        values, sound, end = block_elimination.solve(graph, matrix, b, pivots)
        safe, last = graph.apply("and", safe, sound), graph.apply("and", last, end)
        for i, value in zip(part, values, strict=True):
            delta[i] = value
        solved += part
    return Increment(delta, safe, last, jacobian, right)


def _known(graph: Graph, row: list[Expr], delta: list[Expr], solved: list[int]) -> Expr:
    """The contribution of the eliminated unknowns to a row."""
    there = [j for j in solved if row[j] is not graph.zero]
    return dot(graph, [row[j] for j in there], [delta[j] for j in there])
