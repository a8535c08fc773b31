"""exp, sin, cos and tanh of all lanes together, where a call of the C library takes one lane after the other.

Within 3 ε of the C library's values, relative, near the zeros of sin and cos, too, and where
exp is below 1e-307 within 3 ε of that; results of lanes are compared to round-off, never bitwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir

from coadjoint.kernels.emit.emitter import INT64, Emitter
from coadjoint.kernels.emit.loops import FUSED

LN2 = (0.6931471804855391, 7.440617110012397e-11)
"""ln 2 in two parts: an integer below 2²⁰ times the first is exact."""

HALF_PI = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
"""π/2 in three parts, likewise."""

FAR = 1e5
"""From this angle on the C library reduces it, with as many digits of π as that takes."""

ROUNDER = 1.5 * 2.0**52
"""Added to a number below 2⁵¹ it rounds it to an integer, which its last bits then hold."""


class LaneEmitter(Emitter):
    """Expressions as LLVM instructions, with elementary functions of all lanes together."""

    def intrinsic(self, name: str, *args: Any, flags: tuple[str, ...] = ()) -> ir.Value:
        if self.width > 1 and name in _FUNCTIONS:
            return self.builder.call(self._lanes(name), args)
        return super().intrinsic(name, *args, flags=flags)

    def _libm(self, name: str, *args: ir.Value) -> ir.Value:
        if self.width > 1 and name in _FUNCTIONS:
            return self.builder.call(self._lanes(name), args)
        return super()._libm(name, *args)

    def _lanes(self, name: str) -> ir.Function:
        function = self.module.globals.get(f"lanes.{name}")
        if function is None:
            kind = ir.FunctionType(self.number, [self.number])
            function = ir.Function(self.module, kind, name=f"lanes.{name}")
            function.linkage = "internal"
            for attribute in ("nounwind", "alwaysinline"):
                function.attributes.add(attribute)
            builder = ir.IRBuilder(function.append_basic_block("entry"))
            inside = Emitter(self.module, builder, self.width)
            builder.ret(_FUNCTIONS[name](_Lanes(inside), function.args[0]))
        return function


class _Lanes:
    """Arithmetic on lanes: numbers stand for the same in every lane."""

    def __init__(self, emit: Emitter):
        self.emit, self.b = emit, emit.builder
        self.int64s = ir.VectorType(INT64, emit.width)

    def _given(self, x: Any) -> ir.Value:
        return self.emit.constant(x) if isinstance(x, (int, float)) else x

    def _fused(self, name: str, x: Any, y: object) -> ir.Value:
        return getattr(self.b, name)(self._given(x), self._given(y), flags=FUSED)

    def add(self, x: object, y: Any) -> Any:
        return self._fused("fadd", x, y)

    def sub(self, x: object, y: object) -> Any:
        return self._fused("fsub", x, y)

    def mul(self, x: object, y: Any) -> Any:
        return self._fused("fmul", x, y)

    def div(self, x: Any, y: Any) -> Any:
        return self.b.fdiv(self._given(x), self._given(y))

    def exactly(self, sum_or_difference: str, x: ir.Value, y: Any) -> Any:
        """A sum or a difference that nothing is fused with."""
        return getattr(self.b, sum_or_difference)(self._given(x), self._given(y))

    def where(self, order: str, x: Any, y: Any, then: Any, otherwise: Any) -> Any:
        """`then` where x `order` y, else `otherwise`, also of NaN."""
        condition = self.b.fcmp_ordered(order, self._given(x), self._given(y))
        return self.b.select(condition, self._given(then), self._given(otherwise))

    def polynomial(self, x: ir.Value, coefficients: Sequence[float]) -> Any:
        """c_0 + c_1 x + … by Horner."""
        found = self.emit.constant(coefficients[-1])
        for c in coefficients[-2::-1]:
            found = self.add(self.mul(found, x), c)
        return found

    def rounded(self, x: ir.Value) -> tuple[Any, Any]:
        """The nearest integer, as a double and in the last bits of an integer."""
        shifted = self.exactly("fadd", x, ROUNDER)
        return self.exactly("fsub", shifted, ROUNDER), self.b.bitcast(shifted, self.int64s)

    def reduced(self, x: object, n: ir.Value, parts: Sequence[float]) -> Any:
        """x − n Σ parts."""
        for part in parts:
            x = self.sub(x, self.mul(n, part))
        return x

    def integers(self, value: int) -> ir.Value:
        return ir.Constant(self.int64s, [INT64(value)] * self.emit.width)

    def power_of_two(self, bits: ir.Value) -> Any:
        """2ⁿ of the integer n in the last bits, −1022 ≤ n ≤ 1023."""
        biased = self.b.add(bits, self.integers(1023))
        return self.b.bitcast(self.b.shl(biased, self.integers(52)), self.emit.number)


def _exp(l: _Lanes, x: ir.Value) -> Any:
    """2ⁿ e^r with |r| ≤ ½ ln 2; 2ⁿ by two factors, so that the smallest and the largest numbers are reached."""
    x = l.where(">", x, 710.0, 710.0, x)
    x = l.where("<", x, -746.0, -746.0, x)
    n, _ = l.rounded(l.mul(x, 1 / math.log(2)))
    r = l.reduced(x, n, LN2)
    value = l.polynomial(r, [1 / math.factorial(k) for k in range(14)])
    half, half_bits = l.rounded(l.mul(n, 0.5))
    _, rest_bits = l.rounded(l.exactly("fsub", n, half))
    return l.b.fmul(l.b.fmul(value, l.power_of_two(half_bits)), l.power_of_two(rest_bits))


def _tanh(l: _Lanes, x: Any) -> Any:
    """Lambert's continued fraction x/(1 + x²/(3 + x²/(5 + …))) to its ninth part where |x| < 1, else by e^{2|x|}."""
    size = l.emit.intrinsic("fabs", x)
    square = l.mul(x, x)
    numerator, denominator = _continued_fraction(9)
    e = _exp(l, l.mul(2.0, l.where(">", size, 20.0, 20.0, size)))
    sign = l.where("<", x, 0.0, -1.0, 1.0)
    above = l.where("<", size, 1.0, l.mul(x, l.polynomial(square, numerator)), l.mul(sign, l.sub(e, 1.0)))
    below = l.where("<", size, 1.0, l.polynomial(square, denominator), l.add(e, 1.0))
    return l.div(above, below)


