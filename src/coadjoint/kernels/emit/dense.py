"""Dense algebra as LLVM code: matrices in rows, element (i, j) at i·stride + j."""

from __future__ import annotations

from typing import NamedTuple

from llvmlite import ir

from coadjoint.kernels.emit.emitter import Value
from coadjoint.kernels.emit.loops import DOUBLE, INT64, NUMBERS, Loops

VOID = ir.VoidType()
BLOCK = 8
"""The columns of a block of a product, a few registers."""


class DenseAlgebra(NamedTuple):
    """Functions of a module."""

    copy: Value
    product: Value
    full: Value
    transpose: Value
    solve: Value
    cholesky: Value
    cholesky_solve: Value


def dense(module: ir.Module) -> DenseAlgebra:
    """All of them in a module."""
    products = _product(module), _full(module)
    rest = _transpose(module), _solve(module), _cholesky(module), _cholesky_solve(module)
    return DenseAlgebra(_copy(module), *products, *rest)


def _copy(module: ir.Module) -> ir.Value:
    """copy(to, from, count)."""
    f = Loops(module, "copy", VOID, NUMBERS, NUMBERS, INT64)
    to, source, count = f.args
    with f.over(count) as i:
        f.put(to, i, f.at(source, i))
    f.b.ret_void()
    return f.function


def _product(module: ir.Module) -> Value:
    """product(C, A, B, rows, inner, columns, strides of C, A, B, factor): C ← C + factor A B; zeros of A are
    skipped."""
    f = Loops(module, "product", VOID, *[NUMBERS] * 3, *[INT64] * 6, DOUBLE)
    C, A, B, rows, inner, columns, c, a, b, factor = f.args
    with f.over(rows) as i:
        row = f.times(i, c)
        with f.over(inner) as k:
            value = f.b.fmul(f.at(A, f.add(f.times(i, a), k)), factor)
            other = f.times(k, b)
            with f.b.if_then(f.b.fcmp_unordered("!=", value, DOUBLE(0.0))), f.over(columns) as j:
                here = f.place(C, f.add(row, j))
                f.b.store(f.plus(f.b.load(here), value, f.at(B, f.add(other, j))), here)
    f.b.ret_void()
    return f.function


def _full(module: ir.Module) -> Value:
    """full(…): as `product`, of an A with few zeros, by blocks of BLOCK columns that stay in registers.

    The last block ends with the last column, and leaves those that the block before has changed.
    """
    f = Loops(module, "full", VOID, *[NUMBERS] * 3, *[INT64] * 6, DOUBLE)
    C, A, B, rows, inner, columns, c, a, b, factor = f.args
    vector = ir.VectorType(DOUBLE, BLOCK)
    integers = ir.VectorType(INT64, BLOCK)
    numbers = ir.Constant(integers, list(range(BLOCK)))
    total, zero = f.variable(vector, ir.Constant(vector, [0.0] * BLOCK)), ir.Constant(vector, [0.0] * BLOCK)
    wide = f.b.icmp_signed(">=", columns, INT64(BLOCK))
    with f.b.if_then(f.b.not_(wide)):
        product = module.get_global("product")
        f.b.call(product, f.args)
        f.b.ret_void()
    blocks, furthest = f.b.sdiv(f.add(columns, BLOCK - 1), INT64(BLOCK)), f.b.sub(columns, INT64(BLOCK))
    with f.over(rows) as i, f.over(blocks) as block:
        wanted = f.times(block, BLOCK)
        first = f.b.select(f.b.icmp_signed("<", wanted, furthest), wanted, furthest)
        f.b.store(zero, total)
        with f.over(inner) as k:
            along = f.block(B, f.add(f.times(k, b), first), vector)
            value = f.spread(f.at(A, f.add(f.times(i, a), k)), vector)
            f.b.store(f.plus(f.b.load(total), value, f.b.load(along, align=8)), total)
        here = f.block(C, f.add(f.times(i, c), first), vector)
        before = f.b.load(here, align=8)
        changed = f.plus(before, f.spread(factor, vector), f.b.load(total))
        new = f.b.icmp_signed(">=", numbers, f.spread(f.b.sub(wanted, first), integers))
        f.b.store(f.b.select(new, changed, before), here, align=8)
    f.b.ret_void()
    return f.function


def _transpose(module: ir.Module) -> Value:
    """transpose(to, from, rows, columns, stride of from): to (columns, rows)."""
    f = Loops(module, "transpose", VOID, NUMBERS, NUMBERS, *[INT64] * 3)
    to, source, rows, columns, stride = f.args
    with f.over(rows) as i, f.over(columns) as j:
        f.put(to, f.add(f.times(j, rows), i), f.at(source, f.add(f.times(i, stride), j)))
    f.b.ret_void()
    return f.function


