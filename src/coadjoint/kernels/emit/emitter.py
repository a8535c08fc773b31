"""Expressions as LLVM instructions, each emitted once in the outermost place that a section allows.

A value is a double, or a vector of doubles with one trajectory in each SIMD lane; truth values are bits alike.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from llvmlite import ir

from coadjoint.kernels.emit.gauss import solution_where_unsafe
from coadjoint.kernels.expressions.expression import Expr, Loop, reachable
from coadjoint.kernels.expressions.operations import Table
from coadjoint.kernels.untraceable import Untraceable

Value = Any
"""A value of LLVM, or a vector with a value for each lane; llvmlite declares no types."""

DOUBLE = ir.DoubleType()
INT64 = ir.IntType(64)
BIT = ir.IntType(1)

FREE = ("contract", "reassoc", "nsz")
"""For what affects only Newton's convergence, the derivatives and the linear solve: sums may be fused and reordered."""

_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_COMPARISONS = {"lt": "<", "le": "<=", "eq": "==", "ne": "!="}
_LOGIC = {"and": "and_", "or": "or_", "xor": "xor"}
_INTRINSICS = {
    **{name: name for name in ("sqrt", "sin", "cos", "exp", "exp2", "log", "log2", "pow", "floor", "ceil")},
    "abs": "fabs",
    "round_even": "rint",
    "round_away": "round",
    "truncate": "trunc",
    "min": "minimum",
    "max": "maximum",
}
_LIBM = {
    **{name: name for name in ("tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh")},
    **{name: name for name in ("atanh", "expm1", "log1p", "cbrt", "erf", "erfc")},
    "rem": "fmod",
}


