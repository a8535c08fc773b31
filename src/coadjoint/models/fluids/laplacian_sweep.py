"""The inverse Laplacian of the sphere on matrices as machine code: one loop forward over all diagonals, one back."""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import ir

from coadjoint.kernels.emit.emitter import Value
from coadjoint.kernels.emit.loops import DOUBLE, INT64, NUMBERS, Loops
from coadjoint.kernels.emit.xla_call import xla_call

VOID = ir.VoidType()


def emit_sweep(module: ir.Module, name: str) -> None:
    """name(rows, lower, inverse, above) → (ψ by rows,), (N, N) each, the last three of `laplacian._factors`.

        x_i = r_i − l_i x_{i−1},   ψ_i = (x_i − a_i ψ_{i+1})/p_i,   of row i of all diagonals together

    r are the rows less their mean on the diagonal, and ψ has no mean.
    """
    f = Loops(module, f"{name}_loops", VOID, INT64, *[NUMBERS] * 5)
    n, rows, lower, inverse, above, psi = f.args
    with f.over(f.times(n, n)) as k:
        f.put(psi, k, f.at(rows, k))
    _without_mean(f, n, psi)
    last = f.b.alloca(DOUBLE, n)

    def forward(here: Value, k: Value, j: Value) -> Value:
        return f.minus(f.at(psi, here), f.at(lower, k), f.at(last, j))

    def back(here: Value, k: Value, j: Value) -> Value:
        return f.b.fmul(f.minus(f.at(psi, here), f.at(above, k), f.at(last, j)), f.at(inverse, k))

    for step in (forward, back):
        with f.over(n) as j:
            f.put(last, j, DOUBLE(0.0))
        with f.over(n) as count:
            i = count if step is forward else f.b.sub(f.b.sub(n, INT64(1)), count)
            _row(f, n, i, psi, last, step)
    _without_mean(f, n, psi)
    f.b.ret_void()
    xla_call(module, name, f.function, [NUMBERS] * 4, [NUMBERS])


def _row(f: Loops, n: Value, i: Value, psi: Value, last: Value, step: Callable[..., Value]) -> None:
    """Row i of the diagonals: number j, which follows last[j], is entry (i, (i + j) mod N) of ψ, in two stretches."""
    split, row = f.b.sub(n, i), f.times(i, n)
    for start, end, first in ((0, split, f.add(row, i)), (split, n, f.b.sub(row, split))):
        with f.over(end, start) as j:
            here = f.add(first, j)
            new = step(here, f.add(row, j), j)
            f.put(last, j, new)
            f.put(psi, here, new)


def _without_mean(f: Loops, n: Value, psi: Value) -> None:
    """Subtract the mean of the diagonal from it."""
    total, along = f.variable(DOUBLE, DOUBLE(0.0)), f.add(n, 1)
    with f.over(n) as i:
        f.b.store(f.b.fadd(f.b.load(total), f.at(psi, f.times(i, along))), total)
    mean = f.b.fdiv(f.b.load(total), f.b.sitofp(n, DOUBLE))
    with f.over(n) as i:
        here = f.place(psi, f.times(i, along))
        f.b.store(f.b.fsub(f.b.load(here), mean), here)
