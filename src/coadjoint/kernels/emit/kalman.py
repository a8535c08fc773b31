"""An extended Kalman filter as LLVM code: predictions and corrections of one filter, from a list of orders.

It knows rows of numbers, errors and functions of them by their addresses, and no groups.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit.dense import VOID, DenseAlgebra, dense
from coadjoint.kernels.emit.loops import DOUBLE, INT64, INTEGERS, NUMBERS, Loops

NAME = "filter"
PREDICT, SET, CORRECT, SAVE = range(4)
"""Orders, four integers each: (PREDICT, place of h in the data, 0, 0), (SET, first input, count, place in the
data), (CORRECT, measurement, place in the data, place of (NIS, used) in the output), (SAVE, place of the row in the
output, of P, whether all of P is kept)."""
FIELDS = (
    *("errors", "size", "state", "unknowns", "noises", "drifting", "implicit", "parts", "between", "course"),
    *("row", "P", "parameters", "places", "step", "tangent", "after", "x", "y", "value", "J", "fractions"),
    *("densities", "Phi", "chain", "turned", "W", "step_scratch", "status", "retract", "moved", "input_places"),
    *("measurements", "sizes", "covariances", "gates", "turns", "nu", "H", "HP", "S", "K", "KR", "e", "zeros"),
    "projector",
)
"""The memory of a filter: sizes and addresses, all integers."""

_FUNCTION = ir.FunctionType(VOID, [*[NUMBERS] * 4, INT64]).as_pointer()
_KERNEL = ir.FunctionType(VOID, [*[NUMBERS] * 3, INT64, INT64, *[NUMBERS] * 3, INTEGERS]).as_pointer()


def assemble() -> str:
    """int64 filter(memory, orders, count, data, output): −1, or the number of the order that failed."""
    module = ir.Module(name="coadjoint")
    algebra = dense(module)
    predict, correct = _predict(module, algebra), _correct(module, algebra)
    f = Loops(module, NAME, INT64, INTEGERS, INTEGERS, INT64, NUMBERS, NUMBERS, inside=False)
    memory, orders, count, data, output = f.args
    m = _Memory(f, memory)
    failed = f.variable(INT64, INT64(0))
    with f.over(count) as i:
        first = f.times(i, 4)
        order, *rest = (f.at(orders, f.add(first, k)) for k in range(4))
        with _when(f, order, PREDICT):
            f.b.store(f.b.call(predict, [memory, f.at(data, rest[0])]), failed)
        with _when(f, order, SET):
            row, places = m.numbers("row"), m.integers("input_places")
            with f.over(rest[1]) as k:
                f.put(row, f.at(places, f.add(rest[0], k)), f.at(data, f.add(rest[2], k)))
        with _when(f, order, CORRECT):
            given = [memory, rest[0], f.place(data, rest[1]), f.place(output, rest[2])]
            f.b.store(f.b.call(correct, given), failed)
        with _when(f, order, SAVE):
            _save(f, m, algebra, output, rest)
        with f.b.if_then(f.b.icmp_signed("!=", f.b.load(failed), INT64(0))):
            f.b.ret(i)
    f.b.ret(INT64(-1))
    return str(module)


class _Memory:
    def __init__(self, f: Loops, memory: PyTree):
        self._f, self._memory = f, memory

    def integer(self, name: str) -> Any:
        return self._f.at(self._memory, FIELDS.index(name))

    def numbers(self, name: str) -> Any:
        return self._f.b.inttoptr(self.integer(name), NUMBERS)

    def integers(self, name: str) -> Any:
        return self._f.b.inttoptr(self.integer(name), INTEGERS)

    def call(self, name: str, kind: Any, arguments: list[Any]) -> None:
        self._f.b.call(self._f.b.inttoptr(self.integer(name), kind), arguments)


def _when(f: Loops, order: Any, number: int) -> Any:
    return f.b.if_then(f.b.icmp_signed("==", order, INT64(number)))


def _save(f: Loops, m: _Memory, algebra: DenseAlgebra, output: Any, rest: list[Any]) -> None:
    n, P, there = m.integer("errors"), m.numbers("P"), f.place(output, rest[1])
    f.b.call(algebra.copy, [f.place(output, rest[0]), m.numbers("row"), m.integer("size")])
    with f.b.if_else(f.b.icmp_signed("!=", rest[2], INT64(0))) as (full, diagonal):
        with full:
            f.b.call(algebra.copy, [there, P, f.times(n, n)])
        with diagonal, f.over(n) as i:
            f.put(there, i, f.at(P, f.times(i, f.add(n, 1))))


def _predict(module: ir.Module, algebra: DenseAlgebra) -> Any:
    """predict(memory, h): 0, or a code of the failure."""
    f = Loops(module, "predict", INT64, INTEGERS, DOUBLE)
    memory, h = f.args
    m = _Memory(f, memory)
    size, row, after, y = m.integer("size"), m.numbers("row"), m.numbers("after"), m.numbers("y")
    f.b.call(algebra.copy, [y, row, size])
    with f.b.if_else(f.b.icmp_signed("!=", m.integer("implicit"), INT64(0))) as (implicit, explicit):
        with implicit:
            _implicit(f, m, algebra, h)
        with explicit:
            # The step reads the row and h, which are adjacent here.
            f.b.call(algebra.copy, [after, row, size])
            f.put(after, size, h)
            zeros = m.numbers("zeros")
            m.call("step", _FUNCTION, [zeros, after, f.place(y, size), zeros, INT64(1)])
            f.b.call(algebra.copy, [after, f.place(y, size), size])
    with f.over(m.integer("parts")) as part:
        _linearise(f, m, algebra, h, part)
    _carry(f, m, algebra, h)
    at, k = f.add(m.integer("unknowns"), m.integer("between")), m.integer("drifting")
    f.b.call(algebra.copy, [row, after, size])
    f.b.call(algebra.copy, [f.place(row, m.integer("state")), f.place(m.numbers("value"), at), k])
    f.b.ret(f.b.zext(_not_finite(f, m), INT64))
    return f.function


def _implicit(f: Loops, m: _Memory, algebra: DenseAlgebra, h: Any) -> None:
    """One step of the model's own kernel, with the drifting parameters in their places."""
    row, after, state = m.numbers("row"), m.numbers("after"), m.integer("state")
    f.b.call(algebra.copy, [after, row, m.integer("size")])
    parameters, places = m.numbers("parameters"), m.integers("places")
    with f.over(m.integer("drifting")) as i:
        f.put(parameters, f.at(places, i), f.at(row, f.add(state, i)))
    length = f.variable(DOUBLE, h)
    scratch, status = m.numbers("step_scratch"), m.integers("status")
    with f.over(4) as i:
        f.put(status, i, INT64(0))
    m.call("step", _KERNEL, [parameters, length, after, INT64(1), INT64(1), scratch, scratch, scratch, status])


