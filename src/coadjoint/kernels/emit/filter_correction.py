"""The correction of an extended Kalman filter as LLVM code: gate, robust weight, gain and Joseph's form."""

from __future__ import annotations

from llvmlite import ir

from coadjoint.kernels.emit.dense import DenseAlgebra
from coadjoint.kernels.emit.emitter import Value
from coadjoint.kernels.emit.filter_memory import FUNCTION, FilterAddresses, clear, not_finite, sandwich, symmetric
from coadjoint.kernels.emit.loops import DOUBLE, INT64, INTEGERS, NUMBERS, Loops

INFLATE, RESET, STOP = 1, 2, 3
"""What is done with a value beyond the gate, after several in a row: P grows by NIS/m, the gain is that of R/SURE, the
filter fails."""
SURE = 1e9

TRIPS, SETTLED, TINY = 60, 1e-14, 1e-300
"""Newton's steps of the weight of a robust measurement at most, the relative step that ends them, and the least square
distance in them."""


def correction(module: ir.Module, algebra: DenseAlgebra) -> Value:
    """correct(memory, measurement, values, output): 0, or a code of the failure; output: NIS, and 1 where it was
    used."""
    f = Loops(module, "correct", INT64, INTEGERS, INT64, NUMBERS, NUMBERS)
    memory, measurement, values, output = f.args
    m = FilterAddresses(f, memory)
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
    noise, R = R, f.b.inttoptr(f.at(m.integers("effective"), measurement), NUMBERS)
    f.put(output, 1, f.b.select(recovers, DOUBLE(2.0), one))
    with f.b.if_then(f.b.icmp_signed("==", action, INT64(INFLATE))):
        factor = f.b.fdiv(f.b.load(nis), f.b.sitofp(size, DOUBLE))
        n = m.integer("errors")
        for name, count in (("P", f.times(n, n)), ("HP", f.times(size, n)), ("A", f.times(size, size))):
            with f.over(count) as i:
                f.put(m.numbers(name), i, f.b.fmul(f.at(m.numbers(name), i), factor))
    changed = f.b.icmp_signed("!=", f.b.ptrtoint(R, INT64), f.b.ptrtoint(noise, INT64))
    with f.b.if_then(f.b.or_(changed, f.b.icmp_signed("==", action, INT64(INFLATE)))):
        _whitened(f, m, algebra, size, R, one)
    weight = f.variable(DOUBLE, one)

    def weigh() -> None:
        f.b.store(_weight(f, m, algebra, measurement, size, R), weight)
        with f.b.if_then(f.b.icmp_signed("==", action, INT64(RESET))):
            _whitened(f, m, algebra, size, R, DOUBLE(SURE))

    weigh()
    with f.over(f.at(m.integers("trips"), measurement), 1):
        _linearise(f, m, algebra, measurement, size)
        _whitened(f, m, algebra, size, R, one)
        weigh()
    _apply(f, m, algebra, size, R, f.b.load(weight))
    with f.b.if_then(f.b.icmp_signed("!=", m.integer("projector"), INT64(0))):
        _project(f, m, algebra)
    f.b.ret(f.b.zext(not_finite(f, m), INT64))
    return f.function


def _action(f: Loops, m: FilterAddresses, measurement: Value, nis: Value) -> Value:
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


def _innovation(f: Loops, m: FilterAddresses, measurement: Value, values: Value) -> Value:
    """ν and H of a measurement; returns 0, or NaN where a number is not finite."""
    n, width = m.integer("errors"), m.integer("size")
    size, count = (f.at(m.integers(name), measurement) for name in ("sizes", "counts"))
    nu, H, seen = m.numbers("nu"), m.numbers("H"), m.numbers("seen")
    function = f.b.inttoptr(f.at(m.integers("measurements"), measurement), FUNCTION)
    total = f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(width) as i:
        f.put(seen, i, f.at(m.numbers("row"), i))
    with f.over(count) as i:
        value = f.at(values, i)
        f.put(seen, f.add(width, i), value)
        f.b.store(f.b.fadd(f.b.load(total), f.b.fsub(value, value)), total)
    # A function does not write entries that are always 0.
    clear(f, H, f.times(size, n))
    f.b.call(function, [m.numbers("zeros"), seen, nu, H, INT64(1)])
    with f.over(size) as i:
        difference = f.b.fneg(f.at(nu, i))
        f.put(nu, i, difference)
        f.b.store(f.b.fadd(f.b.load(total), f.b.fsub(difference, difference)), total)
    return f.b.load(total)


