"""Checks of names that a user writes: each is one of those that are known, or an error names the nearest."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from functools import wraps
from inspect import unwrap
from typing import ParamSpec, TypeVar

from coadjoint.errors import ArgumentError, CoadjointError, nearest, shown
from coadjoint.units import split_name

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
Error = type[CoadjointError]


def subject(name: str) -> str:
    """The subject of a sentence on an argument; it may go on within its quotes, as "area` of the fin `rudder"."""
    return f"Argument `{name}`" if name.partition("`")[0].isidentifier() else name


def choice(value: object, name: str, words: Collection[T], error: Error = ArgumentError) -> T:
    """One of several words, the empty one being no choice; the nearest is named where one is near."""
    for word in words:
        if type(value) is type(word) and value == word:
            return word
    texts = [word for word in words if isinstance(word, str) and word]
    near = nearest(value, texts) if isinstance(value, str) else ""
    listed = [f'"{word}"' if isinstance(word, str) else str(word) for word in words if word != ""]
    hint = f": did you mean `{near}`?" if near else "."
    raise error(f"{subject(name)} must be {either(listed)}, but is {shown(value)}{hint}")


def either(words: Sequence[str]) -> str:
    """Words as a choice: "a, b or c"."""
    return " or ".join([*([", ".join(words[:-1])] if words[1:] else []), *words[-1:]])


def unknown(what: str, where: str, given: str, known: Collection[str]) -> str:
    """The sentence for a name that is not known, with the nearest one that is."""
    near = written_out(given, known) or nearest(given, known, 0.5)
    listed = ", ".join(sorted(known))
    if not listed:
        return f"{where} has no {what}: it has none."
    hint = f"did you mean `{near}`? It knows {listed}." if near else f"it knows {listed}."
    return f"{where} has no {what}: {hint}"


UNITS = {
    "kts": "knots", "kt": "knots", "knot": "knots", "mps": "m_s", "kph": "km_per_h", "kmh": "km_per_h", "sec": "s",
    "secs": "s", "second": "s", "seconds": "s", "mins": "min", "minute": "min", "minutes": "min", "hr": "h", "hrs": "h",
    "hour": "h", "hours": "h", "degs": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad",
    "foot": "ft", "feet": "ft", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "pct": "percent",
}  # fmt: skip
"""Other words for units at the end of names, and those that files know."""
SHORT = {
    "hdg": "heading", "pos": "position", "vel": "velocity", "spd": "speed", "alt": "altitude", "att": "attitude",
    "acc": "acceleration", "dur": "duration", "freq": "frequency", "temp": "temperature", "vol": "volume", "lat":
    "latitude", "lon": "longitude", "dia": "diameter", "len": "length", "dens": "density", "ctrl": "controller",
}  # fmt: skip
"""Abbreviations in names."""


def written_out(given: str, known: Collection[str]) -> str:
    """A known name, with the unit that files know, of one with abbreviations: speed_knots of `spd_kts`; else ""."""
    words = [SHORT.get(word, word) for word in given.split("_")]
    if words[-1] in UNITS:
        words[-1] = UNITS[words[-1]]
    found = "_".join(words)
    return found if found != given and split_name(found, known)[0] in known else ""


def known(name: object, names: Collection[str], what: str, where: str, error: Error = ArgumentError) -> str:
    """A name that is known: `what` it is and `where`, as known(name, there, "part", "The vehicle remus")."""
    if name not in names:
        shown_name = name if isinstance(name, str) else shown(name)
        raise error(unknown(f"{what} `{shown_name}`", where, str(name), names))
    return str(name)


def all_known(
    names: Iterable[object], there: Collection[str], what: str, where: str, error: Error = ArgumentError
) -> None:
    """Raise unless all names are known, as `known` does."""
    for name in names:
        known(name, there, what, where, error)


def letters(name: str) -> str:
    """The letters and digits of a name in lower case, by which `left-rectangle` is `LeftRectangle`."""
    return "".join(letter for letter in name.lower() if letter.isalnum())


def known_arguments(what: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorates a function that users call by keywords: raises ArgumentError for one that it does not take.

    what: the function as users write it, "co.simulate"; the nearest keyword is named.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        bare = unwrap(function)
        code, defaults, named = bare.__code__, bare.__defaults__ or (), bare.__kwdefaults__ or {}
        known = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        own = known[:1] == ("self",)
        needed = [
            *known[own : code.co_argcount - len(defaults)],
            *(k for k in known[code.co_argcount :] if k not in named),
        ]

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            for name in kwargs:
                if name not in known:
                    meant = nearest(name, known)
                    remedy = (
                        f"do you mean `{meant}`?"
                        if meant
                        else f"it takes {', '.join(k for k in known if k != 'self')}."
                    )
                    raise ArgumentError(f"{what} takes no argument `{name}`: {remedy}")
            if len(args) > code.co_argcount:
                places = f" after {', '.join(known[own : code.co_argcount])}" if code.co_argcount > own else ""
                raise ArgumentError(
                    f"{what} takes its arguments{places} by name, as in {known[code.co_argcount]}=…, but was given "
                    f"{shown(args[code.co_argcount])} without one."
                )
            missing = [name for name in needed if name not in kwargs and name not in known[: len(args)]]
            if missing:
                raise ArgumentError(
                    f"{what} needs `{'`, `'.join(missing)}`: give {', '.join(f'{k}=…' for k in missing)}."
                )
            return function(*args, **kwargs)

        return call

    return decorate