def _solve(module: ir.Module) -> Value:
    """solve(A, B, m, columns, strides of A, B): B ← A⁻¹B by Gauss with the largest pivots; A is used up.

    A singular A leaves numbers that are not finite.
    """
    f = Loops(module, "solve", VOID, NUMBERS, NUMBERS, *[INT64] * 4)
    A, B, m, columns, a, b = f.args
    absolute = module.declare_intrinsic("llvm.fabs", [DOUBLE])
    best, row = f.variable(DOUBLE, DOUBLE(0.0)), f.variable(INT64, INT64(0))
    with f.over(m) as k:
        f.b.store(DOUBLE(-1.0), best)
        with f.over(m, k) as i:
            size = f.b.call(absolute, [f.at(A, f.add(f.times(i, a), k))])
            with f.b.if_then(f.b.fcmp_ordered(">", size, f.b.load(best))):
                f.b.store(size, best)
                f.b.store(i, row)
        chosen = f.b.load(row)
        with f.b.if_then(f.b.icmp_signed("!=", chosen, k)):
            for M, count, stride in ((A, m, a), (B, columns, b)):
                with f.over(count) as j:
                    one, other = (f.place(M, f.add(f.times(r, stride), j)) for r in (k, chosen))
                    kept = f.b.load(one)
                    f.b.store(f.b.load(other), one)
                    f.b.store(kept, other)
        pivot = f.b.fdiv(DOUBLE(1.0), f.at(A, f.add(f.times(k, a), k)))
        with f.over(columns) as j:
            here = f.place(B, f.add(f.times(k, b), j))
            f.b.store(f.b.fmul(f.b.load(here), pivot), here)
        with f.over(m, f.add(k, 1)) as j:
            here = f.place(A, f.add(f.times(k, a), j))
            f.b.store(f.b.fmul(f.b.load(here), pivot), here)
        with f.over(m) as i, f.b.if_then(f.b.icmp_signed("!=", i, k)):
            factor = f.at(A, f.add(f.times(i, a), k))
            for M, start, count, stride in ((A, f.add(k, 1), m, a), (B, 0, columns, b)):
                with f.over(count, start) as j:
                    here = f.place(M, f.add(f.times(i, stride), j))
                    f.b.store(f.minus(f.b.load(here), factor, f.at(M, f.add(f.times(k, stride), j))), here)
    f.b.ret_void()
    return f.function


def _cholesky(module: ir.Module) -> Value:
    """cholesky(S, m): the lower half of S (m, m) becomes L with S = LLᵀ; not finite where S is not positive."""
    f = Loops(module, "cholesky", VOID, NUMBERS, INT64)
    S, m = f.args
    root = module.declare_intrinsic("llvm.sqrt", [DOUBLE])
    total = f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(m) as i, f.over(f.add(i, 1)) as j:
        f.b.store(f.at(S, f.add(f.times(i, m), j)), total)
        with f.over(j) as k:
            pair = (f.at(S, f.add(f.times(r, m), k)) for r in (i, j))
            f.b.store(f.minus(f.b.load(total), *pair), total)
        here, value = f.place(S, f.add(f.times(i, m), j)), f.b.load(total)
        with f.b.if_else(f.b.icmp_signed("==", i, j)) as (same, other):
            with same:
                f.b.store(f.b.call(root, [value]), here)
            with other:
                f.b.store(f.b.fdiv(value, f.at(S, f.add(f.times(j, m), j))), here)
    f.b.ret_void()
    return f.function


def _cholesky_solve(module: ir.Module) -> Value:
    """cholesky_solve(L, B, m, columns, back): B (m, columns) ← L⁻¹B, or L⁻ᵀL⁻¹B where back is not 0."""
    f = Loops(module, "cholesky_solve", VOID, NUMBERS, NUMBERS, *[INT64] * 3)
    L, B, m, columns, back = f.args

    def eliminate(i: object, k: ir.Value, entry: ir.Value) -> None:
        with f.over(columns) as j:
            here = f.place(B, f.add(f.times(i, columns), j))
            f.b.store(f.minus(f.b.load(here), entry, f.at(B, f.add(f.times(k, columns), j))), here)

    def divide(i: object) -> None:
        by = f.at(L, f.add(f.times(i, m), i))
        with f.over(columns) as j:
            here = f.place(B, f.add(f.times(i, columns), j))
            f.b.store(f.b.fdiv(f.b.load(here), by), here)

    with f.over(m) as i:
        with f.over(i) as k:
            eliminate(i, k, f.at(L, f.add(f.times(i, m), k)))
        divide(i)
    with f.b.if_then(f.b.icmp_signed("!=", back, INT64(0))), f.over(m) as count:
        i = f.b.sub(f.b.sub(m, INT64(1)), count)
        with f.over(m, f.add(i, 1)) as k:
            eliminate(i, k, f.at(L, f.add(f.times(k, m), i)))
        divide(i)
    f.b.ret_void()
    return f.function