def _continued_fraction(parts: int) -> tuple[list[float], list[float]]:
    """(P, Q) with tanh x ≈ x P(x²)/Q(x²), relative to Q(0): from 2k + 1 + x²/(2k + 3 + …) inside out."""
    above, below = [1.0], [0.0]  # a ratio of polynomials, infinite: the end of the fraction
    for odd in range(2 * parts - 1, 0, -2):
        shifted = [0.0, *below]
        size = max(len(above), len(shifted))
        padded = [part + [0.0] * (size - len(part)) for part in (above, shifted)]
        above, below = [odd * a + s for a, s in zip(*padded, strict=True)], above
    scale = above[0]
    return [c / scale for c in below], [c / scale for c in above]


def _sine_and_cosine(l: _Lanes, r: ir.Value) -> tuple[Any, Any]:
    """sin r and cos r, |r| ≤ π/4, by their series."""
    square = l.mul(r, r)
    sines = [(-1) ** k / math.factorial(2 * k + 1) for k in range(1, 9)]
    cosines = [(-1) ** k / math.factorial(2 * k) for k in range(1, 9)]
    sine = l.add(r, l.mul(l.mul(r, square), l.polynomial(square, sines)))
    return sine, l.add(1.0, l.mul(square, l.polynomial(square, cosines)))


def _circular(name: str, quarter: int) -> Callable[[_Lanes, Any], Any]:
    """sin(x + quarter·π/2) by the quarter turn n that is nearest to x: sin r, cos r, −sin r, −cos r in turn."""

    def function(l: _Lanes, x: object) -> Any:
        b = l.b
        n, bits = l.rounded(l.mul(x, 2 / math.pi))
        sine, cosine = _sine_and_cosine(l, l.reduced(x, n, HALF_PI))
        turns = b.add(bits, l.integers(quarter))
        odd = b.icmp_signed("!=", b.and_(turns, l.integers(1)), l.integers(0))
        value = b.select(odd, cosine, sine)
        flipped = b.icmp_signed("!=", b.and_(turns, l.integers(2)), l.integers(0))
        near = b.select(flipped, b.fneg(value), value)
        far = b.fcmp_unordered(">=", l.emit.intrinsic("fabs", x), l.emit.constant(FAR))
        before, slow, end = b.block, b.append_basic_block("far"), b.append_basic_block("near")
        b.cbranch(l.emit.any(far), slow, end).set_weights([1, 1 << 20])
        b.position_at_end(slow)
        exact = l.emit.intrinsic(name, x)
        b.branch(end)
        b.position_at_end(end)
        found = b.phi(l.emit.number)
        found.add_incoming(near, before)
        found.add_incoming(exact, slow)
        return found

    return function


_FUNCTIONS: dict[str, Callable[[_Lanes, Any], Any]] = {
    "exp": _exp,
    "tanh": _tanh,
    "sin": _circular("sin", 0),
    "cos": _circular("cos", 1),
}