class Emitter:
    """Writes expressions through an IRBuilder; scopes forget values emitted on a side path."""

    def __init__(self, module: ir.Module, builder: ir.IRBuilder, width: int) -> None:
        self.module = module
        self.builder = builder
        self.width = width
        self.number = DOUBLE if width == 1 else ir.VectorType(DOUBLE, width)
        self.truth = BIT if width == 1 else ir.VectorType(BIT, width)
        self.counter = INT64 if width == 1 else ir.VectorType(INT64, width)
        self._exact: set[Expr] | None = None
        self._unsigned: set[Expr] = set()
        self._scopes: list[dict[Expr, Value]] = [{}]

    def keep_exact(self, nodes: Iterable[Expr]) -> None:
        """Say which expressions are results; all others may have their sums reordered."""
        self._exact = set(nodes)

    @contextmanager
    def scope(self) -> Iterator[None]:
        """Values emitted inside are not used outside."""
        self._scopes.append({})
        try:
            yield
        finally:
            self._scopes.pop()

    def bind(self, node: Expr, value: Value) -> None:
        """The value of a symbol in this scope."""
        self._scopes[-1][node] = value

    def variable(self, kind: Value, value: Value = None) -> Value:
        """A local variable; LLVM keeps it in a register."""
        with self.builder.goto_entry_block():
            place = self.builder.alloca(kind)
        if value is not None:
            self.builder.store(value, place)
        return place

    def constant(self, value: float) -> ir.Constant:
        """A number in every lane."""
        # LLVM takes infinities and NaN only in hexadecimal; llvmlite writes them so.
        scalar = ir.Constant(DOUBLE, float(value))
        return scalar if self.width == 1 else ir.Constant(self.number, [scalar] * self.width)

    def bit(self, value: bool) -> ir.Constant:
        """A truth value in every lane."""
        scalar = ir.Constant(BIT, int(value))
        return scalar if self.width == 1 else ir.Constant(self.truth, [scalar] * self.width)

    def counts(self, value: int) -> Value:
        """An integer in every lane."""
        if self.width == 1:
            return INT64(value)
        return ir.Constant(self.counter, [INT64(value)] * self.width)

    def any(self, mask: Value) -> Value:
        """Whether the mask holds in any lane."""
        if self.width == 1:
            return mask
        bits = self.builder.bitcast(mask, ir.IntType(self.width))
        return self.builder.icmp_unsigned("!=", bits, ir.IntType(self.width)(0))

    def values(self, roots: Iterable[Expr]) -> list[Value]:
        """The values of the roots, after emitting all missing values that they need."""
        roots = list(roots)
        for node in self._missing(roots):
            self._scopes[-1][node] = self._instruction(node)
            if _unsigned(node, self._unsigned):
                self._unsigned.add(node)
        return [self._known(root) for root in roots]

    def _missing(self, roots: list[Expr]) -> list[Expr]:
        """Nodes without a value, arguments first."""
        found: dict[int, Expr] = {}
        stack = [root for root in roots if self._known(root) is None]
        while stack:
            node = stack.pop()
            if node.number not in found:
                found[node.number] = node
                used = node.args[:1] if node.op == "sloped" else node.args
                stack.extend(a for a in used if self._known(a) is None)
        return [found[number] for number in sorted(found)]

    def _known(self, node: Expr) -> Value:
        for scope in reversed(self._scopes):
            value = scope.get(node)
            if value is not None:
                return value
        return None

    def _instruction(self, node: Expr) -> Value:
        op, builder = node.op, self.builder
        if op == "const":
            return self.bit(node.value) if isinstance(node.value, bool) else self.constant(node.value)  # pyright: ignore
        if op == "placeholder":
            raise Untraceable(str(node.value), "its result is used other than in a linear solve")
        args = [self._known(a) for a in node.args]
        if isinstance(node.value, Table):
            return self._entry(node.value, args[0])
        if op in _ARITHMETIC:
            # (1/m) r would become r/m, which divides at every step where m never changes.
            if op != "div" and self._exact is not None and node not in self._exact:
                return getattr(builder, _ARITHMETIC[op])(*args, flags=FREE)
            return self._fused(node) if op in ("add", "sub") else getattr(builder, _ARITHMETIC[op])(*args)
        if op == "neg":
            return builder.fneg(*args)
        if op == "select":
            return builder.select(*args)
        if op == "pivoted":
            assert isinstance(node.value, tuple)
            end = 1 + len(node.value)
            return solution_where_unsafe(self, args[0], dict(zip(node.value, args[1:end], strict=True)), args[end:])
        if isinstance(node.value, Loop):
            return self._loop(node.value, args)
        if op == "outcome":
            return args[0][node.value[0]]  # pyright: ignore[reportIndexIssue, reportOptionalSubscript]
        if op == "sloped":
            return args[0]
        if op == "solution":
            quick, safe, pivoted = args
            return builder.select(safe, quick, builder.load(builder.gep(pivoted, [INT64(node.value)]), align=8))
        if op in _COMPARISONS:
            compare = builder.fcmp_unordered if op == "ne" else builder.fcmp_ordered
            return compare(_COMPARISONS[op], *args)
        if op in _LOGIC:
            return getattr(builder, _LOGIC[op])(*args)
        if op == "not":
            return builder.xor(args[0], self.bit(True))
        if op == "is_finite":
            return builder.fcmp_ordered("<", self.intrinsic("fabs", args[0]), self.constant(np.inf))
        if op == "sign":
            return self._sign(args[0])
        if op in ("min", "max") and self._unsigned.issuperset(node.args):
            # That −0 is less than 0 would take a branch, and twice as many instructions.
            return self.intrinsic(_INTRINSICS[op], *args, flags=("nsz",))
        if op in _INTRINSICS:
            return self.intrinsic(_INTRINSICS[op], *args)
        if op in _LIBM:
            return self._libm(_LIBM[op], *args)
        raise Untraceable(op)

    def _loop(self, loop: Loop, start: list[Value]) -> list[Value]:
        """The values at the end of a loop; a lane that is done keeps its own until the last one is."""
        b, exact = self.builder, self._exact
        before, head, body, end = b.block, *(b.append_basic_block(name) for name in ("while", "trip", "done"))
        b.branch(head)
        b.position_at_end(head)
        carried = [b.phi(self.number) for _ in start]
        self._exact = None
        with self.scope():
            for symbol, value in zip(loop.carried, carried, strict=True):
                self.bind(symbol, value)
            (again,) = self.values([loop.test])
            b.cbranch(self.any(again), body, end)
            b.position_at_end(body)
            found = self.values(loop.results)
            if self.width > 1:
                found = [b.select(again, new, old) for new, old in zip(found, carried, strict=True)]
        self._exact = exact
        back = b.block
        b.branch(head)
        for value, first, new in zip(carried, start, found, strict=True):
            value.add_incoming(first, before)
            value.add_incoming(new, back)
        b.position_at_end(end)
        return carried

    def _fused(self, node: Expr) -> Value:
        """A sum or difference, as one operation with the first of its arguments that is a product.

        LLVM would choose by the other users of the product, so that a monitor could change the last digit of a state.
        """
        b, (first, second) = self.builder, node.args
        x, y, minus = self._known(first), self._known(second), node.op == "sub"
        if first.op == "mul":
            return self.intrinsic("fmuladd", *map(self._known, first.args), b.fneg(y) if minus else y)
        if second.op == "mul":
            u, v = map(self._known, second.args)
            return self.intrinsic("fmuladd", b.fneg(u) if minus else u, v, x)
        return getattr(b, "fsub" if minus else "fadd")(x, y)

    def _entry(self, table: Table, place: ir.Value) -> ir.Value:
        """The number at a place in a constant array of the module, in each lane its own."""
        b, array = self.builder, self._array(table)

        def load(index: Value) -> Value:
            return b.load(b.gep(array, [index]), align=8)

        places = b.fptosi(place, self.counter)
        if self.width == 1:
            return load(places)
        found = ir.Constant(self.number, ir.Undefined)
        for lane in range(self.width):
            number = ir.Constant(ir.IntType(32), lane)
            found = b.insert_element(found, load(b.extract_element(places, number)), number)
        return found

    def _array(self, table: Table) -> Value:
        """A pointer to the numbers of a table, which are in the module once, written as bytes."""
        name = f"table.{table.digest}"
        array: Value = self.module.globals.get(name)
        if array is None:
            bytes_ = table.numbers.tobytes()
            kind = ir.ArrayType(ir.IntType(8), len(bytes_))
            array = ir.GlobalVariable(self.module, kind, name)
            array.global_constant, array.linkage, array.align = True, "internal", 8
            array.initializer = ir.FormattedConstant(kind, 'c"\\' + bytes_.hex("\\") + '"')
        return array.bitcast(DOUBLE.as_pointer())

    def _sign(self, x: ir.Value) -> ir.Value:
        builder, zero = self.builder, self.constant(0.0)
        negative = builder.select(builder.fcmp_ordered("<", x, zero), self.constant(-1.0), x)
        return builder.select(builder.fcmp_ordered(">", x, zero), self.constant(1.0), negative)

    def intrinsic(self, name: str, *args: Value, flags: tuple[str, ...] = ()) -> ir.Value:
        """An LLVM intrinsic on numbers."""
        suffix = "f64" if self.width == 1 else f"v{self.width}f64"
        return self.builder.call(self._function(f"llvm.{name}.{suffix}", self.number, len(args)), args, fastmath=flags)

    def _libm(self, name: str, *args: ir.Value) -> ir.Value:
        function = self._function(name, DOUBLE, len(args))
        if self.width == 1:
            return self.builder.call(function, args)
        result = ir.Constant(self.number, ir.Undefined)
        for lane in range(self.width):
            place = ir.Constant(ir.IntType(32), lane)
            value = self.builder.call(function, [self.builder.extract_element(a, place) for a in args])
            result = self.builder.insert_element(result, value, place)
        return result

    def _function(self, name: str, number: Value, count: int) -> ir.Function:
        function = self.module.globals.get(name)
        if function is None:
            function = ir.Function(self.module, ir.FunctionType(number, [number] * count), name=name)
            function.attributes.add("nounwind")
        return function


def _unsigned(node: Expr, known: Collection[Expr]) -> bool:
    """Whether a number, if not NaN, is above 0 or +0, as those known to be so are."""
    if node.op == "const":
        return not isinstance(node.value, bool) and np.copysign(1.0, node.value) > 0  # pyright: ignore
    if node.op == "max":
        return any(argument in known for argument in node.args)
    if node.op in ("min", "select"):
        return all(argument in known for argument in node.args[-2:])
    return node.op == "abs"


def outer(roots: Iterable[Expr], inner: set[Expr]) -> list[Expr]:
    """The values that a section takes from outside: nodes that do not depend on `inner` symbols but whose users do.

    Roots that do not depend on them count as used.
    """
    roots = list(roots)
    dependent: set[Expr] = set(inner)
    used: dict[Expr, None] = {}
    for node in reachable(roots):
        if not dependent.isdisjoint(node.args):
            dependent.add(node)
            used.update((a, None) for a in node.args if a not in dependent)
    used.update((root, None) for root in roots if root not in dependent)
    return [node for node in used if node.op != "const"]
