"""An extended Kalman filter as LLVM code: predictions and corrections of one filter, from a list of orders.

It knows rows of numbers, errors and functions of them by their addresses, and no groups.
"""

from __future__ import annotations

from llvmlite import ir

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit.dense import VOID, DenseAlgebra, dense
from coadjoint.kernels.emit.emitter import Value
from coadjoint.kernels.emit.loops import DOUBLE, INT64, INTEGERS, NUMBERS, Loops

NAME = "filter"
PREDICT, SET, CORRECT, SAVE = range(4)
"""Orders, four integers each: (PREDICT, place of h in the data, 0, 0), (SET, first input, count, place in the
data), (CORRECT, measurement, place in the data, place of (NIS, used) in the output), (SAVE, place of the row in the
output, of P, whether all of P is kept)."""
FIELDS = (
    *("errors", "size", "state", "unknowns", "noises", "drifting", "implicit", "parts", "between", "course"),
    *("row", "P", "parameters", "places", "step", "tangent", "after", "x", "y", "value", "J", "fractions"),
    *("densities", "Phi", "chain", "turned", "W", "step_scratch", "status", "retract", "carry", "moved"),
    *("input_places", "measurements", "sizes", "counts", "covariances", "gates", "losses"),
    *("limits", "actions", "rejected", "seen"),
    *("nu", "H", "HP", "A", "S", "K", "KR", "e", "zeros", "projector"),
)
"""The memory of a filter: sizes and addresses, all integers."""

INFLATE, RESET, STOP = 1, 2, 3
"""What is done with a value beyond the gate, after several in a row: P grows by NIS/m, the gain is that of R/SURE, the
filter fails."""
SURE = 1e9

TRIPS, TINY = 30, 1e-300
"""Iterations of the weight of a robust measurement, and the least square distance in it."""

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

    def integer(self, name: str) -> Value:
        return self._f.at(self._memory, FIELDS.index(name))

    def numbers(self, name: str) -> Value:
        return self._f.b.inttoptr(self.integer(name), NUMBERS)

    def integers(self, name: str) -> Value:
        return self._f.b.inttoptr(self.integer(name), INTEGERS)

    def call(self, name: str, kind: Value, arguments: list[Value]) -> None:
        self._f.b.call(self._f.b.inttoptr(self.integer(name), kind), arguments)


def _when(f: Loops, order: Value, number: int) -> Value:
    return f.b.if_then(f.b.icmp_signed("==", order, INT64(number)))


def _save(f: Loops, m: _Memory, algebra: DenseAlgebra, output: Value, rest: list[Value]) -> None:
    n, P, there = m.integer("errors"), m.numbers("P"), f.place(output, rest[1])
    f.b.call(algebra.copy, [f.place(output, rest[0]), m.numbers("row"), m.integer("size")])
    with f.b.if_else(f.b.icmp_signed("!=", rest[2], INT64(0))) as (full, diagonal):
        with full:
            f.b.call(algebra.copy, [there, P, f.times(n, n)])
        with diagonal, f.over(n) as i:
            f.put(there, i, f.at(P, f.times(i, f.add(n, 1))))


def _predict(module: ir.Module, algebra: DenseAlgebra) -> Value:
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


def _implicit(f: Loops, m: _Memory, algebra: DenseAlgebra, h: Value) -> None:
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


def _linearise(f: Loops, m: _Memory, algebra: DenseAlgebra, h: Value, part: Value) -> None:
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


def _chain(f: Loops, m: _Memory, algebra: DenseAlgebra, first: Value, last: Value) -> None:
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


def _carry(f: Loops, m: _Memory, algebra: DenseAlgebra, h: Value) -> None:
    """P ← ΦPΦᵀ + G S²h Gᵀ + diag q."""
    u, n, w, k = (m.integer(name) for name in ("unknowns", "errors", "noises", "drifting"))
    between = m.integer("between")
    J, Phi, P, stride = *(m.numbers(name) for name in ("J", "Phi", "P")), f.add(u, between, w)
    _sandwich(f, m, algebra, Phi)
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


