"""The memory of a filter in LLVM code, and what predictions and corrections do alike with its P."""

from __future__ import annotations

from llvmlite import ir

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit.dense import VOID, DenseAlgebra
from coadjoint.kernels.emit.emitter import Value
from coadjoint.kernels.emit.loops import DOUBLE, INT64, INTEGERS, NUMBERS, Loops

FIELDS = (
    *("errors", "size", "state", "unknowns", "noises", "drifting", "implicit", "parts", "between", "course"),
    *("row", "P", "parameters", "places", "step", "tangent", "after", "x", "y", "value", "J", "fractions"),
    *("densities", "Phi", "chain", "turned", "W", "step_scratch", "status", "retract", "carry", "moved"),
    *("input_places", "measurements", "sizes", "counts", "covariances", "gates", "losses"),
    *("limits", "actions", "trips", "rejected", "seen"),
    *("nu", "H", "HP", "A", "S", "K", "KR", "e", "zeros", "projector"),
    *("effective", "shake", "started", "shaken", "acting"),
)
"""The memory of a filter: sizes and addresses, all integers."""

FUNCTION = ir.FunctionType(VOID, [*[NUMBERS] * 4, INT64]).as_pointer()
"""A function of the library: f(x, y, value, J, count)."""


class FilterAddresses:
    """The sizes and addresses in it, by their names."""

    def __init__(self, f: Loops, memory: PyTree):
        self._f, self._memory = f, memory

    def integer(self, name: str) -> Value:
        return self._f.at(self._memory, FIELDS.index(name))

    def numbers(self, name: str) -> Value:
        return self._f.b.inttoptr(self.integer(name), NUMBERS)

    def integers(self, name: str) -> Value:
        return self._f.b.inttoptr(self.integer(name), INTEGERS)

    def call(self, name: str, kind: Value, arguments: list[Value]) -> None:
        self._f.b.call(self._f.b.inttoptr(self.integer(name), kind), arguments)


def sandwich(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, T: Value, product: Value, among: Value) -> None:
    """P ← T P Tᵀ, not symmetric to round-off; product: of T, which has few zeros or many.

    The last rows of T, of the drifting numbers, are diagonal; among: the columns that its other rows have.
    """
    n, k, one = m.integer("errors"), m.integer("drifting"), DOUBLE(1.0)
    turned, W, P = (m.numbers(name) for name in ("turned", "W", "P"))
    moving = f.b.sub(n, k)
    clear(f, W, f.times(moving, n))
    f.b.call(product, [W, T, P, moving, among, n, n, n, n, one])
    # W is full and Tᵀ is not: the product is taken transposed, T Wᵀ, of which P is the transpose.
    f.b.call(algebra.transpose, [turned, W, moving, among, n])
    with f.over(moving) as i:
        clear(f, f.place(P, f.times(i, n)), moving)
    f.b.call(product, [P, T, turned, moving, among, moving, n, n, moving, one])
    with f.over(n, moving) as j:
        own = f.at(T, f.times(j, f.add(n, 1)))
        with f.over(moving) as i:
            value = f.b.fmul(f.at(W, f.add(f.times(i, n), j)), own)
            f.put(P, f.add(f.times(i, n), j), value)
            f.put(P, f.add(f.times(j, n), i), value)
        with f.over(n, moving) as i:
            here = f.place(P, f.add(f.times(j, n), i))
            other = f.at(T, f.times(i, f.add(n, 1)))
            f.b.store(f.b.fmul(f.b.load(here), f.b.fmul(own, other)), here)


def clear(f: Loops, array: Value, count: Value) -> None:
    with f.over(count) as i:
        f.put(array, i, DOUBLE(0.0))


def symmetric(f: Loops, P: Value, n: Value, count: Value) -> None:
    """The first rows and columns of P (n, n) as their mean with the transpose."""
    with f.over(count) as i, f.over(i) as j:
        one, other = f.place(P, f.add(f.times(i, n), j)), f.place(P, f.add(f.times(j, n), i))
        mean = f.b.fmul(DOUBLE(0.5), f.b.fadd(f.b.load(one), f.b.load(other)))
        f.b.store(mean, one)
        f.b.store(mean, other)


def not_finite(f: Loops, m: FilterAddresses) -> Value:
    """Whether the trace of P is not finite, or a step of the model failed."""
    n, P, total = m.integer("errors"), m.numbers("P"), f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(n) as i:
        f.b.store(f.b.fadd(f.b.load(total), f.at(P, f.times(i, f.add(n, 1)))), total)
    trace = f.b.load(total)
    wrong = f.b.fcmp_unordered("!=", f.b.fsub(trace, trace), DOUBLE(0.0))
    return f.b.or_(wrong, f.b.icmp_signed("!=", f.at(m.integers("status"), 1), INT64(0)))