def _linearise(f: Loops, m: _Memory, algebra: DenseAlgebra, h: Any, part: Any) -> None:
    """The slopes of a part of the step, a substep of a composition, and Φ of all parts up to this one."""
    u, size, state, parts = (m.integer(name) for name in ("unknowns", "size", "state", "parts"))
    x, y = m.numbers("x"), m.numbers("y")
    place = f.add(m.integer("course"), f.times(part, f.add(u, state)))
    course = f.place(m.numbers("step_scratch"), place)
    last = f.b.icmp_signed("==", f.add(part, 1), parts)
    f.b.call(algebra.copy, [x, course, u])
    f.b.call(algebra.copy, [f.place(y, size), m.numbers("after"), size])
    with f.b.if_then(f.b.not_(last)):
        f.b.call(algebra.copy, [f.place(y, size), f.place(course, u), state])
    first = f.b.icmp_signed("==", part, INT64(0))
    flags = [f.b.uitofp(flag, DOUBLE) for flag in (first, last)]
    for i, value in enumerate([f.b.fmul(h, f.at(m.numbers("fractions"), part)), h, *flags]):
        f.put(y, f.add(size, size, i), value)
    m.call("tangent", _FUNCTION, [x, y, m.numbers("value"), m.numbers("J"), INT64(1)])
    _eliminate(f, m, algebra)
    with f.b.if_then(f.b.icmp_signed(">", parts, INT64(1))):
        _chain(f, m, algebra, first, last)
    f.b.call(algebra.copy, [y, f.place(y, size), size])