def _sandwich(f: Loops, m: _Memory, algebra: DenseAlgebra, T: Value) -> None:
    """P ← T P Tᵀ, not symmetric to round-off."""
    n, one = m.integer("errors"), DOUBLE(1.0)
    turned, W, P = (m.numbers(name) for name in ("turned", "W", "P"))
    _clear(f, W, f.times(n, n))
    f.b.call(algebra.product, [W, T, P, n, n, n, n, n, n, one])
    _clear(f, P, f.times(n, n))
    # W is full and Tᵀ is not: the product is taken transposed, T Wᵀ, of which P is the transpose.
    f.b.call(algebra.transpose, [turned, W, n, n, n])
    f.b.call(algebra.product, [P, T, turned, n, n, n, n, n, n, one])


def _clear(f: Loops, array: Value, count: Value) -> None:
    with f.over(count) as i:
        f.put(array, i, DOUBLE(0.0))


def _symmetric(f: Loops, P: Value, n: Value) -> None:
    with f.over(n) as i, f.over(i) as j:
        one, other = f.place(P, f.add(f.times(i, n), j)), f.place(P, f.add(f.times(j, n), i))
        mean = f.b.fmul(DOUBLE(0.5), f.b.fadd(f.b.load(one), f.b.load(other)))
        f.b.store(mean, one)
        f.b.store(mean, other)


def _not_finite(f: Loops, m: _Memory) -> Value:
    """Whether the trace of P is not finite, or a step of the model failed."""
    n, P, total = m.integer("errors"), m.numbers("P"), f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(n) as i:
        f.b.store(f.b.fadd(f.b.load(total), f.at(P, f.times(i, f.add(n, 1)))), total)
    trace = f.b.load(total)
    wrong = f.b.fcmp_unordered("!=", f.b.fsub(trace, trace), DOUBLE(0.0))
    return f.b.or_(wrong, f.b.icmp_signed("!=", f.at(m.integers("status"), 1), INT64(0)))


def _correct(module: ir.Module, algebra: DenseAlgebra) -> Value:
    """correct(memory, measurement, values, output): 0, or a code of the failure; output: NIS, and 1 where it was
    used."""
    f = Loops(module, "correct", INT64, INTEGERS, INT64, NUMBERS, NUMBERS)
    memory, measurement, values, output = f.args
    m = _Memory(f, memory)
    size = f.at(m.integers("sizes"), measurement)
    R = f.b.inttoptr(f.at(m.integers("covariances"), measurement), NUMBERS)
    total, one = _innovation(f, m, measurement, values), DOUBLE(1.0)
    f.put(output, 0, DOUBLE(float("nan")))
    f.put(output, 1, DOUBLE(0.0))
    with f.b.if_then(f.b.fcmp_unordered("!=", total, DOUBLE(0.0))):
        f.b.ret(INT64(0))
    _spread(f, m, algebra, size)
    _whitened(f, m, algebra, size, R, one)
    e, nis = m.numbers("e"), f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(size) as i:
        f.b.store(f.plus(f.b.load(nis), f.at(e, i), f.at(e, i)), nis)
    f.put(output, 0, f.b.load(nis))
    action = _action(f, m, measurement, f.b.load(nis))
    with f.b.if_then(f.b.icmp_signed("<", action, INT64(0))):
        f.b.ret(INT64(0))
    with f.b.if_then(f.b.icmp_signed("==", action, INT64(STOP))):
        f.b.ret(INT64(1))
    recovers = f.b.icmp_signed(">", action, INT64(0))
    f.put(output, 1, f.b.select(recovers, DOUBLE(2.0), one))
    with f.b.if_then(f.b.icmp_signed("==", action, INT64(INFLATE))):
        factor = f.b.fdiv(f.b.load(nis), f.b.sitofp(size, DOUBLE))
        n = m.integer("errors")
        for name, count in (("P", f.times(n, n)), ("HP", f.times(size, n)), ("A", f.times(size, size))):
            with f.over(count) as i:
                f.put(m.numbers(name), i, f.b.fmul(f.at(m.numbers(name), i), factor))
        _whitened(f, m, algebra, size, R, one)
    weight = _weight(f, m, algebra, measurement, size, R)
    with f.b.if_then(f.b.icmp_signed("==", action, INT64(RESET))):
        _whitened(f, m, algebra, size, R, DOUBLE(SURE))
    _apply(f, m, algebra, size, R, weight)
    with f.b.if_then(f.b.icmp_signed("!=", m.integer("projector"), INT64(0))):
        _project(f, m, algebra)
    f.b.ret(f.b.zext(_not_finite(f, m), INT64))
    return f.function