def _linearise(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, measurement: Value, size: Value) -> None:
    """H at the error e = Kν that was found, and ν + He in the place of ν: a Gauss–Newton step from there."""
    n, one = m.integer("errors"), DOUBLE(1.0)
    nu, H, HP, e, z = (m.numbers(name) for name in ("nu", "H", "HP", "W", "K"))
    f.b.call(algebra.copy, [z, nu, size])
    f.b.call(algebra.cholesky_solve, [m.numbers("S"), z, size, INT64(1), INT64(1)])
    clear(f, e, n)
    f.b.call(algebra.product, [e, z, HP, INT64(1), size, n, n, size, n, one])
    clear(f, H, f.times(size, n))
    function = f.b.inttoptr(f.at(m.integers("measurements"), measurement), FUNCTION)
    f.b.call(function, [e, m.numbers("seen"), nu, H, INT64(1)])
    with f.over(size) as i:
        f.put(nu, i, f.b.fneg(f.at(nu, i)))
    f.b.call(algebra.product, [nu, H, e, size, n, INT64(1), INT64(1), n, INT64(1), one])
    _spread(f, m, algebra, size)


def _spread(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, size: Value) -> None:
    """HP and A = HPHᵀ."""
    n, H, HP, A, turned = m.integer("errors"), *(m.numbers(k) for k in ("H", "HP", "A", "turned"))
    one = DOUBLE(1.0)
    clear(f, HP, f.times(size, n))
    f.b.call(algebra.product, [HP, H, m.numbers("P"), size, n, n, n, n, n, one])
    clear(f, A, f.times(size, size))
    f.b.call(algebra.transpose, [turned, H, size, n, n])
    f.b.call(algebra.product, [A, HP, turned, size, n, size, size, n, size, one])


def _whitened(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, size: Value, R: Value, weight: Value) -> None:
    """The root of S = A + R/w, and e = root⁻¹ν."""
    S, A, e = m.numbers("S"), m.numbers("A"), m.numbers("e")
    with f.over(f.times(size, size)) as i:
        f.put(S, i, f.b.fadd(f.at(A, i), f.b.fdiv(f.at(R, i), weight)))
    f.b.call(algebra.cholesky, [S, size])
    f.b.call(algebra.copy, [e, m.numbers("nu"), size])
    f.b.call(algebra.cholesky_solve, [S, e, size, INT64(1), INT64(0)])


def _weight(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, measurement: Value, size: Value, R: Value) -> Value:
    """w of the loss, 1 without one, with S = A + R/w: `estimation.engines.robust`."""
    place, one = f.times(measurement, 3), DOUBLE(1.0)
    a, b, kind = (f.at(m.numbers("losses"), f.add(place, i)) for i in range(3))
    weight, step = f.variable(DOUBLE, one), f.variable(DOUBLE, one)
    with f.b.if_then(f.b.fcmp_ordered(">=", kind, DOUBLE(0.0))):
        student = f.b.fcmp_ordered(">", kind, DOUBLE(0.0))
        f.b.store(f.b.select(student, f.b.fdiv(a, b), one), weight)
        with f.over(TRIPS), f.b.if_then(f.b.fcmp_ordered(">", f.b.load(step), DOUBLE(SETTLED))):
            w = f.b.load(weight)
            found = _distance(f, m, algebra, size, R, w)
            after = f.b.select(student, _student(f, a, b, w, *found), _huber(f, a, w, *found))
            f.b.store(f.b.call(_intrinsic(f, "fabs"), [f.b.fdiv(f.b.fsub(after, w), w)]), step)
            f.b.store(after, weight)
        _whitened(f, m, algebra, size, R, f.b.load(weight))
    return f.b.load(weight)


def _intrinsic(f: Loops, name: str) -> Value:
    return f.function.module.declare_intrinsic(f"llvm.{name}", [DOUBLE])


def _distance(
    f: Loops, m: FilterAddresses, algebra: DenseAlgebra, size: Value, R: Value, w: Value
) -> tuple[Value, Value]:
    """s = d² of the residual that a correction with R/w leaves, and s + ½ w ds/dw."""
    z, v, S = m.numbers("K"), m.numbers("KR"), m.numbers("S")
    _whitened(f, m, algebra, size, R, w)
    f.b.call(algebra.copy, [z, m.numbers("nu"), size])
    f.b.call(algebra.cholesky_solve, [S, z, size, INT64(1), INT64(1)])
    clear(f, v, size)
    f.b.call(algebra.product, [v, R, z, size, size, INT64(1), INT64(1), size, INT64(1), DOUBLE(1.0)])
    square, rest = f.variable(DOUBLE, DOUBLE(0.0)), f.variable(DOUBLE, DOUBLE(0.0))
    with f.over(size) as i:
        f.b.store(f.plus(f.b.load(square), f.at(z, i), f.at(v, i)), square)
    f.b.call(algebra.cholesky_solve, [S, v, size, INT64(1), INT64(0)])
    with f.over(size) as i:
        f.b.store(f.plus(f.b.load(rest), f.at(v, i), f.at(v, i)), rest)
    w2 = f.b.fmul(w, w)
    return f.b.fdiv(f.b.load(square), w2), f.b.fdiv(f.b.load(rest), f.b.fmul(w2, w))


