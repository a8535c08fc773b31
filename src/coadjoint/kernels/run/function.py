"""Functions of numbers, their Jacobians and recursions: as machine code, by XLA where they cannot be traced."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np
from llvmlite import ir

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit.emitter import DOUBLE, INT64, Emitter
from coadjoint.kernels.expressions.differentiation import forward
from coadjoint.kernels.expressions.expression import reachable
from coadjoint.kernels.run.backend import fall_back
from coadjoint.kernels.run.machine import machine
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.kernels.untraceable import Untraceable

NAME = "function"


class NativeFunction:
    """function(x, y) with its derivatives by x: x (m,) and y (k,) are flat, and so is the value (n,).

    reads: whether the value depends on each number of y, (k,).

    Raises Untraceable, naming the primitive, if the function is outside the tracer's language.
    """

    def __init__(self, function: Callable[[PyTree, PyTree], PyTree], x: np.ndarray, y: np.ndarray) -> None:
        self._traced = function, x, y
        assembly, self.shape, self.reads = _assembly(function, x, y)
        self._machine = machine(assembly)
        self.code = self._machine.function(NAME, *[ctypes.c_void_p] * 4, ctypes.c_int64)

    def assembly(self) -> str:
        """Its LLVM assembly, of which it keeps the machine code alone."""
        return _assembly(*self._traced)[0]

    def __call__(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (rows, n) and Jacobians (rows, n, m) at x (rows, m), y (rows, k)."""
        x, y = np.ascontiguousarray(x, np.float64), np.ascontiguousarray(y, np.float64)
        value, slopes = np.zeros((len(x), self.shape[0])), np.zeros((len(x), *self.shape))
        self.code(*(a.ctypes.data for a in (x, y, value, slopes)), len(x))
        return value, slopes


def _assembly(
    function: Callable[[PyTree, PyTree], PyTree], x: np.ndarray, y: np.ndarray
) -> tuple[str, tuple[int, int], np.ndarray]:
    """The module of a function with its derivatives by x, the shape of these, and which numbers of y it reads."""
    tracer = Tracer()
    symbols = tracer.symbols("x", x), tracer.symbols("y", y)
    value = flat(tracer.trace(function, *symbols))
    rows = forward(tracer.graph, value, flat(symbols[0]))
    m = x.size
    slopes = {i * m + j: node for i, row in enumerate(rows) for j, node in row.items()}
    given = [(nodes, len(nodes)) for nodes in map(flat, symbols)]
    found = [(dict(enumerate(value)), len(value)), (slopes, len(value) * m)]
    used = set(reachable(value))
    return assembled(given, found), (len(value), m), np.array([node in used for node in given[1][0]], bool)


def assembled(given: Sequence[tuple[list[PyTree], int]], found: Sequence[tuple[Mapping[int, Any], int]]) -> str:
    """void function(arrays of `given`, arrays of `found`, rows): entries that are absent from `found` are left
    unwritten.

    given: the nodes that an array holds, and by how many numbers it moves on after a row. found: likewise nodes by
    their places.
    """
    module = ir.Module(name="coadjoint")
    pointer = DOUBLE.as_pointer()
    signature = ir.FunctionType(ir.VoidType(), [*[pointer] * (len(given) + len(found)), INT64])
    function = ir.Function(module, signature, name=NAME)
    b = ir.IRBuilder(function.append_basic_block("entry"))
    emit = Emitter(module, b, 1)
    *arrays, rows = function.args
    loop, end = b.append_basic_block("loop"), b.append_basic_block("end")
    before = b.block
    b.cbranch(b.icmp_signed(">", rows, INT64(0)), loop, end)
    b.position_at_end(loop)
    row = b.phi(INT64)
    row.add_incoming(INT64(0), before)
    starts = [b.mul(row, INT64(stride)) for _, stride in [*given, *found]]

    def place(number: int, index: int) -> Any:
        return b.gep(arrays[number], [b.add(starts[number], INT64(index))])

    with emit.scope():
        for number, (nodes, _) in enumerate(given):
            for i, node in enumerate(nodes):
                emit.bind(node, b.load(place(number, i)))
        for number, (results, _) in enumerate(found, len(given)):
            for i, result in zip(results, emit.values(results.values()), strict=True):
                b.store(result, place(number, i))
    following = b.add(row, INT64(1))
    row.add_incoming(following, b.block)
    b.cbranch(b.icmp_signed("<", following, rows), loop, end)
    b.position_at_end(end)
    b.ret_void()
    return str(module)


class RowFunction:
    """function(x, y), x (m,) and y (k,) flat, with its derivatives by x, for many rows together.

    x, y: values of their shapes, for tracing.
    """

    def __init__(self, function: Callable[[PyTree, PyTree], PyTree], x: np.ndarray, y: np.ndarray):
        try:
            self.native: NativeFunction | None = NativeFunction(function, x, y)
            self._call: Callable[..., PyTree] = self.native
        except Untraceable as reason:
            fall_back(reason, "auto")
            self.native, self._call = None, _by_xla(function)

    def __call__(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (rows, n) and Jacobians (rows, n, m) at x (rows, m), y (rows, k)."""
        return self._call(x, y)


def _by_xla(function: Callable[[PyTree, PyTree], PyTree]) -> Callable[..., PyTree]:
    both = jax.jit(jax.vmap(lambda x, y: (function(x, y), jax.jacfwd(function)(x, y))))

    def call(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        with jax.enable_x64(True):
            value, slopes = both(x, y)
        return np.array(value), np.array(slopes)

    return call


class NativeRecursion:
    """x_{k+1} = function(x_k, u_k, c): x (n,), u (k,) and c (m,) are flat, and so is the value (n,).

    Raises Untraceable, naming the primitive, if the function is outside the tracer's language.
    """

    def __init__(
        self, function: Callable[[PyTree, PyTree, PyTree], PyTree], x: np.ndarray, u: np.ndarray, c: np.ndarray
    ) -> None:
        tracer = Tracer()
        symbols = [tracer.symbols(name, values) for name, values in (("x", x), ("u", u), ("c", c))]
        value = flat(tracer.trace(function, *symbols))
        given = [(flat(symbols[0]), x.size), (flat(symbols[1]), u.size), (flat(symbols[2]), 0)]
        self._machine = machine(assembled(given, [(dict(enumerate(value)), x.size)]))
        self.code = self._machine.function(NAME, *[ctypes.c_void_p] * 4, ctypes.c_int64)

    def __call__(self, x: np.ndarray, u: np.ndarray, c: np.ndarray) -> np.ndarray:
        """x_0, x_1, …, (steps + 1, n), from x_0 = x with u (steps, k)."""
        u, c = np.ascontiguousarray(u, np.float64), np.ascontiguousarray(c, np.float64)
        found = np.empty((len(u) + 1, x.size))
        found[0] = x
        # Each step writes to where the next one reads.
        self.code(found.ctypes.data, u.ctypes.data, c.ctypes.data, found.ctypes.data + found.strides[0], len(u))
        return found
