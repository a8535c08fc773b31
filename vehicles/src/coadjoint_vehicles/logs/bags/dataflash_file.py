"""Logs of ArduPilot's flight software, `.BIN`: messages that the file itself defines.

A message is the bytes A3 95, a byte for its kind, and its numbers without gaps. Messages of the kind 80, `FMT`, give
name, length and columns of the others; `FMTU` names the column with the instance of the sensor.
"""

from __future__ import annotations

import mmap
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from coadjoint.errors import FileError
from coadjoint_vehicles.logs.bags.bag import TopicLog
from coadjoint_vehicles.logs.bags.definitions import Definition, Field
from coadjoint_vehicles.logs.bags.messages import Block, Topic, at_any_byte

HEAD = b"\xa3\x95"
MOST_STRANGE = 0.01
"""The share of a file that may be no message: blocks are erased in part, and the last message is cut off."""
LARGEST = 1_000_000_000
"""The most bytes of a file; messages of seven bytes take six times as much memory."""
_FMT, _LONGEST = 0x80, 89
_KINDS = {
    "b": "int8", "B": "uint8", "M": "uint8", "h": "int16", "H": "uint16", "i": "int32", "I": "uint32", "f": "float32",
    "d": "float64", "q": "int64", "Q": "uint64", "g": "float16", "c": "int16", "C": "uint16", "e": "int32",
    "E": "uint32", "L": "int32",
}  # fmt: skip
_DIVISORS = {**dict.fromkeys("cCeE", 100.0), "L": 1e7}
_TEXTS = {"n": 4, "N": 16, "Z": 64}


@dataclass(frozen=True)
class Format:
    """A kind of messages: its name, length with the head, and the columns with their letters."""

    name: str
    length: int
    letters: str
    columns: tuple[str, ...]

    @property
    def definition(self) -> Definition:
        fields = [Field("head", "uint8", 3)]
        for name, letter in zip(self.columns, self.letters, strict=True):
            if letter in _TEXTS:
                fields.append(Field(name, "uint8", _TEXTS[letter]))
            else:
                fields.append(Field(name, "int16", 32) if letter == "a" else Field(name, _KINDS[letter]))
        return Definition(self.name, {self.name: tuple(fields)})

    @property
    def divisors(self) -> dict[str, float]:
        pairs = zip(self.columns, self.letters, strict=True)
        return {name: _DIVISORS[letter] for name, letter in pairs if letter in _DIVISORS}


def read_dataflash(path: Path, wanted: Callable[[str, str], bool], partial: bool = False) -> TopicLog:
    """A log of ArduPilot with the messages of those topics for which `wanted(topic, type)` is true.

    partial: without effect, since these files have no end that could be missing. Raises FileError for files that are
    not such logs or are larger than `LARGEST`, and for those of which more than a hundredth are not messages.
    """
    require_short(path, LARGEST)
    with path.open("rb") as opened:
        head = opened.read(3)
        if head != HEAD + bytes([_FMT]):
            what = "is empty" if not head else f"begins with {head.hex(' ')}"
            raise FileError(f"The file {path} is not a log of ArduPilot: it {what}, but must begin with a3 95 80.")
        content = mmap.mmap(opened.fileno(), path.stat().st_size, access=mmap.ACCESS_READ)
    scan = _Scan(path, content)
    scan.all()
    found = TopicLog(str(path))
    if scan.strange > 600 + MOST_STRANGE * len(content):
        raise FileError(f"The log {path} is damaged: {scan.strange} of its {len(content)} bytes are not a message.")
    if scan.strange:
        found.notes.append(f"{scan.strange} bytes are not a message, and are passed over.")
    for kind, made in scan.formats.items():
        if made.name not in ("FMT", "FMTU", "UNIT", "MULT") and scan.starts[kind]:
            for topic in scan.topics(kind, made):
                found.found[topic.name] = topic if wanted(topic.name, made.name) else _empty(topic)
    return found


def require_short(path: Path, most: int) -> None:
    """Raise FileError for a log of more bytes, before any of them is read."""
    if path.stat().st_size > most:
        raise FileError(
            f"The log {path} is larger than the {most / 1e6:.0f} MB up to which such logs are read: cut it into parts."
        )