def _action(f: Loops, m: _Memory, measurement: Value, nis: Value) -> Value:
    """0 for a value within the gate, −1 for one beyond it, which is left out, or the action that it asks for."""
    counts, place = m.integers("rejected"), f.variable(INT64, INT64(0))
    beyond = f.b.fcmp_ordered(">", nis, f.at(m.numbers("gates"), measurement))
    with f.b.if_else(beyond) as (rejected, accepted):
        with accepted:
            f.put(counts, measurement, INT64(0))
        with rejected:
            count = f.add(f.at(counts, measurement), 1)
            action, limit = (f.at(m.integers(name), measurement) for name in ("actions", "limits"))
            acts = f.b.and_(f.b.icmp_signed(">", action, INT64(0)), f.b.icmp_signed(">=", count, limit))
            f.b.store(f.b.select(acts, action, INT64(-1)), place)
            starts = f.b.and_(acts, f.b.icmp_signed("!=", action, INT64(STOP)))
            f.put(counts, measurement, f.b.select(starts, INT64(0), count))
    return f.b.load(place)


def _innovation(f: Loops, m: _Memory, measurement: Value, values: Value) -> Value:
    """ν and H of a measurement; returns 0, or NaN where a number is not finite."""
    n, width = m.integer("errors"), m.integer("size")
    size, count = (f.at(m.integers(name), measurement) for name in ("sizes", "counts"))
    nu, H, seen = m.numbers("nu"), m.numbers("H"), m.numbers("seen")
    function = f.b.inttoptr(f.at(m.integers("measurements"), measurement), _FUNCTION)
    total = f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(width) as i:
        f.put(seen, i, f.at(m.numbers("row"), i))
    with f.over(count) as i:
        value = f.at(values, i)
        f.put(seen, f.add(width, i), value)
        f.b.store(f.b.fadd(f.b.load(total), f.b.fsub(value, value)), total)
    # A function does not write entries that are always 0.
    _clear(f, H, f.times(size, n))
    f.b.call(function, [m.numbers("zeros"), seen, nu, H, INT64(1)])
    with f.over(size) as i:
        difference = f.b.fneg(f.at(nu, i))
        f.put(nu, i, difference)
        f.b.store(f.b.fadd(f.b.load(total), f.b.fsub(difference, difference)), total)
    return f.b.load(total)


def _spread(f: Loops, m: _Memory, algebra: DenseAlgebra, size: Value) -> None:
    """HP and A = HPHᵀ."""
    n, H, HP, A, turned = m.integer("errors"), *(m.numbers(k) for k in ("H", "HP", "A", "turned"))
    one = DOUBLE(1.0)
    _clear(f, HP, f.times(size, n))
    f.b.call(algebra.product, [HP, H, m.numbers("P"), size, n, n, n, n, n, one])
    _clear(f, A, f.times(size, size))
    f.b.call(algebra.transpose, [turned, H, size, n, n])
    f.b.call(algebra.product, [A, HP, turned, size, n, size, size, n, size, one])


def _whitened(f: Loops, m: _Memory, algebra: DenseAlgebra, size: Value, R: Value, weight: Value) -> None:
    """The root of S = A + R/w, and e = root⁻¹ν."""
    S, A, e = m.numbers("S"), m.numbers("A"), m.numbers("e")
    with f.over(f.times(size, size)) as i:
        f.put(S, i, f.b.fadd(f.at(A, i), f.b.fdiv(f.at(R, i), weight)))
    f.b.call(algebra.cholesky, [S, size])
    f.b.call(algebra.copy, [e, m.numbers("nu"), size])
    f.b.call(algebra.cholesky_solve, [S, e, size, INT64(1), INT64(0)])


