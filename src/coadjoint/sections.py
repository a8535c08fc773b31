"""Sections of TOML files as dataclasses: each field declares what its key measures, its check and its meaning.

    @dataclass(frozen=True)
    class RunSection:
        dt: float = key("length of a step", TIME, check=positive)
        duration: float | None = key("simulated time", TIME, default=None)

`read` makes such a section of a table whose keys may end in a unit (`duration_min = 10`); `written` is the table that
reads as a section. A field with an underscore at its end, as `from_`, is the key without it, which Python reserves.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, field, fields
from types import UnionType
from typing import Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import choice, either, unknown
from coadjoint.errors import ArgumentError
from coadjoint.texts import Table
from coadjoint.units import NUMBER, Dimension, dimension_of, ending, factor_to, split_name, times

T = TypeVar("T")

_KEY = "key"
"""The metadata of a field that hold its `Key`."""


@dataclass(frozen=True)
class Key:
    """The description of a field of a section.

    meaning: a text for help and pages. dimension: the physical dimension of its numbers; None if they have several
    dimensions, in SI units, or are not numbers. check: (value, name) → the value, or ArgumentError. words: the allowed
    texts. turn: (value, axes) → the value in forward, starboard, down. others: further names of the field in files.
    rest: whether the field is a dictionary of all keys that the section does not declare. needs_unit: whether the key
    must end in its unit, so that SI units are not assumed.
    """

    meaning: str = ""
    dimension: Dimension | None = None
    check: Callable[[Any, str], Any] | None = None
    words: tuple[str, ...] = ()
    turn: Callable[[Any, Any], Any] | None = None
    others: tuple[str, ...] = ()
    rest: bool = False
    needs_unit: bool = False


def key(
    meaning: str = "",
    dimension: Dimension | None = None,
    *,
    check: Callable[[Any, str], Any] | None = None,
    words: tuple[str, ...] = (),
    turn: Callable[[Any, Any], Any] | None = None,
    others: tuple[str, ...] = (),
    rest: bool = False,
    needs_unit: bool = False,
    default: object = MISSING,
    factory: Callable[[], Any] | None = None,
) -> Any:
    """A field of a dataclass that declares its `Key`; `default` and `factory` are those of `dataclasses.field`."""
    metadata = {_KEY: Key(meaning, dimension, check, words, turn, others, rest, needs_unit)}
    if factory is not None:
        return field(default_factory=factory, metadata=metadata)
    return field(default=default, metadata=metadata)


def keys(of: Any) -> dict[str, Key]:
    """The keys of a dataclass, or of one of it, by the names of fields, in their order."""
    return {f.name: f.metadata[_KEY] for f in fields(of) if _KEY in f.metadata}


@contextmanager
def of_section(title: str) -> Iterator[None]:
    """Inside this context, errors of an argument `velocity` are those of `water.velocity`, a key of the section."""
    try:
        yield
    except ArgumentError as error:
        said = str(error)
        if not said.startswith("Argument `"):
            raise
        raise ArgumentError(f"`{title}.{said.removeprefix('Argument `')}") from error


class KeyRow(NamedTuple):
    """A key as pages and commands list it: its name in files, SI unit, default, meaning.

    default: as in files, "needed" for a key that must be given, "" for one that has no value unless given.
    """

    key: str
    unit: str
    default: str
    meaning: str


def rows(kind: type) -> list[KeyRow]:
    """The keys of a section in their order; `NAME` stands for keys that it does not declare.

    The meaning is that of the key, or what the docstring of the class, or of one above it, says as "name: meaning.".
    """
    declared = [(f, _of(f)) for f in fields(kind) if _KEY in f.metadata]
    return [
        KeyRow("NAME" if key.rest else in_file(f.name), _unit(key), _default(f), _meaning(kind, f.name, key))
        for f, key in declared
    ]


def _unit(declared: Key) -> str:
    return "" if declared.dimension in (None, NUMBER) else declared.dimension.si


def _meaning(kind: type, name: str, declared: Key) -> str:
    texts = [" ".join((one.__doc__ or "").split()) for one in kind.__mro__[:-1]]
    said = re.compile(rf"(?<![\w-])(?:\w+, )*{name}(?:, \w+)*: (.+?)(?=; [\w, ]+: |\. |\.$)")
    found = declared.meaning or next((match[1] for text in texts if (match := said.search(text))), "")
    words = either([f'"{word}"' for word in declared.words if word]) if declared.words else ""
    return found if not words or words in found else ": ".join(filter(None, [found, words]))


def _default(f: Field[Any]) -> str:
    if f.default is f.default_factory is MISSING:
        return "needed"
    value = f.default if f.default_factory is MISSING else f.default_factory()
    if isinstance(value, float):
        return "" if math.isinf(value) else f"{value:g}"
    absent = value is None or (isinstance(value, (str, tuple, list, dict)) and not value)
    return "" if absent else json.dumps(value, ensure_ascii=False)


def in_file(field_name: str) -> str:
    """The key in files of a field."""
    return field_name.removesuffix("_")


def checked(declared: Key, value: object, name: str) -> PyTree:
    """A value after the check of its key; raises ArgumentError with `name`."""
    if declared.words:
        return choice(value, name, declared.words)
    return value if declared.check is None else declared.check(value, name)


def read(kind: type[T], title: str, given: object, **more: object) -> T:
    """The section `kind` of a table of a file; `title` as in [title]. more: fields that are not keys.

    Raises ArgumentError for a value that is not a table, for an unknown key, naming the nearest known one, for a unit
    of another dimension, for a value of another type, and for a key that is given twice or missing.
    """
    given = checks.instance(given, f"[{title}]", Mapping, "a section of a file, with keys")
    declared = {f.name: f for f in fields(kind) if _KEY in f.metadata}  # pyright: ignore[reportArgumentType]
    types = get_type_hints(kind)
    rest = next((name for name, f in declared.items() if _of(f).rest), None)
    named = {other: name for name, f in declared.items() for other in (in_file(name), *_of(f).others) if name != rest}
    own, free = (given, {}) if rest is None else _apart(given, named)
    measured = {other: _of(declared[name]).dimension for other, name in named.items()}
    for name in own:
        if name in named and (unit := _of(declared[named[name]])).needs_unit:
            end = ending(unit.dimension.si if unit.dimension else "1")
            raise ArgumentError(f"Key `{name}` of section [{title}] needs its unit at its end, as in `{name}{end}`.")
    values: Table = {} if rest is None else {rest: free}
    for other, value in in_si(title, own, named, measured).items():
        name = named[other]
        if name in values:
            raise ArgumentError(f"Section [{title}] gives `{in_file(name)}` twice: once as `{other}`.")
        where = f"[{title}] {in_file(name)}"
        values[name] = checked(_of(declared[name]), _typed(where, value, types[name]), where)
    missing = [name for name, f in declared.items() if name not in values and f.default is f.default_factory is MISSING]
    if missing:
        raise ArgumentError(f"Section [{title}] needs `{in_file(missing[0])}`{_said(_of(declared[missing[0]]))}.")
    return kind(**values, **more)


def written(of: object) -> Table:
    """The table that reads as a section, in SI units."""
    found = {in_file(name): getattr(of, name) for name in keys(of)}
    return {name: value for name, value in found.items() if value is not None}


def in_si(
    title: str, given: Mapping[str, Any], known: Collection[str], measured: Mapping[str, Dimension | None]
) -> Table:
    """The values of a table under their known names, in SI units.

    measured: name → physical dimension, where known; None for values in SI units only. Raises ArgumentError for an
    unknown key, naming the nearest known one, for a unit of another dimension, and for a value given twice.
    """
    found: Table = {}
    for name_in_file, value in given.items():
        name, unit = split_name(name_in_file, known)
        if name not in known:
            raise ArgumentError(unknown(f"key `{name_in_file}`", f"Section [{title}]", name_in_file, known))
        if name in found:
            raise ArgumentError(
                f"Section [{title}] gives `{name}` twice: once as `{name_in_file}`, once in another unit."
            )
        found[name] = value if not unit else _converted(title, name_in_file, value, unit, name, measured)
    return found


def without_unit(name: str) -> str:
    """The name of a key without the unit that it ends in."""
    return split_name(name)[0]


def _of(f: Field[Any]) -> Key:
    return f.metadata.get(_KEY, Key())


def _said(declared: Key) -> str:
    unit = "" if declared.dimension is None else f", in {declared.dimension.si}"
    return f", {declared.meaning}{unit}" if declared.meaning else unit


def _apart(given: Mapping[str, object], known: Collection[str]) -> tuple[Table, Table]:
    """The keys that a section declares, and all others."""
    own = {name: value for name, value in given.items() if split_name(name, known)[0] in known}
    return own, {name: value for name, value in given.items() if name not in own}


def _converted(
    title: str, in_file: str, value: object, unit: str, name: str, measured: Mapping[str, Dimension | None]
) -> PyTree:
    wanted = measured.get(name, dimension_of(unit))
    _require_numbers(f"[{title}] {in_file}", value)
    try:
        if wanted is not None:
            return times(value, factor_to(wanted, unit, in_file))
    except ArgumentError:
        pass
    raise ArgumentError(
        f"Key `{in_file}` of section [{title}] ends in a unit of {dimension_of(unit).word}, but `{name}` measures "
        f"{wanted.word if wanted else 'what is in SI units only'}."
    )


def _require_numbers(what: str, value: object) -> None:
    if isinstance(value, list):
        for inner in value:
            _require_numbers(what, inner)
    elif isinstance(value, (bool, str)) or not hasattr(value, "__rmul__"):  # co.each can be multiplied, too
        raise ArgumentError(f"{what} must hold numbers, because its name ends in a unit, but holds {value!r}.")


_WORDS = {
    float: "a number",
    int: "a whole number",
    str: "a text",
    bool: "true or false",
    list[str]: "a list of texts",
    tuple[float, ...]: "a list of numbers",
}


def _typed(what: str, value: object, expected: object) -> PyTree:
    """`value` as one of the expected types; an integer counts as a number, true and false do not.

    The check of the key handles types that TOML does not have.
    """
    choices = get_args(expected) if get_origin(expected) in (Union, UnionType) else (expected,)
    plain = [one for one in choices if one is not type(None)]
    if any(one not in _WORDS for one in plain):
        return value
    for one in plain:
        if one is float and isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
        if one is int and isinstance(value, float) and value.is_integer():
            return int(value)
        if one == tuple[float, ...] and isinstance(value, list) and all(type(inner) in (int, float) for inner in value):
            return tuple(float(inner) for inner in value)
        if one == list[str] and isinstance(value, list) and all(isinstance(inner, str) for inner in value):
            return value
        if one in (int, str, bool) and isinstance(value, one) and isinstance(value, bool) == (one is bool):
            return value
    raise ArgumentError(f"{what} must be {' or '.join(_WORDS[one] for one in plain)}, but is {value!r}.")
