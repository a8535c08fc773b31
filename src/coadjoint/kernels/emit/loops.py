"""Loops over arrays of numbers as LLVM code, for dense algebra of sizes that are known at run time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from llvmlite import ir

from coadjoint.kernels.emit.emitter import Value

DOUBLE, INT64 = ir.DoubleType(), ir.IntType(64)
NUMBERS, INTEGERS = DOUBLE.as_pointer(), INT64.as_pointer()
FUSED = ("contract",)
"""A product that is added immediately may be one instruction."""


class Loops:
    """A function that is being written: values are LLVM's, integers may be Python's."""

    def __init__(self, module: ir.Module, name: str, result: Value, *arguments: Value, inside: bool = True):
        """inside: whether only this module calls it."""
        self.function = ir.Function(module, ir.FunctionType(result, arguments), name=name)
        if inside:
            self.function.linkage = "internal"
        for argument, kind in zip(self.function.args, arguments, strict=True):
            if kind == NUMBERS:
                argument.add_attribute("noalias")
        self._entry = self.function.append_basic_block("entry")
        self.b = ir.IRBuilder(self._entry)
        self.args = self.function.args

    def integer(self, value: Value) -> Value:
        """An integer as an LLVM value."""
        return INT64(value) if isinstance(value, int) else value

    def add(self, *values: Value) -> Value:
        """The sum of integers."""
        first, *rest = map(self.integer, values)
        for value in rest:
            first = self.b.add(first, value)
        return first

    def times(self, first: Value, second: Value) -> Value:
        """The product of integers."""
        return self.b.mul(self.integer(first), self.integer(second))

    def place(self, array: Value, index: Value) -> Value:
        """A pointer to the number of an array."""
        return self.b.gep(array, [self.integer(index)])

    def at(self, array: Value, index: Value) -> Value:
        """A number of an array."""
        return self.b.load(self.place(array, index))

    def block(self, array: Value, index: Value, kind: ir.VectorType) -> Value:
        """A pointer to neighbouring numbers of an array as a vector."""
        return self.b.bitcast(self.place(array, index), kind.as_pointer())

    def spread(self, value: Value, kind: ir.VectorType) -> Value:
        """A vector of one value."""
        first = self.b.insert_element(ir.Constant(kind, ir.Undefined), value, INT64(0))
        same = ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
        return self.b.shuffle_vector(first, ir.Constant(kind, ir.Undefined), same)

    def put(self, array: ir.Value, index: Value, value: Value) -> None:
        """Set a number of an array."""
        self.b.store(value, self.place(array, index))

    def plus(self, a: Value, b: Value, c: Value) -> Value:
        """a + b c."""
        return self.b.fadd(a, self.b.fmul(b, c, flags=FUSED), flags=FUSED)  # pyright: ignore[reportCallIssue]

    def minus(self, a: Value, b: Value, c: Value) -> Value:
        """a − b c."""
        return self.b.fsub(a, self.b.fmul(b, c, flags=FUSED), flags=FUSED)  # pyright: ignore[reportCallIssue]

    def variable(self, kind: ir.Type, value: object) -> Value:
        """A place for a value that changes."""
        here = self.b.block
        first = ir.IRBuilder(self._entry)
        first.position_at_start(self._entry)
        found = first.alloca(kind)
        self.b.position_at_end(here)
        self.b.store(value, found)
        return found

    @contextmanager
    def over(self, end: object, start: object = 0) -> Iterator[Value]:
        """for i in range(start, end)."""
        b, begin, stop = self.b, self.integer(start), self.integer(end)
        body, after = b.append_basic_block("loop"), b.append_basic_block("end")
        before = b.block
        b.cbranch(b.icmp_signed("<", begin, stop), body, after)
        b.position_at_end(body)
        index = b.phi(INT64)
        index.add_incoming(begin, before)
        yield index
        following = b.add(index, INT64(1))
        index.add_incoming(following, b.block)
        b.cbranch(b.icmp_signed("<", following, stop), body, after)
        b.position_at_end(after)
