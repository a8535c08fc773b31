"""Definitions of ROS messages, as bags hold them: the fields of a type in their order.

The text is that of ROS's `.msg` files, with those of the types inside behind lines of `=`:

    std_msgs/Header header
    float64[36] covariance
    ================================================================================
    MSG: std_msgs/Header
    builtin_interfaces/Time stamp
    string frame_id
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from coadjoint.errors import FileError

NUMBERS = {
    "bool": "u1", "byte": "u1", "char": "u1", "octet": "u1",
    **{f"int{bits}": f"i{bits // 8}" for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": f"u{bits // 8}" for bits in (8, 16, 32, 64)},
    "float16": "f2", "float32": "f4", "float64": "f8",
}  # fmt: skip
"""NumPy's names of the numbers of messages."""
STRING = "string"
SEQUENCE = -1
"""The count of a field whose messages state their length."""
MOST_FIELDS, DEEPEST = 20_000, 32

_PARTS = re.compile(r"^=+[ \t]*$", re.MULTILINE)
_FIELD = re.compile(r"^([\w/]+)(?:<=\d+)?(\[(?:<=)?\d*\])?\s+(\w+)(?:(\s*=)|\s|$)")


class Field(NamedTuple):
    """A field: `kind` is a number, "string" or a type; `many` None of one, else how many, or SEQUENCE."""

    name: str
    kind: str
    many: int | None = None


class Definition(NamedTuple):
    """A type of messages, `pkg/Name`, and the fields of all types that it needs."""

    name: str
    types: Mapping[str, tuple[Field, ...]]


_ROS2 = {name: (Field("sec", "int32"), Field("nanosec", "uint32")) for name in ("Time", "Duration")}
_BUILT_IN = {
    **{f"builtin_interfaces/{name}": fields for name, fields in _ROS2.items()},
    "time": (Field("sec", "uint32"), Field("nanosec", "uint32")),
    "duration": (Field("sec", "int32"), Field("nanosec", "int32")),
    "std_msgs/Header": (Field("stamp", "builtin_interfaces/Time"), Field("frame_id", STRING)),
}
"""Types that definitions may omit; `time` and `duration` are those of ROS 1."""


def short(name: str) -> str:
    """`pkg/Name` of `pkg/msg/Name`."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


def definition(name: str, text: str, where: str) -> Definition:
    """The definition of the type `name` in the text of `.msg` files.

    Raises FileError, which begins with `where`, for a text that cannot be read, types that are missing, and one that
    holds itself.
    """
    bodies = [part.strip("\n") for part in _PARTS.split(text)]
    types = dict(_BUILT_IN) | {short(name): _fields(short(name), bodies[0], where)}
    for body in bodies[1:]:
        head, _, rest = body.strip().partition("\n")
        if not head.startswith("MSG:"):
            raise FileError(f"{where}: the definition of {name} has a part without `MSG: package/Type`: {head[:40]!r}.")
        inner = short(head.removeprefix("MSG:").strip())
        types[inner] = _fields(inner, rest, where)
    found = Definition(short(name), types)
    _require_whole(found, where)
    return found


def _fields(name: str, body: str, where: str) -> tuple[Field, ...]:
    """The fields in a text, without constants."""
    found = []
    for raw in body.splitlines():
        line = raw.split("#", 1)[0].strip()
        if not line:
            continue
        match = _FIELD.match(line)
        if match is None:
            raise FileError(f"{where}: the definition of {name} has a line that is not a field: {line[:60]!r}.")
        kind, many, field, constant = match.groups()
        if constant:
            continue
        count = None if many is None else SEQUENCE if "<=" in many or many == "[]" else int(many[1:-1])
        found.append(Field(field, _kind(kind, name), count))
    return tuple(found)


def _kind(kind: str, inside: str) -> str:
    if kind in NUMBERS or kind in (STRING, "wstring", "time", "duration"):
        return kind
    if kind == "Header":
        return "std_msgs/Header"
    return short(kind) if "/" in kind else f"{inside.split('/')[0]}/{kind}"


def _require_whole(found: Definition, where: str) -> None:
    """Raise FileError for types that are missing or hold themselves, and for fields without end."""
    counted = 0

    def descend(name: str, above: tuple[str, ...]) -> None:
        nonlocal counted
        if name not in found.types:
            raise FileError(f"{where}: the definition of {found.name} lacks the type {name}.")
        if name in above or len(above) > DEEPEST:
            raise FileError(f"{where}: the definition of {found.name} holds the type {name} within itself.")
        for field in found.types[name]:
            counted += 1
            if counted > MOST_FIELDS:
                raise FileError(f"{where}: the definition of {found.name} has more than {MOST_FIELDS} fields.")
            if field.kind not in NUMBERS and field.kind not in (STRING, "wstring"):
                descend(field.kind, (*above, name))

    descend(found.name, ())


def paths(found: Definition) -> Iterator[str]:
    """The paths of all numbers of a type, as `pose.pose.position.x`; several as `covariance[]`."""

    def of(name: str, before: str) -> Iterator[str]:
        for field in found.types[name]:
            path = f"{before}{field.name}{'[]' if field.many is not None else ''}"
            if field.kind in NUMBERS:
                yield path
            elif field.kind not in (STRING, "wstring"):
                yield from of(field.kind, f"{path}.")

    return of(found.name, "")