def _student(f: Loops, a: Value, b: Value, w: Value, square: Value, rest: Value) -> Value:
    """The root of w (b + s) = a with the tangent of s."""
    zero = DOUBLE(0.0)
    fall = f.b.fsub(square, rest)
    fall = f.b.select(f.b.fcmp_ordered(">", fall, zero), fall, zero)
    half = f.b.fmul(DOUBLE(0.5), f.plus(f.b.fadd(b, square), DOUBLE(2.0), fall))
    inside = f.minus(f.b.fmul(half, half), f.b.fmul(DOUBLE(2.0), a), f.b.fdiv(fall, w))
    inside = f.b.select(f.b.fcmp_ordered(">", inside, zero), inside, zero)
    return f.b.fdiv(a, f.b.fadd(half, f.b.call(_intrinsic(f, "sqrt"), [inside])))


def _huber(f: Loops, a: Value, w: Value, square: Value, rest: Value) -> Value:
    """The root of w = a s^(−½) with the tangent of s^(−½), at most 1."""
    one, some = DOUBLE(1.0), f.b.fcmp_ordered(">", square, DOUBLE(TINY))
    reach = f.b.fdiv(a, f.b.call(_intrinsic(f, "sqrt"), [f.b.select(some, square, DOUBLE(TINY))]))
    kept, near = f.b.select(some, f.b.fdiv(rest, square), one), f.b.fdiv(reach, w)
    near = f.b.select(f.b.fcmp_ordered("<", near, one), near, one)
    after = f.b.fdiv(f.b.fmul(reach, kept), f.plus(f.b.fsub(one, near), near, kept))
    return f.b.select(f.b.fcmp_ordered("<", after, one), after, one)


def _apply(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, size: Value, R: Value, weight: Value) -> None:
    """Joseph's form with W = P − K(HP), which is symmetric: P ← W − (HW − RKᵀ)ᵀKᵀ; then the row moves by Kν."""
    n, P, HP, S, K, KR = (m.integer("errors"), *map(m.numbers, ("P", "HP", "S", "K", "KR")))
    one, minus = DOUBLE(1.0), DOUBLE(-1.0)
    rows = m.numbers("W")  # Kᵀ = S⁻¹HP
    f.b.call(algebra.copy, [rows, HP, f.times(size, n)])
    f.b.call(algebra.cholesky_solve, [S, rows, size, n, INT64(1)])
    f.b.call(algebra.transpose, [K, rows, size, n, n])
    f.b.call(algebra.full, [P, K, HP, n, size, n, n, size, n, minus])
    clear(f, HP, f.times(size, n))
    f.b.call(algebra.product, [HP, m.numbers("H"), P, size, n, n, n, n, n, one])
    f.b.call(algebra.product, [HP, R, rows, size, size, n, n, size, n, f.b.fdiv(minus, weight)])
    f.b.call(algebra.transpose, [KR, HP, size, n, n])
    f.b.call(algebra.full, [P, KR, rows, n, size, n, n, size, n, minus])
    e = m.numbers("e")
    clear(f, e, n)
    f.b.call(algebra.product, [e, K, m.numbers("nu"), n, size, INT64(1), INT64(1), size, INT64(1), one])
    moved, width, row = m.numbers("moved"), m.integer("size"), m.numbers("row")
    f.b.call(algebra.copy, [moved, row, width])
    f.b.call(algebra.copy, [f.place(moved, width), e, n])
    zeros = m.numbers("zeros")
    m.call("retract", FUNCTION, [zeros, moved, row, zeros, INT64(1)])
    # P is of errors about the row before: T P Tᵀ is of those about the row after.
    T, square = m.numbers("Phi"), f.times(n, n)
    f.b.call(algebra.copy, [f.place(moved, width), row, width])
    clear(f, T, square)
    m.call("carry", FUNCTION, [e, moved, m.numbers("KR"), T, INT64(1)])
    among = f.b.select(f.b.icmp_signed("!=", m.integer("projector"), INT64(0)), n, f.b.sub(n, m.integer("drifting")))
    sandwich(f, m, algebra, T, algebra.product, among)
    symmetric(f, P, n, n)


def _project(f: Loops, m: FilterAddresses, algebra: DenseAlgebra) -> None:
    """P ← ΠPΠᵀ at the row, with the tangent space of constraints."""
    n, Pi = m.integer("errors"), m.numbers("Phi")
    clear(f, Pi, f.times(n, n))
    m.call("projector", FUNCTION, [m.numbers("zeros"), m.numbers("row"), m.numbers("value"), Pi, INT64(1)])
    sandwich(f, m, algebra, Pi, algebra.product, n)
    symmetric(f, m.numbers("P"), n, n)
