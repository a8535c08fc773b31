"""Gaussian elimination with partial pivoting as an LLVM function, for the rare system a closed form may not solve."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import ir

BYTES = ir.IntType(8).as_pointer()
_DOUBLE, _INT64 = ir.DoubleType(), ir.IntType(64)
_POINTER = _DOUBLE.as_pointer()
_NAME = "gauss"


def gauss(module: ir.Module) -> ir.Function:
    """void gauss(a, x, n): x ← a⁻¹ x in place, a (n, n) by rows and overwritten."""
    known = module.globals.get(_NAME)
    if known is not None:
        return known
    signature = ir.FunctionType(ir.VoidType(), [_POINTER, _POINTER, _INT64])
    function = ir.Function(module, signature, name=_NAME)
    function.linkage = "internal"
    for attribute in ("noinline", "nounwind"):
        function.attributes.add(attribute)
    _Gauss(function).write()
    return function


def solved_lanes(emit: Any, matrix: dict[int, Any], right: list[ir.Value]) -> Iterator[list[Any]]:
    """The solution of each lane of an `Emitter` by elimination with partial pivoting, one after the other.

    matrix: the nonzero entries, by their places in the rows end to end.
    """
    b, n = emit.builder, len(right)
    function, cleared = gauss(emit.module), emit.module.declare_intrinsic("llvm.memset", [BYTES, _INT64])
    with b.goto_entry_block():
        a = b.alloca(_DOUBLE, n * n)
        x = b.alloca(_DOUBLE, n)
    for lane in range(emit.width):
        pick = (lambda v: v) if emit.width == 1 else (lambda v, k=lane: b.extract_element(v, ir.IntType(32)(k)))
        b.call(cleared, [b.bitcast(a, BYTES), ir.IntType(8)(0), _INT64(8 * n * n), ir.IntType(1)(0)])
        for place, values in ((a, matrix), (x, dict(enumerate(right)))):
            for i, value in values.items():
                b.store(pick(value), b.gep(place, [_INT64(i)]))
        b.call(function, [a, x, _INT64(n)])
        yield [b.load(b.gep(x, [_INT64(i)])) for i in range(n)]


def solution_where_unsafe(emit: Any, safe: ir.Value, matrix: dict[int, Any], right: list[ir.Value]) -> ir.Value:
    """A pointer to the solution, computed where some lane is not safe, else to nothing yet."""
    b, n = emit.builder, len(right)
    with b.goto_entry_block():
        found = b.alloca(_DOUBLE, n * emit.width)
    with b.if_then(emit.any(b.xor(safe, emit.bit(True))), likely=False):
        for lane, values in enumerate(solved_lanes(emit, matrix, right)):
            for i, value in enumerate(values):
                b.store(value, b.gep(found, [_INT64(i * emit.width + lane)]))
    return b.bitcast(found, emit.number.as_pointer())


class _Gauss:
    def __init__(self, function: ir.Function) -> None:
        self.a, self.x, self.n = function.args
        self.b = ir.IRBuilder(function.append_basic_block("entry"))
        name = "llvm.fabs.f64"
        known = function.module.globals.get(name)
        self.magnitude = known or ir.Function(function.module, ir.FunctionType(_DOUBLE, [_DOUBLE]), name=name)

    @contextmanager
    def loop(self, start: ir.Value | None, end: ir.Value) -> Iterator[Any]:
        """for i in range(start, end)"""
        b = self.b
        with b.goto_entry_block():
            place = b.alloca(_INT64)
        b.store(start, place)
        head, body, after = (b.append_basic_block(name) for name in ("head", "body", "after"))
        b.branch(head)
        b.position_at_end(head)
        i = b.load(place)
        b.cbranch(b.icmp_signed("<", i, end), body, after)
        b.position_at_end(body)
        yield i
        b.store(b.add(i, _INT64(1)), place)
        b.branch(head)
        b.position_at_end(after)

    def entry(self, i: Any, j: object) -> Any:
        """The address of a[i, j]."""
        return self.b.gep(self.a, [self.b.add(self.b.mul(i, self.n), j)])

    def swap(self, first: ir.Value, second: ir.Value) -> None:
        x, y = self.b.load(first), self.b.load(second)
        self.b.store(y, first)
        self.b.store(x, second)

    def subtract(self, place: ir.Value, factor: Any, other: ir.Value) -> None:
        """*place −= factor · *other"""
        b = self.b
        b.store(b.fsub(b.load(place), b.fmul(factor, b.load(other))), place)

    def pivot(self, k: Any) -> Any:
        """The row at or below k with the largest element in column k."""
        b = self.b
        with b.goto_entry_block():
            best, row = b.alloca(_DOUBLE), b.alloca(_INT64)
        b.store(b.call(self.magnitude, [b.load(self.entry(k, k))]), best)
        b.store(k, row)
        with self.loop(b.add(k, _INT64(1)), self.n) as i:
            size = b.call(self.magnitude, [b.load(self.entry(i, k))])
            larger = b.fcmp_ordered(">", size, b.load(best))
            b.store(b.select(larger, size, b.load(best)), best)
            b.store(b.select(larger, i, b.load(row)), row)
        return b.load(row)

    def write(self) -> None:
        b, n, one = self.b, self.n, _INT64(1)
        with self.loop(_INT64(0), n) as k:
            row = self.pivot(k)
            with self.loop(k, n) as j:
                self.swap(self.entry(k, j), self.entry(row, j))
            self.swap(b.gep(self.x, [k]), b.gep(self.x, [row]))
            with self.loop(b.add(k, one), n) as i:
                factor = b.fdiv(b.load(self.entry(i, k)), b.load(self.entry(k, k)))
                with self.loop(b.add(k, one), n) as j:
                    self.subtract(self.entry(i, j), factor, self.entry(k, j))
                self.subtract(b.gep(self.x, [i]), factor, b.gep(self.x, [k]))
        with self.loop(_INT64(0), n) as up:
            i = b.sub(b.sub(n, one), up)
            place = b.gep(self.x, [i])
            with self.loop(b.add(i, one), n) as j:
                self.subtract(place, b.load(self.entry(i, j)), b.gep(self.x, [j]))
            b.store(b.fdiv(b.load(place), b.load(self.entry(i, i))), place)
        b.ret_void()