def _eliminate(f: Loops, m: _Memory, algebra: DenseAlgebra) -> None:
    """Φ = ∂e⁺/∂e of a part by the implicit function theorem."""
    u, n, w = (m.integer(name) for name in ("unknowns", "between", "noises"))
    J, Phi, stride = m.numbers("J"), m.numbers("Phi"), f.add(u, n, w)
    below = f.place(J, f.times(u, stride))
    # The slopes of the step keep their zeros: the solve works on a copy.
    kept = m.numbers("KR")
    f.b.call(algebra.copy, [kept, J, f.times(u, stride)])
    f.b.call(algebra.solve, [kept, f.place(kept, u), u, n, stride, stride])
    with f.over(n) as i:
        f.b.call(algebra.copy, [f.place(Phi, f.times(i, n)), f.place(below, f.add(f.times(i, stride), u)), n])
    f.b.call(algebra.product, [Phi, below, f.place(kept, u), n, u, n, n, stride, stride, DOUBLE(-1.0)])


def _chain(f: Loops, m: _Memory, algebra: DenseAlgebra, first: Any, last: Any) -> None:
    """The product of the Φ of all parts; of the last, Φ of the errors at both ends."""
    n, errors = m.integer("between"), m.integer("errors")
    Phi, chain, product, square = m.numbers("Phi"), m.numbers("chain"), m.numbers("W"), f.times(n, n)
    with f.b.if_else(first) as (begins, goes_on):
        with begins:
            f.b.call(algebra.copy, [chain, Phi, square])
        with goes_on:
            _clear(f, product, square)
            f.b.call(algebra.product, [product, Phi, chain, n, n, n, n, n, n, DOUBLE(1.0)])
            f.b.call(algebra.copy, [chain, product, square])
    with f.b.if_then(last), f.over(errors) as i:
        f.b.call(algebra.copy, [f.place(Phi, f.times(i, errors)), f.place(chain, f.times(i, n)), errors])


def _carry(f: Loops, m: _Memory, algebra: DenseAlgebra, h: Any) -> None:
    """P ← ΦPΦᵀ + G S²h Gᵀ + diag q."""
    u, n, w, k = (m.integer(name) for name in ("unknowns", "errors", "noises", "drifting"))
    between = m.integer("between")
    J, Phi, turned, W, P = (m.numbers(name) for name in ("J", "Phi", "turned", "W", "P"))
    stride, square, one = f.add(u, between, w), f.times(n, n), DOUBLE(1.0)
    f.b.call(algebra.transpose, [turned, Phi, n, n, n])
    _clear(f, W, square)
    f.b.call(algebra.product, [W, Phi, P, n, n, n, n, n, n, one])
    _clear(f, P, square)
    # W is full and Φᵀ is not: the product is taken transposed, Φ Wᵀ, of which P is the transpose.
    f.b.call(algebra.transpose, [turned, W, n, n, n])
    f.b.call(algebra.product, [P, Phi, turned, n, n, n, n, n, n, one])
    densities, G = m.numbers("densities"), f.place(J, f.add(f.times(u, stride), u, between))
    with f.over(w) as a:
        scale = f.b.fmul(f.at(densities, a), h)
        with f.over(n) as i:
            here = f.b.fmul(f.at(G, f.add(f.times(i, stride), a)), scale)
            with f.b.if_then(f.b.fcmp_unordered("!=", here, DOUBLE(0.0))), f.over(n) as j:
                place = f.place(P, f.add(f.times(i, n), j))
                f.b.store(f.plus(f.b.load(place), here, f.at(G, f.add(f.times(j, stride), a))), place)
    value, first, last = m.numbers("value"), f.add(u, between, k), f.b.sub(n, k)
    with f.over(k) as i:
        place = f.place(P, f.times(f.add(last, i), f.add(n, 1)))
        f.b.store(f.b.fadd(f.b.load(place), f.at(value, f.add(first, i))), place)
    _symmetric(f, P, n)


