"""Scalar expressions: a node, which `graph.py` builds, and all nodes that some use."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from coadjoint.kernels.expressions.operations import Table

TRUTH = frozenset(("lt", "le", "eq", "ne", "and", "or", "xor", "not", "is_finite"))
"""Operations whose results are true or false."""


@dataclass(frozen=True)
class Loop:
    """carried ← results while `test` holds: expressions of the symbols `carried` and of nothing else."""

    carried: tuple[Expr, ...]
    test: Expr
    results: tuple[Expr, ...]


Value = float | bool | str | Table | tuple[int, ...] | Loop | None


class Expr:
    """An operation on nodes, a constant (`value`) or a symbol (`value` is its name); `number` grows with depth.

    "entry" is the number at an integer index, its argument, in the table that is its `value`. "pivoted" is the solution
    of a linear system by elimination with pivots, and "solution" an unknown of such a system: `Graph.guarded`. "loop"
    runs the `Loop` that is its `value` from its arguments, and "outcome" is a value at its end: `Graph.loop`. "sloped"
    has the value of its first argument and the derivatives of its second.
    """

    __slots__ = ("args", "number", "op", "value")

    def __init__(self, op: str, args: tuple[Expr, ...], value: Value, number: int) -> None:
        self.op = op
        self.args = args
        self.value = value
        self.number = number

    def __repr__(self) -> str:
        if not self.args:
            return str(self.value)
        # One level: expanded in full, shared expressions would fill memory.
        return f"{self.op}({', '.join(str(a.value) if not a.args else f'#{a.number}' for a in self.args)})"

    @property
    def is_truth(self) -> bool:
        """Whether this is true or false, not a number."""
        if self.op == "select":
            return self.args[1].is_truth
        return self.op in TRUTH or isinstance(self.value, bool)

    def is_constant(self, value: float) -> bool:
        """Whether this is the number `value`."""
        return self.op == "const" and self.value == value


def reachable(roots: Iterable[Expr], inputs: Callable[[Expr], Iterable[Expr]] | None = None) -> list[Expr]:
    """Every node that the roots use, arguments before their users; inputs: those that a node uses, its arguments."""
    seen: dict[int, Expr] = {}
    stack = list(roots)
    while stack:
        node = stack.pop()
        if node.number not in seen:
            seen[node.number] = node
            stack += node.args if inputs is None else inputs(node)
    return [seen[number] for number in sorted(seen)]
