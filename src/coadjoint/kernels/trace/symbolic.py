"""The primitives on arrays of expressions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import reduce
from typing import Any, TypeAlias

import numpy as np

from coadjoint.kernels.expressions import elimination
from coadjoint.kernels.expressions.block_elimination import guarded_solve
from coadjoint.kernels.expressions.differentiation import forward
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.expressions.operations import BINARY, UNARY
from coadjoint.kernels.trace.indexing import indexing_rules
from coadjoint.kernels.trace.interpreter import Array, Rule, symbolic
from coadjoint.kernels.trace.jaxprs import EquationParameters
from coadjoint.kernels.trace.movement import MOVEMENT, scatters
from coadjoint.kernels.trace.numeric import matricize, round_name
from coadjoint.kernels.untraceable import Untraceable


def lift(graph: Graph, array: Array) -> Array:
    """Numbers as an array of constant expressions; expressions unchanged."""
    if symbolic(array):
        return array
    return np.asarray(each(graph.constant, array))


def each(function: Callable[..., Expr], *arrays: Any) -> Any:
    """`function` of every element; arrays of one element may come back bare."""
    return np.frompyfunc(function, len(arrays), 1)(*arrays)


def nodes(items: Iterable[Expr], shape: tuple[int, ...]) -> Array:
    """An array of expressions from their list."""
    items = list(items)
    out = np.empty(len(items), object)
    out[:] = items
    return out.reshape(shape)


def expression_rules(graph: Graph) -> dict[str, Rule]:
    """The rules that build expressions in `graph`."""

    def elementwise(function: Callable[..., Expr], count: int) -> Rule:
        over_arrays = np.frompyfunc(function, count, 1)
        return lambda p, *xs: over_arrays(*(lift(graph, x) for x in xs))

    def named(name: str) -> Callable[..., Expr]:
        return lambda *args: graph.apply(name, *args)

    unary = {name: elementwise(named(name), 1) for name in UNARY}
    binary = {name: elementwise(named(name), 2) for name in BINARY}
    return {
        **{name: _lifted(graph, rule, name in _JOINED) for name, rule in MOVEMENT.items()},
        **{name: _lifted(graph, rule) for name, rule in scatters(*map(named, _COMBINE)).items()},
        **indexing_rules(graph, lambda x: lift(graph, x)),
        **unary,
        **binary,
        **_derived(graph, elementwise),
        **_reductions(graph),
        **_linear(graph),
        "loop": lambda loop, start: graph.loop(loop, start),
        "lift": lambda p, x: lift(graph, x),
        "symbol": lambda p, name: graph.symbol(name),
    }


_COMBINE = ("add", "sub", "mul", "min", "max")
_JOINED = ("concatenate", "pad", "stack")


def _lifted(graph: Graph, rule: Rule, every: bool = False) -> Rule:
    """Data movement places expressions only; its indices stay numbers."""

    def lifted(p: EquationParameters, *xs: Array) -> Any:
        return rule(p, *(lift(graph, x) if every or x.dtype.kind == "f" else x for x in xs))

    return lifted


def _derived(graph: Graph, elementwise: Callable[[Callable[..., Expr], int], Rule]) -> dict[str, Rule]:
    def clamp(low: Expr, x: Expr, high: Expr) -> Expr:
        return graph.apply("min", graph.apply("max", x, low), high)

    def logistic(x: Expr) -> Expr:
        return graph.div(graph.one, graph.add(graph.one, graph.apply("exp", graph.neg(x))))

    def convert(p: EquationParameters, x: Array) -> Array:
        kind = np.dtype(p["new_dtype"])
        if kind.kind == "c" or (kind.kind == "f" and kind.itemsize < 8):
            raise Untraceable("convert_element_type", f"to {kind.name}")
        return np.asarray(each(lambda n: _converted(graph, n, kind.kind), x))

    def polynomial(p: EquationParameters, x: Array, *coefficients: Array) -> Array:
        """a₀ + x (a₁ + x (a₂ + …))."""
        horner = elementwise(lambda y, x, a: graph.add(graph.mul(y, x), a), 3)
        value = reduce(lambda y, a: np.asarray(horner(p, y, x, a)), coefficients[::-1])
        return np.broadcast_arrays(value, x)[0]

    def select(p: EquationParameters, which: Array, *cases: Array) -> Array:
        if len(cases) == 2:
            return elementwise(lambda c, no, yes: graph.select(_truth(graph, c), yes, no), 3)(p, which, *cases)
        chosen = lift(graph, cases[-1])
        for i, case in reversed(list(enumerate(cases[:-1]))):
            here = each(lambda w, i=i: graph.apply("le", w, graph.constant(float(i))), lift(graph, which))
            chosen = np.asarray(each(graph.select, here, lift(graph, case), chosen))
        return chosen

    return {
        "add_any": elementwise(graph.add, 2),
        "clamp": elementwise(clamp, 3),
        "convert_element_type": convert,
        "div": elementwise(graph.div, 2),
        "one_minus_square": elementwise(lambda x: graph.mul(graph.sub(graph.one, x), graph.add(graph.one, x)), 1),
        "polynomial": polynomial,
        "integer_pow": lambda p, x: each(lambda n: graph.power(n, p["y"]), x),
        "div_whole": elementwise(lambda a, b: graph.apply("truncate", graph.div(a, b)), 2),
        "eq_to": elementwise(lambda a, b: graph.apply("eq", a, b), 2),
        "le_to": elementwise(lambda a, b: graph.apply("le", a, b), 2),
        "lt_to": elementwise(lambda a, b: graph.apply("lt", a, b), 2),
        "logistic": elementwise(logistic, 1),
        "round": lambda p, x: each(lambda n: graph.apply(round_name(p), n), x),
        "rsqrt": elementwise(lambda x: graph.div(graph.one, graph.apply("sqrt", x)), 1),
        "select_n": select,
        "sloped": elementwise(graph.sloped, 2),
        "square": elementwise(lambda x: graph.mul(x, x), 1),
    }


def _truth(graph: Graph, node: Expr) -> Expr:
    """A condition from a truth value or from a number that is zero or not."""
    return node if node.is_truth else graph.apply("ne", node, graph.zero)


def _converted(graph: Graph, node: Expr, kind: str) -> Expr:
    """Integers that depend on values are float64 numbers with integer values here."""
    if kind == "b":
        return _truth(graph, node)
    if node.is_truth:
        return graph.select(node, graph.one, graph.zero)
    return graph.apply("truncate", node) if kind in "iu" and node.op != "truncate" else node


Fold: TypeAlias = Callable[[Callable[[Expr, Expr], Expr], Iterable[Expr]], Expr]


def _by_pairs(function: Callable[[Expr, Expr], Expr], row: Iterable[Expr]) -> Expr:
    """As `reduce` of an associative function; a value waits for log₂ of their number of others, not for all before."""
    row = list(row)
    while len(row) > 1:
        row = [*map(function, row[::2], row[1::2]), *row[len(row) // 2 * 2 :]]
    return row[0]


def _reductions(graph: Graph) -> dict[str, Rule]:
    def along(axes: tuple[int, ...], x: Array) -> tuple[Array, tuple[int, ...]]:
        kept = [axis for axis in range(x.ndim) if axis not in axes]
        shape = tuple(x.shape[axis] for axis in kept)
        count = math.prod(x.shape[axis] for axis in axes)
        return x.transpose([*kept, *axes]).reshape(math.prod(shape), count), shape

    def reduction(function: Callable[[Expr, Expr], Expr], start: Expr, fold: Fold = reduce) -> Rule:
        def rule(p: EquationParameters, x: Array) -> Array:
            rows, shape = along(tuple(p["axes"]), x)
            return nodes((fold(function, row) if row.size else start for row in rows), shape)

        return rule

    def arg(op: str) -> Rule:
        def rule(p: EquationParameters, x: Array) -> Array:
            rows, shape = along(tuple(p["axes"]), x)
            return nodes((_arg(graph, op, list(row)) for row in rows), shape)

        return rule

    def cumulative(function: Callable[[Expr, Expr], Expr]) -> Rule:
        def rule(p: EquationParameters, x: Array) -> Array:
            line = np.moveaxis(x, p["axis"], 0).copy()
            order = range(len(line) - 2, -1, -1) if p["reverse"] else range(1, len(line))
            for i in order:
                before = line[i + 1] if p["reverse"] else line[i - 1]
                line[i] = each(function, before, line[i])
            return np.moveaxis(line, 0, p["axis"])

        return rule

    def named(name: str) -> Callable[[Expr, Expr], Expr]:
        return lambda a, b: graph.apply(name, a, b)

    return {
        "argmax": arg("lt"),
        "argmin": arg("gt"),
        "cummax": cumulative(named("max")),
        "cummin": cumulative(named("min")),
        "cumprod": cumulative(graph.mul),
        "cumsum": cumulative(graph.add),
        "reduce_and": reduction(named("and"), graph.true),
        "reduce_max": reduction(named("max"), graph.constant(-math.inf), _by_pairs),
        "reduce_min": reduction(named("min"), graph.constant(math.inf), _by_pairs),
        "reduce_or": reduction(named("or"), graph.false),
        "reduce_prod": reduction(graph.mul, graph.one),
        "reduce_sum": reduction(graph.add, graph.zero),
    }


def _arg(graph: Graph, op: str, row: list[Expr]) -> Expr:
    """The index of the first extreme element, as a number."""
    best, index = row[0], graph.zero
    for i, x in enumerate(row[1:], start=1):
        better = graph.apply(op, best, x)
        best, index = graph.select(better, x, best), graph.select(better, graph.constant(float(i)), index)
    return index


def _linear(graph: Graph) -> dict[str, Rule]:
    def product(p: EquationParameters, x: Array, y: Array) -> Array:
        left, right, shape = matricize(p, lift(graph, x), lift(graph, y))
        stacks = zip(left, right, strict=True)
        return nodes((elimination.dot(graph, r, c) for a, b in stacks for r in a for c in b.T), shape)

    def solve(operator: Callable[[list[Array]], list[Array]], right: list[Array]) -> list[Array]:
        return _solve_operator(graph, operator, right)

    def stacked(function: Callable[[list[list[Expr]]], Any], rank: int) -> Rule:
        def rule(p: EquationParameters, a: Array) -> Array:
            matrices = a.reshape(-1, *a.shape[-2:])
            flat = [x for matrix in matrices for x in np.ravel(np.asarray(function(matrix.tolist()), object))]
            return nodes(flat, a.shape[: a.ndim - 2 + rank])

        return rule

    return {
        "cholesky": stacked(lambda a: elimination.cholesky(graph, a), 2),
        "custom_linear_solve": solve,
        "det": stacked(lambda a: elimination.determinant(graph, a), 0),
        "dot_general": product,
        "lu": lambda p, a: _factors(graph, a),
        "triangular_solve": lambda p, a, b: _triangular(graph, p, lift(graph, a), lift(graph, b)),
    }


def _factors(graph: Graph, a: Array) -> list[Array]:
    """Factors up to 3×3, for the derivative of a determinant; placeholders beyond.

    JAX passes them to a linear solve, which our own elimination replaces; the emitter raises for any other use of
    placeholders, because it has no code for `lu`.
    """
    if a.shape[-2] == a.shape[-1] <= 3:
        found = [elimination.factors(graph, matrix.tolist()) for matrix in a.reshape(-1, *a.shape[-2:])]
        shapes = a.shape, a.shape[:-1], a.shape[:-1]
        return [nodes(np.ravel(np.array(x, object)), s) for x, s in zip(zip(*found, strict=True), shapes, strict=True)]
    factors = np.asarray(each(lambda _: graph.placeholder("lu"), a))
    return [factors, factors[..., 0], factors[..., 0]]


def _triangular(graph: Graph, p: EquationParameters, a: Array, b: Array) -> Array:
    if a.ndim > 2:
        return np.stack([_triangular(graph, p, x, y) for x, y in zip(a, b, strict=True)])
    transposed = p["transpose_a"] == p["left_side"]
    matrix = (a.T if transposed else a).tolist()
    right = b if p["left_side"] else b.T
    lower = p["lower"] != transposed
    columns = [elimination.triangular(graph, matrix, list(c), lower, p["unit_diagonal"]) for c in right.T]
    solution = nodes((x for column in columns for x in column), right.T.shape).T
    return solution if p["left_side"] else solution.T


def _solve_operator(graph: Graph, operator: Callable[[list[Array]], list[Array]], right: list[Array]) -> list[Array]:
    """x with operator(x) = right for a linear operator: its matrix is its derivative."""
    right = [lift(graph, b) for b in right]
    flat = [node for b in right for node in b.reshape(-1)]
    unknowns = [graph.unknown() for _ in flat]
    placed, start = [], 0
    for b in right:
        placed.append(nodes(unknowns[start : start + b.size], b.shape))
        start += b.size
    images = [node for image in operator(placed) for node in lift(graph, image).reshape(-1)]
    rows = forward(graph, images, unknowns)
    groups = elimination.parts(len(flat), lambda i: list(rows[i]))
    solution: list[Expr] = [graph.zero] * len(flat)
    by_matrix: dict[tuple, list[list[int]]] = {}
    for group in groups:
        key = tuple(rows[i].get(j, graph.zero) for i in group for j in group)
        by_matrix.setdefault(key, []).append(group)
    for key, alike in by_matrix.items():
        n = len(alike[0])
        matrix = [list(key[i * n : (i + 1) * n]) for i in range(n)]
        given = [[flat[i] for i in group] for group in alike]
        if n <= elimination.MAX_SIZE:
            answers = elimination.solve(graph, matrix, given)
        else:
            answers = [guarded_solve(graph, matrix, right) for right in given]
        for group, answer in zip(alike, answers, strict=True):
            for i, x in zip(group, answer, strict=True):
                solution[i] = x
    out, start = [], 0
    for b in right:
        out.append(nodes(solution[start : start + b.size], b.shape))
        start += b.size
    return out
