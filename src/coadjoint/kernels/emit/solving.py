"""The values of an increment: by the closed form where it is safe, with pivots where it is not."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from coadjoint.kernels.emit.emitter import Emitter, Value
from coadjoint.kernels.emit.gauss import solved_lanes
from coadjoint.kernels.newton.increments import Increment


def increment_values(emit: Emitter, increment: Increment, wary: Value = None) -> list[Any]:
    """δ, by the closed form where it is safe and with pivots otherwise.

    wary: the lanes whose last pivots must be sound, too, after others; none by default.
    """
    b = emit.builder
    delta = emit.values(increment.delta)
    if increment.always_safe:
        return delta
    (safe,) = emit.values([increment.safe])
    watched = wary is not None and not increment.last.is_constant(True)
    doubtful = b.not_(safe)
    if watched:
        doubtful = b.or_(doubtful, wary)
    before, careful, on = b.block, b.append_basic_block("pivot"), b.append_basic_block("increment")
    b.cbranch(emit.any(doubtful), careful, on).set_weights([1, 1 << 20])
    b.position_at_end(careful)
    with emit.scope():
        if watched:
            (last,) = emit.values([increment.last])
            safe = b.and_(safe, b.or_(last, b.not_(wary)))
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
    emit: Emitter, matrix: dict[int, Any], right: list[ir.Value], safe: Value, delta: list[ir.Value]
) -> list[Any]:
    """The unsafe lanes by elimination with partial pivoting, one after the other.

    matrix: the nonzero entries, by their places in the rows end to end.
    """
    b, width = emit.builder, emit.width
    results = list(delta)
    for lane, solved in enumerate(solved_lanes(emit, matrix, right)):
        if width == 1:
            return [b.select(safe, quick, slow) for quick, slow in zip(delta, solved, strict=True)]
        place = ir.IntType(32)(lane)
        here = b.extract_element(safe, place)
        results = [
            b.insert_element(r, b.select(here, b.extract_element(r, place), v), place)
            for r, v in zip(results, solved, strict=True)
        ]
    return results
