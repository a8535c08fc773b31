"""Checks of arguments at public entry points: each returns the value in its final type, or raises one sentence.

`name` is that of the argument, `steps` for "Argument `steps` must …"; what is no identifier stands for itself, as
"[run] steps". `error` is the type that is raised, by default ArgumentError. Functions inside the library take what has
passed here and check nothing again.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches
from numbers import Integral, Real
from typing import Any, TypeVar

from coadjoint.errors import ArgumentError, CoadjointError, shown

T = TypeVar("T")
Error = type[CoadjointError]

MOST = 2**53
"""Up to here every whole number is a float64."""


def subject(name: str) -> str:
    """The subject of a sentence on an argument."""
    return f"Argument `{name}`" if name.isidentifier() else name


def is_number(value: object) -> bool:
    """Whether a value is one real number, of Python or of NumPy; truth values and durations are none."""
    return isinstance(value, Real) and not isinstance(value, bool) and not _is_duration(value)


def is_whole(value: object) -> bool:
    """Whether a value is one whole number, of Python or of NumPy; 3.0 is none."""
    return isinstance(value, Integral) and not isinstance(value, bool) and not _is_duration(value)


def _is_duration(value: object) -> bool:
    return type(value).__name__ == "timedelta64"


def whole(value: object, name: str, least: int = 1, most: int | None = None, error: Error = ArgumentError) -> int:
    """A whole number from `least`, by default 1, to `most`, by default 2⁵³."""
    if not is_whole(value) or value < least or (most is not None and value > most):  # pyright: ignore[reportOperatorIssue]
        bounds = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise error(f"{subject(name)} must be a whole number {bounds}, but is {shown(value)}.")
    found = int(value)  # pyright: ignore[reportArgumentType]
    if found > MOST:
        raise error(f"{subject(name)} must be at most 2⁵³ = {MOST}, but is {shown(value)}.")
    return found


def number(
    value: object,
    name: str,
    least: float = -math.inf,
    most: float = math.inf,
    above: float = -math.inf,
    below: float = math.inf,
    error: Error = ArgumentError,
) -> float:
    """A finite number with least ≤ value ≤ most and above < value < below."""
    found = _float(value)
    if least <= found <= most and above < found < below and math.isfinite(found):
        return found
    raise error(f"{subject(name)} must be {_bounds(least, most, above, below)}, but is {shown(value)}.")


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
    words = []
    if above == 0 and below == most == math.inf:
        return "positive"
    if least > -math.inf and most < math.inf:
        return f"a number from {least:g} to {most:g}"
    if above > -math.inf and below < math.inf:
        return f"a number between {above:g} and {below:g}"
    words += [f"of at least {least:g}"] * (least > -math.inf) + [f"of at most {most:g}"] * (most < math.inf)
    words += [f"above {above:g}"] * (above > -math.inf) + [f"below {below:g}"] * (below < math.inf)
    return f"a number {' and '.join(words)}" if words else "a finite number"


def truth(value: object, name: str, error: Error = ArgumentError) -> bool:
    """True or False, of Python or of NumPy; 0 and 1 are neither."""
    if type(value).__name__ not in ("bool", "bool_") or getattr(value, "shape", ()) != ():
        raise error(f"{subject(name)} must be True or False, but is {shown(value)}.")
    return bool(value)


def text(value: object, name: str, error: Error = ArgumentError) -> str:
    """A text that is not empty."""
    if not isinstance(value, str) or not value:
        raise error(f"{subject(name)} must be a text, but is {shown(value)}.")
    return value


def choice(value: object, name: str, words: Sequence[T], error: Error = ArgumentError) -> T:
    """One of several words, the empty one being no choice; the nearest is named where one is near."""
    for word in words:
        if type(value) is type(word) and value == word:
            return word
    texts = [word for word in words if isinstance(word, str) and word]
    near = get_close_matches(value, texts, 1) if isinstance(value, str) else []
    listed = [f'"{word}"' if isinstance(word, str) else str(word) for word in words if word != ""]
    hint = f": did you mean `{near[0]}`?" if near else "."
    raise error(f"{subject(name)} must be {either(listed)}, but is {shown(value)}{hint}")


def either(words: Sequence[str]) -> str:
    """Words as a choice: "a, b or c"."""
    return " or ".join([*([", ".join(words[:-1])] if words[1:] else []), *words[-1:]])


def unknown(what: str, where: str, given: str, known: Collection[str]) -> str:
    """The sentence for a name that is not known, with the nearest one that is."""
    near = get_close_matches(given, list(known), n=1, cutoff=0.5)
    listed = ", ".join(sorted(known))
    if not listed:
        return f"{where} has no {what}: it has none."
    hint = f"did you mean `{near[0]}`? It knows {listed}." if near else f"it knows {listed}."
    return f"{where} has no {what}: {hint}"


def letters(name: str) -> str:
    """The letters and digits of a name in lower case, by which `left-rectangle` is `LeftRectangle`."""
    return "".join(letter for letter in name.lower() if letter.isalnum())


def instance(value: object, name: str, kind: type[T], words: str, error: Error = ArgumentError) -> T:
    """An object of a class; `words` say what is expected, as "a co.System"."""
    if not isinstance(value, kind):
        raise error(f"{subject(name)} must be {words}, but is {shown(value)}.")
    return value


def mapping(
    value: object, name: str, words: str = "a dictionary of name → value", error: Error = ArgumentError
) -> Mapping[str, Any]:
    """A mapping whose keys are texts."""
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise error(f"{subject(name)} must be {words}, but is {shown(value)}.")
    return value
