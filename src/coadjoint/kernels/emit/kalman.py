"""An extended Kalman filter as LLVM code: predictions and corrections of one filter, from a list of orders.

It knows rows of numbers, errors and functions of them by their addresses, and no groups.
"""

from __future__ import annotations

from llvmlite import ir

from coadjoint.kernels.emit.dense import VOID, DenseAlgebra, dense
from coadjoint.kernels.emit.emitter import Value
from coadjoint.kernels.emit.filter_correction import correction
from coadjoint.kernels.emit.filter_memory import FUNCTION, FilterAddresses, clear, not_finite, sandwich, symmetric
from coadjoint.kernels.emit.loops import DOUBLE, INT64, INTEGERS, NUMBERS, Loops

NAME = "filter"
PREDICT, SET, CORRECT, SAVE = range(4)
"""Orders, four integers each: (PREDICT, place of h in the data, 0, 0), (SET, first input, count, place in the
data), (CORRECT, measurement, place in the data, place of (NIS, used) in the output), (SAVE, place of the row in the
output, of P, whether all of P is kept)."""
_KERNEL = ir.FunctionType(VOID, [*[NUMBERS] * 3, INT64, INT64, *[NUMBERS] * 3, INTEGERS]).as_pointer()


def assemble() -> str:
    """int64 filter(memory, orders, count, data, output): −1, or the number of the order that failed."""
    module = ir.Module(name="coadjoint")
    algebra = dense(module)
    predict, correct = _predict(module, algebra), correction(module, algebra)
    f = Loops(module, NAME, INT64, INTEGERS, INTEGERS, INT64, NUMBERS, NUMBERS, inside=False)
    memory, orders, count, data, output = f.args
    m = FilterAddresses(f, memory)
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


def _when(f: Loops, order: Value, number: int) -> Value:
    return f.b.if_then(f.b.icmp_signed("==", order, INT64(number)))


def _save(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, output: Value, rest: list[Value]) -> None:
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
    m = FilterAddresses(f, memory)
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
            m.call("step", FUNCTION, [zeros, after, f.place(y, size), zeros, INT64(1)])
            f.b.call(algebra.copy, [after, f.place(y, size), size])
    with f.over(m.integer("parts")) as part:
        _linearise(f, m, algebra, h, part)
    _carry(f, m, algebra, h)
    at, k = f.add(m.integer("unknowns"), m.integer("between")), m.integer("drifting")
    f.b.call(algebra.copy, [row, after, size])
    f.b.call(algebra.copy, [f.place(row, m.integer("state")), f.place(m.numbers("value"), at), k])
    f.b.ret(f.b.zext(not_finite(f, m), INT64))
    return f.function


def _implicit(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, h: Value) -> None:
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


def _linearise(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, h: Value, part: Value) -> None:
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
    m.call("tangent", FUNCTION, [x, y, m.numbers("value"), m.numbers("J"), INT64(1)])
    _eliminate(f, m, algebra)
    with f.b.if_then(f.b.icmp_signed(">", parts, INT64(1))):
        _chain(f, m, algebra, first, last)
    f.b.call(algebra.copy, [y, f.place(y, size), size])


def _eliminate(f: Loops, m: FilterAddresses, algebra: DenseAlgebra) -> None:
    """Φ = ∂e⁺/∂e of a part by the implicit function theorem."""
    u, n, w = (m.integer(name) for name in ("unknowns", "between", "noises"))
    J, Phi, stride = m.numbers("J"), m.numbers("Phi"), f.add(u, n, w)
    # Of a single part the rows of drifting numbers are diagonal, and no step reads the last columns.
    alone = f.b.icmp_signed("==", m.integer("parts"), INT64(1))
    rows = f.b.select(alone, f.b.sub(n, m.integer("drifting")), n)
    columns = f.b.select(alone, m.integer("acting"), n)
    below = f.place(J, f.times(u, stride))
    # The slopes of the step keep their zeros: the solve works on a copy.
    kept = m.numbers("KR")
    f.b.call(algebra.copy, [kept, J, f.times(u, stride)])
    f.b.call(algebra.solve, [kept, f.place(kept, u), u, columns, stride, stride])
    with f.over(n) as i:
        f.b.call(algebra.copy, [f.place(Phi, f.times(i, n)), f.place(below, f.add(f.times(i, stride), u)), n])
    f.b.call(algebra.full, [Phi, below, f.place(kept, u), rows, u, columns, n, stride, stride, DOUBLE(-1.0)])