def _empty(topic: Topic) -> Topic:
    return Topic(topic.name, topic.definition, topic.written, (), topic.where)


class _Scan:
    """A file on its way from the first message to the last: where those of each kind begin."""

    def __init__(self, path: Path, content: mmap.mmap):
        self.path, self.content = path, content
        self.formats = {_FMT: Format("FMT", _LONGEST, "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))}
        self.starts = [array("q") for _ in range(256)]
        self.instance: dict[int, str] = {}
        self.strange = 0

    def all(self) -> None:
        content, starts = self.content, self.starts
        lengths = [0] * 256
        lengths[_FMT] = _LONGEST
        units = -1
        at, end = 0, len(content)
        while at + 3 <= end:
            kind = content[at + 2]
            length = lengths[kind]
            if content[at] != 0xA3 or content[at + 1] != 0x95 or not length:
                after = content.find(HEAD, at + 1)
                after = end if after < 0 else after
                self.strange += after - at
                at = after
                continue
            if at + length > end:
                self.strange += end - at
                return
            starts[kind].append(at)
            if kind == _FMT:
                number, made = self.format(content[at : at + length])
                self.formats[number] = made
                lengths[number] = made.length
                units = number if made.name == "FMTU" else units
            elif kind == units:
                self.units(content[at + 3 : at + length])
            at += length

    def format(self, content: bytes) -> tuple[int, Format]:
        number, length = content[3], content[4]
        name, letters, columns = (_text(content[a:b]) for a, b in ((5, 9), (9, 25), (25, 89)))
        made = Format(name, length, letters, tuple(column for column in columns.split(",") if column))
        size = 3 + sum(map(_size, letters))
        if size != length or len(made.columns) != len(letters) or (number == _FMT and length != _LONGEST):
            raise FileError(
                f"The log {self.path} is damaged: its definition of `{name}`, {letters!r} of {length} bytes with the "
                f"columns {columns!r}, does not fit together."
            )
        return number, made

    def units(self, content: bytes) -> None:
        """`FMTU`, a time, a kind, units and factors: the unit `#` marks the column with the instance."""
        if len(content) < 25:
            raise FileError(f"The log {self.path} is damaged: its units, FMTU, have {len(content)} bytes of 25.")
        kind, units = content[8], _text(content[9:25])
        made = self.formats.get(kind)
        if made is not None and "#" in units and units.index("#") < len(made.columns):
            self.instance[kind] = made.columns[units.index("#")]

    def topics(self, kind: int, made: Format) -> list[Topic]:
        """The topics of a kind, one for each instance."""
        starts = np.frombuffer(self.starts[kind], np.int64)
        whole = memoryview(self.content)
        clock = next((name for name in ("TimeUS", "TimeMS") if name in made.columns), None)
        if clock is None:
            return []
        letter = dict(zip(made.columns, made.letters, strict=True))
        place = 3 + sum(map(_size, made.letters[: made.columns.index(clock)]))
        buffer = np.frombuffer(whole, np.uint8)
        ticks = at_any_byte(buffer, "<u8" if letter[clock] == "Q" else "<u4", starts + place)
        times = ticks.astype(np.int64) * (1000 if clock == "TimeUS" else 1_000_000)
        block = Block(whole, starts, np.full(len(starts), made.length), times)
        topic = Topic(made.name, made.definition, "packed", (block,), str(self.path), made.divisors)
        if kind not in self.instance:
            return [topic]
        instance = topic.numbers([self.instance[kind]])[self.instance[kind]]
        found = []
        for number in np.unique(instance):
            own = instance == number
            part = Block(whole, starts[own], block.sizes[own], times[own])
            name = f"{made.name}[{int(number)}]"
            found.append(Topic(name, made.definition, "packed", (part,), str(self.path), made.divisors))
        return found


def _size(letter: str) -> int:
    """The bytes of a column; more than any message has of a letter that is not known."""
    if letter in _KINDS:
        return np.dtype(_KINDS[letter]).itemsize
    return {"a": 64, **_TEXTS}.get(letter, 1000)


def _text(content: bytes) -> str:
    return content.split(b"\0", 1)[0].decode("ascii", "replace")
