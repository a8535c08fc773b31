"""The values of an increment: by the closed form where it is safe, with pivots where it is not."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from coadjoint.kernels.emit.emitter import DOUBLE, INT64, Emitter
from coadjoint.kernels.emit.gauss import gauss
from coadjoint.kernels.newton.increments import Increment

BYTES = ir.IntType(8).as_pointer()


def increment_values(emit: Emitter, increment: Increment) -> list[Any]:
    """δ, by the closed form where it is safe and with pivots otherwise."""
    b = emit.builder
    delta = emit.values(increment.delta)
    if increment.always_safe:
        return delta
    (safe,) = emit.values([increment.safe])
    before, careful, on = b.block, b.append_basic_block("pivot"), b.append_basic_block("increment")
    unsafe = emit.any(b.xor(safe, emit.bit(True)))
    b.cbranch(unsafe, careful, on).set_weights([1, 1 << 20])
    b.position_at_end(careful)
    with emit.scope():
        entries = [x for row in increment.jacobian for x in row]
        places = [i for i, x in enumerate(entries) if not x.is_constant(0.0)]
        matrix = dict(zip(places, emit.values(entries[i] for i in places), strict=True))
        pivoted = _pivoted(emit, matrix, emit.values(increment.right), safe, delta)
    careful = b.block
    b.branch(on)
    b.position_at_end(on)
    joined = []
    for quick, slow in zip(delta, pivoted, strict=True):
        phi = b.phi(emit.number)
        phi.add_incoming(quick, before)
        phi.add_incoming(slow, careful)
        joined.append(phi)
    return joined


def _pivoted(
    emit: Emitter, matrix: dict[int, Any], right: list[ir.Value], safe: ir.Value, delta: list[ir.Value]
) -> list[Any]:
    """The unsafe lanes by elimination with partial pivoting, one after the other.

    matrix: the nonzero entries, by their places in the rows end to end.
    """
    b, n, width = emit.builder, len(right), emit.width
    function, cleared = gauss(emit.module), emit.module.declare_intrinsic("llvm.memset", [BYTES, INT64])
    with b.goto_entry_block():
        a = b.alloca(DOUBLE, n * n)
        x = b.alloca(DOUBLE, n)
    results = list(delta)
    for lane in range(width):
        pick = (lambda v: v) if width == 1 else (lambda v, k=lane: b.extract_element(v, ir.IntType(32)(k)))
        b.call(cleared, [b.bitcast(a, BYTES), ir.IntType(8)(0), INT64(8 * n * n), ir.IntType(1)(0)])
        for place, values in ((a, matrix), (x, dict(enumerate(right)))):
            for i, value in values.items():
                b.store(pick(value), b.gep(place, [INT64(i)]))
        b.call(function, [a, x, INT64(n)])
        solved = [b.load(b.gep(x, [INT64(i)])) for i in range(n)]
        if width == 1:
            return solved
        here = pick(safe)
        place = ir.IntType(32)(lane)
        results = [b.insert_element(r, b.select(here, pick(r), v), place) for r, v in zip(results, solved, strict=True)]
    return results