def _weight(f: Loops, m: _Memory, algebra: DenseAlgebra, measurement: Value, size: Value, R: Value) -> Value:
    """w of the loss, 1 without one, with S = A + R/w: `estimation.engines.robust`."""
    place, one = f.times(measurement, 3), DOUBLE(1.0)
    a, b, kind = (f.at(m.numbers("losses"), f.add(place, i)) for i in range(3))
    weight, z = f.variable(DOUBLE, one), m.numbers("K")
    root = f.function.module.declare_intrinsic("llvm.sqrt", [DOUBLE])
    with f.b.if_then(f.b.fcmp_ordered(">=", kind, DOUBLE(0.0))):
        with f.over(TRIPS):
            _whitened(f, m, algebra, size, R, f.b.load(weight))
            f.b.call(algebra.copy, [z, m.numbers("nu"), size])
            f.b.call(algebra.cholesky_solve, [m.numbers("S"), z, size, INT64(1), INT64(1)])
            square = f.variable(DOUBLE, DOUBLE(0.0))
            with f.over(size) as i, f.over(size) as j:
                term = f.b.fmul(f.at(z, i), f.at(R, f.add(f.times(i, size), j)))
                f.b.store(f.plus(f.b.load(square), term, f.at(z, j)), square)
            w = f.b.load(weight)
            distance = f.b.fdiv(f.b.load(square), f.b.fmul(w, w))
            student = f.b.fdiv(a, f.b.fadd(b, distance))
            some = f.b.select(f.b.fcmp_ordered(">", distance, DOUBLE(TINY)), distance, DOUBLE(TINY))
            huber = f.b.fdiv(a, f.b.call(root, [some]))
            huber = f.b.select(f.b.fcmp_ordered("<", huber, one), huber, one)
            f.b.store(f.b.select(f.b.fcmp_ordered(">", kind, DOUBLE(0.0)), student, huber), weight)
        _whitened(f, m, algebra, size, R, f.b.load(weight))
    return f.b.load(weight)


def _apply(f: Loops, m: _Memory, algebra: DenseAlgebra, size: Value, R: Value, weight: Value) -> None:
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
    f.b.call(algebra.product, [KR, K, R, n, size, size, size, size, size, f.b.fdiv(minus, weight)])
    f.b.call(algebra.product, [P, KR, rows, n, size, n, n, size, n, minus])
    e = m.numbers("e")
    _clear(f, e, n)
    f.b.call(algebra.product, [e, K, m.numbers("nu"), n, size, INT64(1), INT64(1), size, INT64(1), one])
    moved, width, row = m.numbers("moved"), m.integer("size"), m.numbers("row")
    f.b.call(algebra.copy, [moved, row, width])
    f.b.call(algebra.copy, [f.place(moved, width), e, n])
    zeros = m.numbers("zeros")
    m.call("retract", _FUNCTION, [zeros, moved, row, zeros, INT64(1)])
    # P is of errors about the row before: T P Tᵀ is of those about the row after.
    T, square = m.numbers("Phi"), f.times(n, n)
    f.b.call(algebra.copy, [f.place(moved, width), row, width])
    _clear(f, T, square)
    m.call("carry", _FUNCTION, [e, moved, m.numbers("KR"), T, INT64(1)])
    _sandwich(f, m, algebra, T)
    _symmetric(f, P, n)


def _project(f: Loops, m: _Memory, algebra: DenseAlgebra) -> None:
    """P ← ΠPΠᵀ at the row, with the tangent space of constraints."""
    n, Pi = m.integer("errors"), m.numbers("Phi")
    _clear(f, Pi, f.times(n, n))
    m.call("projector", _FUNCTION, [m.numbers("zeros"), m.numbers("row"), m.numbers("value"), Pi, INT64(1)])
    _sandwich(f, m, algebra, Pi)
    _symmetric(f, m.numbers("P"), n)