def _clear(f: Loops, array: Any, count: Any) -> None:
    with f.over(count) as i:
        f.put(array, i, DOUBLE(0.0))


def _symmetric(f: Loops, P: Any, n: Any) -> None:
    with f.over(n) as i, f.over(i) as j:
        one, other = f.place(P, f.add(f.times(i, n), j)), f.place(P, f.add(f.times(j, n), i))
        mean = f.b.fmul(DOUBLE(0.5), f.b.fadd(f.b.load(one), f.b.load(other)))
        f.b.store(mean, one)
        f.b.store(mean, other)


def _not_finite(f: Loops, m: _Memory) -> Any:
    """Whether the trace of P is not finite, or a step of the model failed."""
    n, P, total = m.integer("errors"), m.numbers("P"), f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(n) as i:
        f.b.store(f.b.fadd(f.b.load(total), f.at(P, f.times(i, f.add(n, 1)))), total)
    trace = f.b.load(total)
    wrong = f.b.fcmp_unordered("!=", f.b.fsub(trace, trace), DOUBLE(0.0))
    return f.b.or_(wrong, f.b.icmp_signed("!=", f.at(m.integers("status"), 1), INT64(0)))


def _correct(module: ir.Module, algebra: DenseAlgebra) -> Any:
    """correct(memory, measurement, values, output): 0, or a code of the failure; output: NIS, and 1 where it was
    used."""
    f = Loops(module, "correct", INT64, INTEGERS, INT64, NUMBERS, NUMBERS)
    memory, measurement, values, output = f.args
    m = _Memory(f, memory)
    n, size = m.integer("errors"), f.at(m.integers("sizes"), measurement)
    row, nu, H, S, R = *(m.numbers(k) for k in ("row", "nu", "H", "S")), f.at(m.integers("covariances"), measurement)
    function = f.b.inttoptr(f.at(m.integers("measurements"), measurement), _FUNCTION)
    turns = f.b.inttoptr(f.at(m.integers("turns"), measurement), NUMBERS)
    # A function does not write entries that are always 0.
    _clear(f, H, f.times(size, n))
    f.b.call(function, [m.numbers("zeros"), row, nu, H, INT64(1)])
    total = f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(size) as i:
        difference = _shorter(f, f.b.fsub(f.at(values, i), f.at(nu, i)), f.at(turns, i))
        f.put(nu, i, difference)
        f.b.store(f.b.fadd(f.b.load(total), f.b.fsub(difference, difference)), total)
    f.put(output, 0, DOUBLE(float("nan")))
    f.put(output, 1, DOUBLE(0.0))
    with f.b.if_then(f.b.fcmp_unordered("!=", f.b.load(total), DOUBLE(0.0))):
        f.b.ret(INT64(0))
    HP, one = m.numbers("HP"), DOUBLE(1.0)
    R = f.b.inttoptr(R, NUMBERS)
    _clear(f, HP, f.times(size, n))
    f.b.call(algebra.product, [HP, H, m.numbers("P"), size, n, n, n, n, n, one])
    f.b.call(algebra.copy, [S, R, f.times(size, size)])
    turned = m.numbers("turned")
    f.b.call(algebra.transpose, [turned, H, size, n, n])
    f.b.call(algebra.product, [S, HP, turned, size, n, size, size, n, size, one])
    f.b.call(algebra.cholesky, [S, size])
    e, nis = m.numbers("e"), f.variable(DOUBLE, DOUBLE(0.0))
    f.b.call(algebra.copy, [e, nu, size])
    f.b.call(algebra.cholesky_solve, [S, e, size, INT64(1), INT64(0)])
    with f.over(size) as i:
        f.b.store(f.plus(f.b.load(nis), f.at(e, i), f.at(e, i)), nis)
    f.put(output, 0, f.b.load(nis))
    gate = f.at(m.numbers("gates"), measurement)
    with f.b.if_then(f.b.fcmp_ordered(">", f.b.load(nis), gate)):
        f.b.ret(INT64(0))
    f.put(output, 1, one)
    _apply(f, m, algebra, size, R)
    with f.b.if_then(f.b.icmp_signed("!=", m.integer("projector"), INT64(0))):
        _project(f, m, algebra)
    f.b.ret(f.b.zext(_not_finite(f, m), INT64))
    return f.function