def _chain(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, first: Value, last: Value) -> None:
    """The product of the Φ of all parts; of the last, Φ of the errors at both ends."""
    n, errors = m.integer("between"), m.integer("errors")
    Phi, chain, product, square = m.numbers("Phi"), m.numbers("chain"), m.numbers("W"), f.times(n, n)
    with f.b.if_else(first) as (begins, goes_on):
        with begins:
            f.b.call(algebra.copy, [chain, Phi, square])
        with goes_on:
            clear(f, product, square)
            f.b.call(algebra.product, [product, Phi, chain, n, n, n, n, n, n, DOUBLE(1.0)])
            f.b.call(algebra.copy, [chain, product, square])
    with f.b.if_then(last), f.over(errors) as i:
        f.b.call(algebra.copy, [f.place(Phi, f.times(i, errors)), f.place(chain, f.times(i, n)), errors])


def _carry(f: Loops, m: FilterAddresses, algebra: DenseAlgebra, h: Value) -> None:
    """P ← Φ(P + D)Φᵀ + U S²h Uᵀ + D, with the noise U and D = diag q/(1 + φ²) of `estimation.process`."""
    u, n, w, k = (m.integer(name) for name in ("unknowns", "errors", "noises", "drifting"))
    between, moving = m.integer("between"), f.b.sub(n, k)
    J, P, W, turned, U = (m.numbers(name) for name in ("J", "P", "W", "turned", "shaken"))
    stride, densities, value = f.add(u, between, w), m.numbers("densities"), m.numbers("value")
    G, first = f.place(J, f.add(f.times(u, stride), u, between)), f.add(u, between, k)

    def drift() -> None:
        with f.over(k) as i:
            place = f.times(f.add(moving, i), f.add(n, 1))
            own = f.at(m.numbers("Phi"), place)
            half = f.b.fdiv(f.at(value, f.add(first, i)), f.plus(DOUBLE(1.0), own, own))
            f.put(P, place, f.b.fadd(f.at(P, place), half))

    drift()
    sandwich(f, m, algebra, m.numbers("Phi"), algebra.full, m.integer("acting"))
    with f.over(moving) as i, f.over(w) as a:
        f.put(U, f.add(f.times(i, w), a), f.at(G, f.add(f.times(i, stride), a)))
    count = f.variable(INT64, w)
    with f.b.if_then(f.b.icmp_signed("!=", m.integer("shake"), INT64(0))):
        f.b.store(f.times(w, 2), count)
        _shake(f, m)
    wide = f.b.load(count)
    with f.over(moving) as i, f.over(wide) as a:
        scale = f.b.fmul(f.at(densities, f.b.srem(a, w)), h)
        place = f.add(f.times(i, wide), a)
        f.put(W, place, f.b.fmul(f.at(U, place), scale))
    f.b.call(algebra.transpose, [turned, U, moving, wide, wide])
    f.b.call(algebra.full, [P, W, turned, moving, wide, moving, n, wide, moving, DOUBLE(1.0)])
    drift()
    # The blocks of drifting numbers are symmetric by construction.
    symmetric(f, P, n, moving)


def _shake(f: Loops, m: FilterAddresses) -> None:
    """U ← ((A + B)/2, (A − B)/√12), of impulses at the start of the step, A = ΦG₀, and at its end, B, which is in U."""
    n, w, among = (m.integer(name) for name in ("errors", "noises", "acting"))
    start, Phi, U, moving = (
        m.numbers("started"),
        m.numbers("Phi"),
        m.numbers("shaken"),
        f.b.sub(n, m.integer("drifting")),
    )
    m.call("shake", FUNCTION, [m.numbers("zeros"), m.numbers("row"), m.numbers("KR"), start, INT64(1)])
    A, wide = m.numbers("W"), f.times(w, 2)
    clear(f, A, f.times(moving, w))
    with f.over(w) as a, f.over(among) as j:
        value = f.at(start, f.add(f.times(j, w), a))
        with f.b.if_then(f.b.fcmp_unordered("!=", value, DOUBLE(0.0))), f.over(moving) as i:
            here = f.place(A, f.add(f.times(i, w), a))
            f.b.store(f.plus(f.b.load(here), f.at(Phi, f.add(f.times(i, n), j)), value), here)
    # Rows of U become twice as long: the last ones move first.
    with f.over(moving) as back:
        i = f.b.sub(f.b.sub(moving, INT64(1)), back)
        with f.over(w) as across:
            a = f.b.sub(f.b.sub(w, INT64(1)), across)
            begin, end = (f.at(one, f.add(f.times(i, w), a)) for one in (A, U))
            place = f.add(f.times(i, wide), a)
            f.put(U, f.add(place, w), f.b.fmul(DOUBLE(12.0**-0.5), f.b.fsub(begin, end)))
            f.put(U, place, f.b.fmul(DOUBLE(0.5), f.b.fadd(begin, end)))
