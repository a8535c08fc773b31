"""Whether the derivative that JAX takes of ℓ, ℋ or Λ is that of its value, which the equations of motion assume.

`jax.lax.stop_gradient` and a wrong `jax.custom_jvp` change a derivative and leave the value: differences of values find
them. Rounding and tables that are read at integers have the derivative 0 wherever a short difference is taken, and jump
in between: where a function contains such an operation, a search looks for its jumps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import LagrangianError
from coadjoint.kernels.trace import jaxprs
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import Places
from coadjoint.spaces import Space

Point = tuple[np.ndarray, ...]
Slopes = Callable[..., tuple[Any, Sequence[Any]]]
"""A function of some arrays to its value and its gradient by each of them."""

DISTANCES = (1e-5, 1e-3, 1e-7)
"""Over which differences are taken, relative to the size of the arguments; one that agrees is enough."""

AGREES = 1e-5
"""How far a difference and a derivative may be apart, relative to them."""

ROUND_OFF = 1e-13
"""Of a value, relative to it, where differences are taken."""

AWAY, LARGE = 0.1, 2000
"""How far from the start the perturbed points are, relative to the size of the arguments; there are two of them, of
more arguments than LARGE one."""

ROUNDING = frozenset(("round", "floor", "ceil", "sign", "argmax", "argmin", "rem"))
READING = frozenset(("gather", "dynamic_slice"))
"""Primitives after which a function may jump, and those that read a table at a number."""

LENGTHS, PIECES, PARTS, LEVELS, SEVERAL = (2.0, 60.0), 64, 8, 12, 2
"""Jumps are searched for over lengths, relative to the size of the arguments, in pieces; the one that the derivative
explains least is divided into parts, again and again. After some levels it holds one jump or kink."""


class Line(NamedTuple):
    """Points base + s·direction, in words as well."""

    base: Point
    direction: Point
    names: tuple[str, ...]

    def at(self, s: float) -> Point:
        return tuple(x + s * d for x, d in zip(self.base, self.direction, strict=True))

    def __str__(self) -> str:
        parts = [(name, d) for name, d in zip(self.names, self.direction, strict=True) if d.size]
        if sum(d.size for _, d in parts) > 12:
            return f"along a direction of {sum(d.size for _, d in parts)} numbers"
        names, shown = ", ".join(name for name, _ in parts), ", ".join(str(np.round(d, 3).tolist()) for _, d in parts)
        return f"along ({names}) = ({shown})"


def require_own_derivative(places: Places, slopes: Slopes, what: str, start: Point, jaxpr: object) -> None:
    """Raise LagrangianError where a difference of values is not the derivative, at the start and at points near it.

    start: ξ, n, ν, a of ℓ, μ, n, π, a of ℋ, or what Λ takes. jaxpr: that of the function, as JAX reads it.
    """
    start = tuple(np.asarray(x, float) for x in start)
    names = ("μ", "n", "π", "a") if "Hamiltonian" in what else ("ξ", "n", "s" if "discrete" in what else "ν", "a")
    random, base = np.random.default_rng(1788), start
    for _ in range(3 if sum(map(np.size, start)) <= LARGE else 2):
        line = Line(base, _tangent(places, base, _drawn(random, start)), names)
        if wrong := _wrong(slopes, line):
            difference, derivative = wrong
            raise LagrangianError(
                f"The derivative of t{what[1:]} must be that of its value, but {line} the value changes by "
                f"{difference:.6g} and the derivative gives {derivative:.6g}: look for jax.lax.stop_gradient, or for a "
                "jax.custom_jvp or custom_vjp that is wrong."
            )
        base = _moved(places, start, tuple(AWAY * change for change in _drawn(random, start)))
    if operation := rounding(jaxprs.lowered(jaxpr)):
        _require_no_jumps(slopes, what, Line(start, _drawn(random, start), names), operation)


def _drawn(random: np.random.Generator, like: Point) -> Point:
    """Random numbers of the size of the arguments, at least of 1."""
    return tuple(max(float(np.max(np.abs(x), initial=0.0)), 1.0) * random.normal(size=np.shape(x)) for x in like)


def _tangent(places: Places, base: Point, change: Point) -> Point:
    """The change as a direction that stays on the spaces of n and a."""
    group, Q, V = places

    def along(space: Space, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return v if space.flat else evaluate(partial(space.project, group), x, v)

    first, n, nu, a = change
    return first, along(Q, base[1], n), along(Q, base[1], nu), along(V, base[3], a)


def _moved(places: Places, base: Point, change: Point) -> Point:
    """The point where a change leads, on the spaces of n and a, with velocities that are tangent there."""
    group, Q, V = places

    def there(space: Space, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        return x + (u if space.flat else evaluate(partial(space.difference, group), x, u))

    first, n, nu, a = _tangent(places, base, change)
    moved = there(Q, base[1], n)
    nu = base[2] + nu
    nu = nu if Q.flat else evaluate(partial(Q.project, group), moved, nu)
    return base[0] + first, moved, nu, there(V, base[3], a)


def _wrong(slopes: Slopes, line: Line) -> tuple[float, float] | None:
    """The difference of values and the derivative along a line, where they differ over all distances; else None.

    At a kink the derivative is that of either side, or between both.
    """
    value, gradient = _values(slopes, line, 0.0)
    if not np.isfinite(value + gradient):
        return None
    found = value
    for distance in DISTANCES:
        behind, ahead = (_values(slopes, line, s)[0] for s in (-distance, distance))
        if not np.isfinite(behind + ahead):
            return None
        least = ROUND_OFF * max(abs(value), abs(behind), abs(ahead)) / distance
        sides = (value - behind) / distance, (ahead - value) / distance
        found = 0.5 * sum(sides)
        least += AGREES * (abs(found) + abs(gradient))
        if abs(found - gradient) <= least:
            return None
        if distance == min(DISTANCES) and min(sides) - least <= gradient <= max(sides) + least:
            return None
    return found, gradient


def _values(slopes: Slopes, line: Line, s: float) -> tuple[float, float]:
    """The value at base + s·direction, and its derivative along the direction."""
    value, gradient = slopes(*line.at(s))
    return float(value), float(sum(np.vdot(part, d) for part, d in zip(gradient, line.direction, strict=True)))


def rounding(jaxpr: object, depends: Sequence[bool] | None = None) -> str | None:
    """The first primitive of a jaxpr after which it may jump where its inputs change; None of none.

    depends: which inputs change, by default all.
    """
    variables = jaxprs.variables(jaxpr)
    flags = [True] * len(variables.inputs) if depends is None else depends
    moving = {atom for atom, flag in zip(variables.inputs, flags, strict=True) if flag}
    for equation in jaxprs.equations(jaxpr):
        given = [jaxprs.number(atom) is None and atom in moving for atom in equation.inputs]
        if not any(given):
            continue
        if _rounds(equation, given):
            return equation.name
        for inner in jaxprs.inner_jaxprs(equation.parameters):
            alike = len(jaxprs.variables(inner).inputs) == len(given)
            if found := rounding(inner, given if alike else None):
                return found
        moving.update(equation.outputs)
    return None


def _rounds(equation: jaxprs.Equation, given: Sequence[bool]) -> bool:
    kinds = [jaxprs.dtype(atoms[0]).kind for atoms in (equation.inputs, equation.outputs)]
    if equation.name == "convert_element_type":
        return (kinds[0] == "f" and kinds[1] in "iu") or (kinds[0] == "b" and kinds[1] == "f")
    if equation.name == "cond":
        return given[0]
    if equation.name in READING:
        return any(given[1:])
    return equation.name in ROUNDING and kinds[0] == "f"


def _require_no_jumps(slopes: Slopes, what: str, line: Line, operation: str) -> None:
    """Raise LagrangianError where a function that holds `operation` jumps along a line."""
    for length in LENGTHS:
        if jump := _jump(slopes, line, length):
            change, derivative, s = jump
            raise LagrangianError(
                f"{what} must be continuous, but it holds the operation `{operation}` and jumps: {line}, "
                f"{s:.6g} from the start, the value changes by {change:.6g} and the derivative gives {derivative:.2g}. "
                "Interpolate tables (jnp.interp), leave out rounding, and pass what switches by `internal` or `inputs`."
            )


def _jump(slopes: Slopes, line: Line, length: float) -> tuple[float, float, float] | None:
    """The change of the value at a jump, what the derivative gives for it, and where it is; None of none."""
    s, before = np.linspace(0.0, length, PIECES + 1), np.inf
    for level in range(LEVELS):
        rows = np.array([_values(slopes, line, float(one)) for one in s])
        change, mean = np.diff(rows[:, 0]), 0.5 * (rows[1:, 1] + rows[:-1, 1]) * np.diff(s)
        unexplained = np.nan_to_num(np.abs(change - mean), nan=0.0, posinf=0.0)
        k, size = int(np.argmax(unexplained)), float(np.max(np.abs(rows[np.isfinite(rows[:, 0]), 0]), initial=0.0))
        shrinks = level > SEVERAL and unexplained.sum() < 0.3 * before  # as at a kink; fine stairs keep their sum
        if shrinks or unexplained[k] <= 1e3 * ROUND_OFF * size:
            return None
        before = unexplained[k]
        step = s[k + 1] - s[k]
        if step < 1e-9 * length:
            slope = np.max(np.abs(rows[k : k + 2, 1]))
            return (float(change[k]), float(mean[k]), float(s[k])) if abs(change[k]) > 10 * slope * step else None
        s = np.linspace(s[k], s[k + 1], PARTS + 1)
    return None
