"""Checks of arguments at public entry points: each returns the value in its final type, or raises one sentence.

`name` is that of the argument, `steps` for "Argument `steps` must …"; what does not begin with an identifier is the
complete subject, as "[run] steps". `error` is the type that is raised, by default ArgumentError. Functions inside the
library take what has passed here and check nothing again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from importlib import import_module
from numbers import Integral, Real
from typing import Any, ParamSpec, TypeVar

import numpy as np

from coadjoint.errors import ArgumentError, CoadjointError, shown
from coadjoint.errors import nearest as nearest
from coadjoint.known_names import all_known as all_known
from coadjoint.known_names import choice as choice
from coadjoint.known_names import either as either
from coadjoint.known_names import known as known
from coadjoint.known_names import known_arguments as known_arguments
from coadjoint.known_names import letters as letters
from coadjoint.known_names import subject as subject
from coadjoint.known_names import unknown as unknown
from coadjoint.real_numbers import float64 as float64
from coadjoint.real_numbers import is_short as is_short
from coadjoint.real_numbers import numeric as numeric

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
Error = type[CoadjointError]

MOST = 2**53
"""Up to here every whole number is a float64."""


def is_number(value: object) -> bool:
    """Whether a value is one real number, of Python or of NumPy; truth values and durations are none."""
    return isinstance(value, Real) and not isinstance(value, bool) and not _is_duration(value)


def is_whole(value: object) -> bool:
    """Whether a value is one whole number, of Python or of NumPy; 3.0 is none."""
    return isinstance(value, Integral) and not isinstance(value, bool) and not _is_duration(value)


def _is_duration(value: object) -> bool:
    return isinstance(value, np.timedelta64)


def whole(value: object, name: str, least: int = 1, most: int | None = None, error: Error = ArgumentError) -> int:
    """A whole number from `least`, by default 1, to `most`, by default 2⁵³."""
    if not is_whole(value) or value < least or (most is not None and value > most):  # pyright: ignore[reportOperatorIssue]
        bounds = f"from {least}" if most is None else f"from {least} to {most}"
        raise error(f"{subject(name)} must be a whole number {bounds}, but is {shown(value)}.")
    found = int(value)  # pyright: ignore[reportArgumentType]
    if found > MOST:
        raise error(f"{subject(name)} must be at most 2⁵³ = {MOST}, but is {shown(value)}.")
    return found


CLOSE = 1e-9
"""By how much, relative to it, a time may deviate from a multiple of a step."""


def steps(time: float, h: float, least: int = 1, close: float = CLOSE) -> int | None:
    """The number of steps of h in a time, both in s; None unless it is whole and at least `least`."""
    count = round(time / h)
    return count if count >= least and abs(count * h - time) <= close * max(h, time) else None


def uneven(time: float, h: float) -> str:
    """Such as "427.3921 s is 213696.05 steps of 0.002 s", with the digits by which it is not whole."""
    ratio = time / h
    off = 0.01 * abs(ratio - round(ratio))
    texts = (f"{ratio:.{digits}g}" for digits in range(6, 18))
    count = next((text for text in texts if abs(float(text) - ratio) <= off), f"{ratio:.17g}")
    return f"{float(time)!r} s is {count} steps of {float(h)!r} s"


def number(
    value: object,
    name: str,
    least: float = -math.inf,
    most: float = math.inf,
    above: float = -math.inf,
    below: float = math.inf,
    error: Error = ArgumentError,
) -> float:
    """A finite number with least ≤ value ≤ most and above < value < below; floats of fewer digits are none."""
    if isinstance(value, np.floating) and value.itemsize != 8:
        float64(value, subject(name))
    found = _float(value)
    if least <= found <= most and above < found < below and math.isfinite(found):
        return found
    bounds = _bounds(least, most, above, below)
    kind = "a positive number" if bounds == "positive" and isinstance(value, str) else bounds
    raise error(f"{subject(name)} must be {kind}, but is {shown(value)}.")


def positive(value: object, name: str, error: Error = ArgumentError) -> float:
    """A finite number above 0."""
    return number(value, name, above=0.0, error=error)


def not_negative(value: object, name: str, error: Error = ArgumentError) -> float:
    """A finite number of at least 0."""
    return number(value, name, least=0.0, error=error)


def _float(value: object) -> float:
    try:
        return float(value) if is_number(value) else math.nan  # pyright: ignore[reportArgumentType]
    except OverflowError:
        return math.inf


def _bounds(least: float, most: float, above: float, below: float) -> str:
    if above == 0 and below == most == math.inf:
        return "positive"
    if above > -math.inf and below < math.inf:
        return f"a number between {above:g} and {below:g}"
    low = f" from {least:g}" if least > -math.inf else f" above {above:g}" if above > -math.inf else ""
    high = f" to {most:g}" if most < math.inf else f" below {below:g}" if below < math.inf else ""
    if low and high:
        return f"a number{low}{high}"
    return f"a finite number up to {most:g}" if most < math.inf else f"a finite number{low}{high}"


def truth(value: object, name: str, error: Error = ArgumentError) -> bool:
    """True or False, of Python or of NumPy; 0 and 1 are neither."""
    expect(isinstance(value, (bool, np.bool_)), value, name, "True or False", error)
    return bool(value)


def text(value: object, name: str, error: Error = ArgumentError) -> str:
    """A text that is not empty."""
    expect(isinstance(value, str) and value, value, name, "a text", error)
    return value  # pyright: ignore[reportReturnType]


def library(module: str, what: str, extra: str, package: str = "") -> Any:
    """A module that an extra installs; raises ArgumentError with the command that does, where it is not installed.

    what: who needs it, with the verb, as "Reading MCAP needs". package: its name, if that is not the module's.
    """
    try:
        return import_module(module)
    except ImportError as error:
        named = package or module.partition(".")[0]
        raise ArgumentError(f'{what} {named}, which is not installed: pip install "{extra}".') from error


def expect(fits: object, value: object, name: str, words: str, error: Error = ArgumentError, remedy: str = "") -> None:
    """Raise unless a condition on a value holds: "Argument `pair` must be two numbers, but is (1,): remedy."."""
    if not fits:
        raise error(f"{subject(name)} must be {words}, but is {shown(value)}{': ' * bool(remedy)}{remedy}.")


def leave_out(given: object, what: str, why: str, error: Error = ArgumentError) -> None:
    """Raise where something is given that does not go with the rest, as
    "This system has no additional dynamics: leave out `q`."."""
    if given:
        raise error(f"{why}: leave out {what}.")


def instance(value: object, name: str, kind: type[T] | tuple[type, ...], words: str, error: Error = ArgumentError) -> T:
    """An object of a class; `words` say what is expected, as "a co.System"."""
    expect(isinstance(value, kind), value, name, words, error)
    return value  # pyright: ignore[reportReturnType]


def mapping(
    value: object,
    name: str,
    words: str = "a dictionary of name → value",
    error: Error = ArgumentError,
    of: type = object,
) -> Mapping[str, Any]:
    """A mapping whose keys are texts and whose values are objects of a class."""
    fits = isinstance(value, Mapping) and all(
        isinstance(key, str) and isinstance(one, of) for key, one in value.items()
    )
    expect(fits, value, name, words, error)
    return value  # pyright: ignore[reportReturnType]


def function(value: object, name: str, words: str = "a function", error: Error = ArgumentError) -> Callable[..., Any]:
    """What can be called; `words` say which function is expected."""
    expect(callable(value), value, name, words, error)
    return value  # pyright: ignore[reportReturnType]


def texts(value: object, name: str, words: str, error: Error = ArgumentError) -> tuple[str, ...]:
    """A list or tuple of texts, as ("mass", "inertia"); a single text is none. words: what they name."""
    listed = isinstance(value, (list, tuple)) and all(isinstance(one, str) for one in value)
    expect(listed, value, name, words, error)
    return tuple(value)  # pyright: ignore[reportArgumentType]


def shape(value: Any, name: str, *expected: str | tuple[int, ...], error: Error = ArgumentError) -> tuple[int, ...]:
    """The shape of an array, one of those expected: (3,), or "(n, 3)" with letters for any length from 1 on.

    "(…, 3)" has any axes before the last; equal letters stand for equal lengths.
    """
    found = np.shape(value)
    if any(found == one if isinstance(one, tuple) else _fits(found, one) for one in expected):
        return found
    others = " or ".join(str(one) for one in expected if one not in ((), "()"))
    one = "be one number" if {(), "()"} & {*expected} else ""
    what = " or ".join(filter(None, [one, f"have shape {others}" if others else ""]))
    raise error(f"{subject(name)} must {what}, but has shape {found}.")


def one_of_each(found: tuple[int, ...], expected: tuple[int, ...], name: str) -> str:
    """The remedy for an array with a leading axis of members, where one member is expected; empty for other shapes."""
    if found[1:] != expected or not found or found[0] < 1:
        return ""
    return f"; for an ensemble of {found[0]:,} members write {name}=co.each(values)"


def _fits(found: tuple[int, ...], pattern: str) -> bool:
    axes = [one.strip() for one in pattern.strip("()").split(",") if one.strip()]
    if axes[:1] == ["…"]:
        axes = axes[1:]
        found = found[len(found) - len(axes) :] if len(found) >= len(axes) else ()
    if len(found) != len(axes):
        return False
    lengths: dict[str, int] = {}
    return all(
        size == int(one) if one.isdigit() else 0 < size == lengths.setdefault(one, size)
        for one, size in zip(axes, found, strict=True)
    )


def array(value: object, name: str, *shapes: str | tuple[int, ...], error: Error = ArgumentError) -> Any:
    """A finite float64 array of one of these shapes, as `shape` has them; a float64 tracer passes."""
    found = float64(value, subject(name))
    shape(found, name, *shapes, error=error)
    return found


def increasing(values: object, name: str, error: Error = ArgumentError) -> None:
    """Raise unless numbers (k,) are strictly increasing; those of tracers are not known."""
    if isinstance(values, np.ndarray) and np.any(np.diff(values) <= 0):
        raise error(f"{subject(name)} must be strictly increasing, but is not: sort it, and give each once.")
