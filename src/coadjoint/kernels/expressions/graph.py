"""The graph of a program's expressions, shared and simplified as they are built.

Equal expressions are one node. Constants fold in float64; beyond that only rewritings that are exact for finite
values are made: x + 0, x·1, −(−x), a + (−b) = a − b, (−a)·b = −(a·b), … Among them 0·x → 0 and x − x → 0: a zero
that is known at tracing time is structure (a missing coupling, a zero entry of a matrix), and an expression that
overflows elsewhere must not bring it to life. Signs of zeros are not kept.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Mapping
from functools import partialmethod

import numpy as np

from coadjoint.kernels.expressions.expression import Expr, Loop, Value, reachable
from coadjoint.kernels.expressions.operations import BINARY, UNARY, Table
from coadjoint.kernels.untraceable import TooLarge

MAX_NODES = 125_000
"""A larger program would compile for minutes; it goes to XLA instead."""

MAX_NODES_OF_MULTIPLIERS = 200_000
"""The same for programs with multipliers of constraints, whose matrices are sparse."""


class Graph:
    """All expressions of one program; the methods build nodes, up to `limit` besides those of rewritings."""

    def __init__(self, limit: int = MAX_NODES) -> None:
        self.limit = limit
        self._table: dict[tuple, Expr] = {}
        self._count: float = 0  # of nodes, less those that rewritings made
        self.zero, self.one = self.constant(0.0), self.constant(1.0)
        self.true, self.false = self.constant(True), self.constant(False)

    def _node(self, op: str, args: tuple[Expr, ...] = (), value: Value = None) -> Expr:
        key = (op, value, type(value), *args)
        node = self._table.get(key)
        if node is None:
            if self._count > self.limit:
                raise TooLarge(self.limit)
            node = self._table[key] = Expr(op, args, value, len(self._table))
            self._count += 1
        return node

    @contextlib.contextmanager
    def rewriting(self) -> Iterator[None]:
        """Nodes made inside replace nodes that have been counted, and do not count themselves."""
        count, self._count = self._count, -math.inf
        try:
            yield
        finally:
            self._count = count

    def constant(self, value: float | bool) -> Expr:
        """A number or a truth value."""
        if isinstance(value, (bool, np.bool_)):
            return self._node("const", (), bool(value))
        number = float(value)
        return self._node("const", (), math.nan if number != number else number + 0.0)

    def symbol(self, name: str) -> Expr:
        """An unknown, by its name."""
        return self._node("symbol", (), name)

    def unknown(self) -> Expr:
        """A new symbol."""
        return self._node("symbol", (), f"unknown {len(self._table)}")

    def placeholder(self, primitive: str) -> Expr:
        """Stands for a result of `primitive` that has no expression; using its value is an error."""
        return self._node("placeholder", (), primitive)

    def entry(self, table: Table, place: Expr) -> Expr:
        """The number of a table at an integer index that is inside it."""
        if place.op == "const":
            return self.constant(table.numbers[int(place.value)])  # pyright: ignore[reportArgumentType]
        return self._node("entry", (place,), table)

    def guarded(self, quick: list[Expr], safe: Expr, matrix: list[list[Expr]], right: list[Expr]) -> list[Expr]:
        """x with matrix x = right: `quick` where `safe` holds, elsewhere by elimination with pivots."""
        if safe is self.true:
            return quick
        entries = [x for row in matrix for x in row]
        places = tuple(i for i, x in enumerate(entries) if x is not self.zero)
        pivoted = self._node("pivoted", (safe, *(entries[i] for i in places), *right), places)
        return [self._solution(i, x, safe, pivoted) for i, x in enumerate(quick)]

    def _solution(self, place: Value, quick: Expr, safe: Expr, pivoted: Expr) -> Expr:
        return quick if safe is self.true else self._node("solution", (quick, safe, pivoted), place)

    def loop(self, loop: Loop, start: Iterable[Expr]) -> list[Expr]:
        """The carried values where `test` first fails, beginning with `start`; they have no derivatives."""
        run = self._node("loop", tuple(start), loop)
        return [self._node("outcome", (run,), (i,)) for i in range(len(loop.carried))]

    def sloped(self, value: Expr, slope: Expr) -> Expr:
        """`value`, with the derivatives of `slope`."""
        return value if value is slope or value.op == "const" == slope.op else self._node("sloped", (value, slope))

    def again(self, node: Expr, args: Iterable[Expr]) -> Expr:
        """The operation of a node on other arguments."""
        if node.op == "solution":
            return self._solution(node.value, *args)
        if node.op == "sloped":
            return self.sloped(*args)
        if node.op in ("pivoted", "loop", "outcome"):
            return self._node(node.op, tuple(args), node.value)
        return self.entry(node.value, *args) if isinstance(node.value, Table) else self.apply(node.op, *args)

    def apply(self, op: str, *args: Expr) -> Expr:
        """The operation `op` of operations.UNARY and operations.BINARY, "div" or "select", simplified."""
        special = getattr(self, f"_{op}", None)
        if special is not None:
            return special(*args)
        if all(a.op == "const" for a in args):
            return self._fold(op, *args)
        return self._node(op, args)

    def _fold(self, op: str, *args: Expr) -> Expr:
        function = (UNARY if len(args) == 1 else BINARY)[op]
        with np.errstate(all="ignore"):
            return self.constant(function(*(a.value for a in args)))

    def neg(self, a: Expr) -> Expr:
        if a.op == "const":
            return self.constant(-a.value)  # pyright: ignore[reportOperatorIssue, reportOptionalOperand]
        if a.op == "neg":
            return a.args[0]
        if a.op == "sub":
            return self._node("sub", (a.args[1], a.args[0]))
        return self._node("neg", (a,))

    def add(self, a: Expr, b: Expr) -> Expr:
        if a.op == "const" and b.op == "const":
            return self._fold("add", a, b)
        if a.is_constant(0.0):
            return b
        if b.is_constant(0.0):
            return a
        if b.op == "neg":
            return self.sub(a, b.args[0])
        if a.op == "neg":
            return self.sub(b, a.args[0])
        return self._node("add", (a, b) if a.number < b.number else (b, a))

    def sub(self, a: Expr, b: Expr) -> Expr:
        if a.op == "const" and b.op == "const":
            return self._fold("sub", a, b)
        if b.is_constant(0.0):
            return a
        if a.is_constant(0.0):
            return self.neg(b)
        if a is b:
            return self.zero
        if b.op == "neg":
            return self.add(a, b.args[0])
        if a.op == "neg":
            return self.neg(self.add(a.args[0], b))
        return self._node("sub", (a, b))

    def mul(self, a: Expr, b: Expr) -> Expr:
        if a.op == "const" and b.op == "const":
            return self._fold("mul", a, b)
        if a.op == "const":
            a, b = b, a
        if b.op == "const":
            if b.value == 0.0:
                return self.zero
            if b.value == 1.0:
                return a
            if b.value == -1.0:
                return self.neg(a)
        if a.op == "neg":
            return self.neg(self.mul(a.args[0], b))
        if b.op == "neg":
            return self.neg(self.mul(a, b.args[0]))
        return self._node("mul", (a, b) if a.number < b.number else (b, a))

    def div(self, a: Expr, b: Expr) -> Expr:
        """a/b; by a variable it is a·(1/b), so that a shared or constant denominator is divided by once."""
        if b.op == "const" and b.value != 0.0:
            value = float(b.value)  # pyright: ignore[reportArgumentType]
            if a.op == "const":
                return self.constant(float(a.value) / value)  # pyright: ignore[reportArgumentType]
            if abs(math.frexp(value)[0]) == 0.5 and abs(value) > 1e-300:
                return self.mul(a, self.constant(1.0 / value))
            return self._node("div", (a, b))
        if b.op == "const":
            # Infinite, so that a structurally singular matrix gives NaN and not zero.
            return self.mul(a, self.constant(math.copysign(math.inf, float(b.value))))  # pyright: ignore
        if a.is_constant(0.0) and b.op != "const":
            return self.zero
        if b.op == "neg":
            return self.neg(self.div(a, b.args[0]))
        return self.mul(a, self._node("div", (self.one, b)))

    def select(self, condition: Expr, yes: Expr, no: Expr) -> Expr:
        """`yes` where the condition holds, else `no`."""
        if condition.op == "const":
            return yes if condition.value else no
        if yes is no:
            return yes
        if condition.op == "not":
            return self.select(condition.args[0], no, yes)
        if yes is self.true and no is self.false:
            return condition
        if yes is self.false and no is self.true:
            return self.apply("not", condition)
        return self._node("select", (condition, yes, no))

    _neg, _add, _sub, _mul, _div, _select = neg, add, sub, mul, div, select

    def power(self, a: Expr, exponent: int) -> Expr:
        """a to an integer power, by repeated squaring."""
        if exponent < 0:
            return self.div(self.one, self.power(a, -exponent))
        result, square = self.one, a
        while exponent:
            if exponent & 1:
                result = self.mul(result, square)
            exponent >>= 1
            if exponent:
                square = self.mul(square, square)
        return result

    def _pow(self, a: Expr, b: Expr) -> Expr:
        if a.op == "const" and b.op == "const":
            return self._fold("pow", a, b)
        if b.op == "const" and float(b.value).is_integer() and abs(b.value) <= 64:  # pyright: ignore
            return self.power(a, int(b.value))  # pyright: ignore[reportArgumentType]
        return self.apply("sqrt", a) if b.is_constant(0.5) else self._node("pow", (a, b))

    def _gt(self, a: Expr, b: Expr) -> Expr:
        return self._compare("lt", b, a)

    def _ge(self, a: Expr, b: Expr) -> Expr:
        return self._compare("le", b, a)

    def _compare(self, op: str, a: Expr, b: Expr) -> Expr:
        """A comparison; one with a truth value written as a number is that truth value again."""
        if a.op == "const" and b.op == "const":
            return self._fold(op, a, b)
        if a.is_truth and b.is_truth:
            return self._compare_truth(op, a, b)
        for x, y, swapped in ((a, b, False), (b, a, True)):
            if x.op == "select" and y.op == x.args[1].op == x.args[2].op == "const":
                cases = [self._fold(op, y, c) if swapped else self._fold(op, c, y) for c in x.args[1:]]
                return self.select(x.args[0], *cases)
        return self._node(op, (a, b))

    _lt, _le = partialmethod(_compare, "lt"), partialmethod(_compare, "le")
    _eq, _ne = partialmethod(_compare, "eq"), partialmethod(_compare, "ne")

    def _compare_truth(self, op: str, a: Expr, b: Expr) -> Expr:
        """False is less than True."""
        if op in ("eq", "ne"):
            differ = self.apply("xor", a, b)
            return differ if op == "ne" else self._not(differ)
        return self._and(self._not(a), b) if op == "lt" else self._or(self._not(a), b)

    def _and(self, a: Expr, b: Expr) -> Expr:
        for x, y in ((a, b), (b, a)):
            if x.op == "const":
                return y if x.value else self.false
        return a if a is b else self._node("and", (a, b))

    def _or(self, a: Expr, b: Expr) -> Expr:
        for x, y in ((a, b), (b, a)):
            if x.op == "const":
                return self.true if x.value else y
        return a if a is b else self._node("or", (a, b))

    def _not(self, a: Expr) -> Expr:
        if a.op == "const":
            return self.false if a.value else self.true
        return a.args[0] if a.op == "not" else self._node("not", (a,))

    def _abs(self, a: Expr) -> Expr:
        if a.op == "const":
            return self._fold("abs", a)
        if a.op == "neg":
            return self._abs(a.args[0])
        return a if a.op == "abs" else self._node("abs", (a,))

    def _cos(self, a: Expr) -> Expr:
        return self._fold("cos", a) if a.op == "const" else self._node("cos", (a.args[0] if a.op == "neg" else a,))

    def _sin(self, a: Expr) -> Expr:
        if a.op == "const":
            return self._fold("sin", a)
        return self.neg(self._sin(a.args[0])) if a.op == "neg" else self._node("sin", (a,))


def substitute(graph: Graph, roots: Iterable[Expr], mapping: Mapping[Expr, Expr]) -> list[Expr]:
    """The roots with symbols replaced, simplified again."""
    roots = list(roots)
    new: dict[Expr, Expr] = dict(mapping)
    for node in reachable(roots):
        if node in new:
            continue
        args = [new[a] for a in node.args]
        same = all(x is y for x, y in zip(args, node.args, strict=True))
        new[node] = node if same else graph.again(node, args)
    return [new[root] for root in roots]
