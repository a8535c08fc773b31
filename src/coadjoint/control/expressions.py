"""Scalar expressions as CasADi's, operation by operation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from coadjoint.arrays import PyTree
from coadjoint.control.library import casadi
from coadjoint.errors import LagrangianError
from coadjoint.kernels.expressions.expression import Expr, Loop, reachable
from coadjoint.kernels.expressions.operations import Table
from coadjoint.kernels.trace.control import MAX_TRIPS

SAME = ("sign", "floor", "ceil", "sqrt", "exp", "log", "log1p", "expm1", "sin", "cos", "tan", "sinh", "cosh", "tanh",
        "asin", "acos", "atan", "asinh", "acosh", "atanh", "atan2", "erf", "lt", "le", "eq", "ne")  # fmt: skip
"""Operations that CasADi has under the same name."""

LONGEST_TABLE = 4096
"""The longest table that is written as selections, of which there are as many as entries."""


def casadi_expressions(roots: Iterable[Expr], known: Mapping[Expr, Any]) -> list[object]:
    """The roots as `casadi.SX`, with `known` in place of the symbols. Shared expressions stay shared.

    Truth values are 0 and 1. Raises LagrangianError for an operation that CasADi does not have.
    """
    ca, roots = casadi(), list(roots)
    operations, found = _operations(ca), dict(known)
    for node in reachable(roots):
        if node in found:
            continue
        if node.op == "const":
            found[node] = ca.SX(float(node.value))  # pyright: ignore[reportArgumentType]
        elif node.op == "entry":
            assert isinstance(node.value, Table)
            found[node] = _entry(ca, node.value, found[node.args[0]])
        elif node.op == "pivoted":
            found[node] = None
        elif isinstance(node.value, Loop):
            found[node] = _unrolled(ca, node.value, [found[a] for a in node.args])
        elif node.op == "outcome":
            found[node] = found[node.args[0]][node.value[0]]  # pyright: ignore[reportIndexIssue, reportOptionalSubscript]
        elif node.op in operations:
            found[node] = operations[node.op](*(found[a] for a in node.args))
        else:
            what = node.value if node.op in ("placeholder", "symbol") else node.op
            raise LagrangianError(f"CasADi has no operation `{what}`: write the function without it.")
    return [found[root] for root in roots]


def _operations(ca: Any) -> dict[str, Callable[..., PyTree]]:
    return {
        **{name: getattr(ca, name) for name in SAME},
        "neg": lambda a: -a,
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "div": lambda a, b: a / b,
        "pow": lambda a, b: a**b,
        "abs": ca.fabs,
        "cbrt": lambda a: ca.sign(a) * ca.fabs(a) ** (1 / 3),
        "exp2": lambda a: ca.exp(math.log(2.0) * a),
        "log2": lambda a: ca.log(a) / math.log(2.0),
        "erfc": lambda a: 1 - ca.erf(a),
        "rem": ca.fmod,
        "min": ca.fmin,
        "max": ca.fmax,
        "gt": ca.gt,
        "ge": ca.ge,
        "and": lambda a, b: ca.SX(0) if a.is_zero() or b.is_zero() else ca.logic_and(a, b),
        "or": ca.logic_or,
        "xor": ca.ne,
        "not": ca.logic_not,
        "is_finite": lambda a: ca.fabs(a) < math.inf,
        "truncate": lambda a: ca.sign(a) * ca.floor(ca.fabs(a)),
        "select": ca.if_else,
        "solution": lambda quick, safe, pivoted: quick,
        "sloped": lambda value, slope: value,
    }


def _unrolled(ca: Any, loop: Loop, start: list[Any]) -> list[Any]:
    """The values at the end of a loop whose test fails after a number of trips that is known."""
    values = end = start  # `values` go on after the end, so that a count stays a number
    running = ca.SX(1)
    for _ in range(MAX_TRIPS):
        known = dict(zip(loop.carried, values, strict=True))
        found: list[Any] = casadi_expressions([loop.test, *loop.results], known)
        again, values = found[0], found[1:]
        if again.is_zero():
            return end
        running = ca.logic_and(running, again)
        end = [ca.if_else(running, new, old) for new, old in zip(values, end, strict=True)]
    raise LagrangianError(
        f"CasADi unrolls loops, and one has no known end within {MAX_TRIPS:,} trips: count them, and test the count."
    )


def _entry(ca: Any, table: Table, place: PyTree) -> PyTree:
    """The number of a table at an integer index, by halving."""
    if len(table.numbers) > LONGEST_TABLE:
        raise LagrangianError(
            f"A table of {len(table.numbers):,} numbers is too long for CasADi's expressions, which take up to "
            f"{LONGEST_TABLE:,}: give the function a shorter one."
        )

    def among(first: int, last: int) -> PyTree:
        if first == last:
            return ca.SX(float(table.numbers[first]))
        middle = (first + last) // 2
        return ca.if_else(place <= middle, among(first, middle), among(middle + 1, last))

    return among(0, len(table.numbers) - 1)