def _shorter(f: Loops, difference: Any, turn: Any) -> Any:
    """x − turn·⌊x/turn + ½⌋ where there is a turn, as 2π of an angle; x where turn is 0."""
    floor = f.function.module.declare_intrinsic("llvm.floor", [DOUBLE])
    some = f.b.fcmp_ordered("!=", turn, DOUBLE(0.0))
    parts = f.b.fdiv(difference, f.b.select(some, turn, DOUBLE(1.0)))
    turns = f.b.call(floor, [f.b.fadd(parts, DOUBLE(0.5))])
    return f.b.fsub(difference, f.b.fmul(turn, turns))


def _apply(f: Loops, m: _Memory, algebra: DenseAlgebra, size: Any, R: Any) -> None:
    """Joseph's form with W = P − K(HP): P ← W − (WHᵀ − KR)Kᵀ; then the row moves by Kν."""
    n, P, HP, S, K, KR, turned = (m.integer("errors"), *map(m.numbers, ("P", "HP", "S", "K", "KR", "turned")))
    one, minus = DOUBLE(1.0), DOUBLE(-1.0)
    rows = m.numbers("W")  # Kᵀ = S⁻¹HP
    f.b.call(algebra.copy, [rows, HP, f.times(size, n)])
    f.b.call(algebra.cholesky_solve, [S, rows, size, n, INT64(1)])
    f.b.call(algebra.transpose, [K, rows, size, n, n])
    f.b.call(algebra.product, [P, K, HP, n, size, n, n, size, n, minus])
    _clear(f, KR, f.times(n, size))
    f.b.call(algebra.product, [KR, P, turned, n, n, size, size, n, size, one])
    f.b.call(algebra.product, [KR, K, R, n, size, size, size, size, size, minus])
    f.b.call(algebra.product, [P, KR, rows, n, size, n, n, size, n, minus])
    _symmetric(f, P, n)
    e = m.numbers("e")
    _clear(f, e, n)
    f.b.call(algebra.product, [e, K, m.numbers("nu"), n, size, INT64(1), INT64(1), size, INT64(1), one])
    moved, width, row = m.numbers("moved"), m.integer("size"), m.numbers("row")
    f.b.call(algebra.copy, [moved, row, width])
    f.b.call(algebra.copy, [f.place(moved, width), e, n])
    zeros = m.numbers("zeros")
    m.call("retract", _FUNCTION, [zeros, moved, row, zeros, INT64(1)])


def _project(f: Loops, m: _Memory, algebra: DenseAlgebra) -> None:
    """P ← ΠPΠᵀ at the row, with the tangent space of constraints."""
    n, Pi, W, P, turned = (m.integer("errors"), *map(m.numbers, ("Phi", "W", "P", "turned")))
    square, one = f.times(n, n), DOUBLE(1.0)
    _clear(f, Pi, square)
    m.call("projector", _FUNCTION, [m.numbers("zeros"), m.numbers("row"), m.numbers("value"), Pi, INT64(1)])
    _clear(f, W, square)
    f.b.call(algebra.product, [W, Pi, P, n, n, n, n, n, n, one])
    f.b.call(algebra.transpose, [turned, Pi, n, n, n])
    _clear(f, P, square)
    f.b.call(algebra.product, [P, W, turned, n, n, n, n, n, n, one])
    _symmetric(f, P, n)
