"""Numbers of serialized ROS messages, many at a time.

A message is the fields of its type one behind the other. In CDR (ROS 2) a number of 2, 4 or 8 bytes begins at a
multiple of its size behind the four bytes of the head; in ROS 1 nothing is aligned. The length of a string or a
sequence precedes it, so that the place of a number follows from the lengths before it: messages with the same lengths
have one layout, found from the first of them, and NumPy reads all their numbers together.
"""

from __future__ import annotations

import difflib
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from coadjoint.errors import FileError
from coadjoint_vehicles.logs.bags.definitions import NUMBERS, SEQUENCE, STRING, Definition, paths

MOST_LAYOUTS = 64
"""After so many layouts that few messages have, the others are read one by one."""
_INDEX = re.compile(r"\[(\d+)\]$")


@dataclass(frozen=True)
class Block:
    """Messages of one topic in one buffer of bytes: where each begins, its size, and when it was logged, ns."""

    buffer: memoryview | bytes
    starts: np.ndarray
    sizes: np.ndarray
    times: np.ndarray

    def __len__(self) -> int:
        return len(self.starts)

    def alone(self) -> Block:
        """The messages without the bytes between them, if those are more than the messages."""
        if 2 * int(self.sizes.sum()) > len(self.buffer):
            return self
        whole = memoryview(self.buffer)
        parts = [whole[start : start + size] for start, size in zip(self.starts, self.sizes, strict=True)]
        starts = np.cumsum(self.sizes) - self.sizes
        return Block(b"".join(parts), starts, self.sizes, self.times)


@dataclass(frozen=True)
class Topic:
    """A topic of a bag: its type and how messages are written, "cdr", "ros1" or "packed", and its messages.

    divisors: by which numbers are divided that are written as integers.
    """

    name: str
    definition: Definition
    written: str
    blocks: tuple[Block, ...]
    where: str
    divisors: Mapping[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        return sum(map(len, self.blocks))

    @property
    def times(self) -> np.ndarray:
        """When each message was logged, ns, (messages,) integers."""
        return np.concatenate([np.zeros(0, np.int64), *(block.times for block in self.blocks)])

    def count(self, path: str) -> int:
        """How many values a sequence holds in the first message; 0 without messages."""
        block = next((block for block in self.blocks if len(block)), None)
        if block is None:
            return 0
        walk = _walk(self, block, 0, {"a path that nothing has"})
        return walk.counts.get(path, 0)

    def text(self, path: str) -> str:
        """A text at a path, such as `header.frame_id`, in the first message; "" where there is none."""
        block = next((block for block in self.blocks if len(block)), None)
        return "" if block is None else _walk(self, block, 0, {"a path that nothing has"}).texts.get(path, "")

    def numbers(self, wanted: Sequence[str]) -> dict[str, np.ndarray]:
        """The numbers at paths such as `pose.pose.position.x`, (messages,) each, of the type that they have.

        NaN where a sequence is too short for `data[3]`. Raises FileError for paths that the type does not have, and
        for messages that end too early.
        """
        kinds = {path: require_number(self.definition, path, f"{self.where}: {self.name}") for path in wanted}
        known: list[Layout] = []
        parts = [_read(self, block, kinds, known) for block in self.blocks]
        none = np.zeros(0)
        found = {path: np.concatenate([part[path] for part in parts]) if parts else none for path in wanted}
        return {p: values / self.divisors[p] if p in self.divisors else values for p, values in found.items()}


class Layout(NamedTuple):
    """The places of numbers in messages whose strings and sequences have given lengths, from the first byte.

    places: of each path, None where a sequence is too short for it. lengths: pairs of a place and the length there.
    end: of the bytes read. order: of bytes, "<" or ">". headed: whether a head gives that order.
    """

    places: Mapping[str, int | None]
    lengths: tuple[tuple[int, int], ...]
    end: int
    order: str
    headed: bool


def require_number(definition: Definition, path: str, where: str) -> str:
    """The kind of number at a path; raises FileError, which begins with `where`, and names the nearest paths."""
    name = definition.name
    parts = path.split(".")
    for place, part in enumerate(parts):
        index = _INDEX.search(part)
        bare = part[: index.start()] if index else part
        field = next((field for field in definition.types.get(name, ()) if field.name == bare), None)
        if field is None or (field.many is None) != (index is None):
            break
        if index and field.many is not None and SEQUENCE < field.many <= int(index[1]):
            break
        if field.kind in NUMBERS and place == len(parts) - 1:
            return NUMBERS[field.kind]
        name = field.kind
    there = list(paths(definition))
    near = difflib.get_close_matches(path, there, 3, 0.3) or there[:3]
    raise FileError(
        f"{where} is of {definition.name}, which has no number `{path}`; near to it are {', '.join(near) or 'none'}."
    )


def _read(topic: Topic, block: Block, kinds: Mapping[str, str], known: list[Layout]) -> dict[str, np.ndarray]:
    """The numbers of one block; layouts that are met are added to `known`."""
    buffer = np.frombuffer(block.buffer, np.uint8)
    found = {
        path: np.full(len(block), np.nan if kind[0] == "f" else 0, _kept(path, kind)) for path, kind in kinds.items()
    }
    left = np.arange(len(block))
    for layout in known:
        left = _taken(buffer, block, left, layout, kinds, found)
    while len(left):
        layout = _layout(topic, block, int(left[0]), kinds)
        many = len(known) < MOST_LAYOUTS
        if many:
            known.append(layout)
        rest = _taken(buffer, block, left if many else left[:1], layout, kinds, found)
        left = rest if many else left[1:]
    return found


def _kept(path: str, kind: str) -> str:
    """Integers of 64 bits stay, because no float holds them, but those of a sequence, which may be missing; other
    numbers are float64."""
    return kind if kind in ("i8", "u8") and "[" not in path else "f8"


def _taken(
    buffer: np.ndarray,
    block: Block,
    left: np.ndarray,
    layout: Layout,
    kinds: Mapping[str, str],
    found: Mapping[str, np.ndarray],
) -> np.ndarray:
    """Read the messages `left` that have a layout; which of them have another one."""
    left_sizes = block.sizes[left]
    fits = left_sizes >= layout.end
    rows = left[fits]
    starts = block.starts[rows]
    same = np.ones(len(rows), bool)
    for place, length in layout.lengths:
        same &= at_any_byte(buffer, f"{layout.order}u4", starts + place) == length
    if layout.headed:
        same &= buffer[starts + 1] == (layout.order == "<")
    rows, starts = rows[same], starts[same]
    for path, place in layout.places.items():
        if place is None:
            found[path][rows] = np.nan
        else:
            found[path][rows] = at_any_byte(buffer, f"{layout.order}{kinds[path]}", starts + place)
    fits[fits] = same
    return left[~fits]


def at_any_byte(buffer: np.ndarray, kind: str, places: np.ndarray) -> np.ndarray:
    """The numbers that begin at any bytes."""
    size = np.dtype(kind).itemsize
    if len(buffer) < size:
        return np.zeros(0, kind)
    return np.ndarray((len(buffer) - size + 1,), kind, buffer, strides=(1,))[places]


def _layout(topic: Topic, block: Block, row: int, kinds: Mapping[str, str]) -> Layout:
    """The layout of one message; raises FileError where it ends too early."""
    walk = _walk(topic, block, row, set(kinds))
    places = {path: walk.places.get(path) for path in kinds}
    return Layout(places, tuple(walk.lengths), walk.at, walk.order, walk.aligned)


def _walk(topic: Topic, block: Block, row: int, wanted: set[str]) -> _Walk:
    """The way through one message; raises FileError where it ends too early."""
    start, size = int(block.starts[row]), int(block.sizes[row])
    walk = _Walk(topic, memoryview(block.buffer)[start : start + size], row, wanted)
    walk.message(topic.definition.name, "")
    return walk


class _Walk:
    """The way through a message, field by field, until all that is wanted was found."""

    def __init__(self, topic: Topic, content: memoryview, row: int, wanted: set[str]):
        self.topic, self.content, self.row, self.wanted = topic, content, row, wanted
        self.places: dict[str, int] = {}
        self.lengths: list[tuple[int, int]] = []
        self.counts: dict[str, int] = {}
        self.texts: dict[str, str] = {}
        self.aligned = topic.written == "cdr"
        self.order, self.at = "<", 0
        if self.aligned:
            self.at = 4
            head = bytes(content[:4])
            if len(head) < 4 or head[0] != 0 or head[1] > 1:
                raise self.wrong(f"begins with {head.hex() or 'nothing'}, which is not plain CDR")
            self.order = "<" if head[1] else ">"

    def wrong(self, what: str) -> FileError:
        topic = self.topic
        return FileError(f"{topic.where}: message {self.row + 1} of {topic.name} ({topic.definition.name}) {what}.")

    @property
    def done(self) -> bool:
        return len(self.places) == len(self.wanted)

    def message(self, name: str, before: str) -> None:
        fields = self.topic.definition.types[name]
        if not fields and self.aligned:
            self.forward(1)
        for one in fields:
            if self.done:
                return
            self.field(one.kind, one.many, f"{before}{one.name}")

    def field(self, kind: str, count: int | None, path: str) -> None:
        if count == SEQUENCE:
            count = self.counts[path] = self.length()
        if count is not None and count > len(self.content):
            raise self.wrong(f"says that `{path}` holds {count} values, which is more than it has bytes")
        if kind in NUMBERS:
            self.number(NUMBERS[kind], count, path)
            return
        for index in range(1 if count is None else count):
            if kind == STRING:
                self.forward(size := self.length())
                said = bytes(self.content[self.at - size : self.at])
                self.texts[path] = said.rstrip(b"\0").decode("utf-8", "replace")
            elif kind == "wstring":
                raise self.wrong(f"has wide text in `{path}`, which is not read")
            else:
                self.message(kind, f"{path}." if count is None else f"{path}[{index}].")
            if self.done:
                return

    def number(self, kind: str, count: int | None, path: str) -> None:
        size = int(kind[1])
        if count != 0:
            self.align(size)
        if count is None:
            if path in self.wanted:
                self.places[path] = self.at
            self.forward(size)
            return
        begin = self.at
        self.forward(size * count)
        for name in self.wanted:
            if name.startswith(f"{path}["):
                index = int(name[len(path) + 1 : -1])
                if index < count:
                    self.places[name] = begin + size * index

    def length(self) -> int:
        self.align(4)
        begin = self.at
        self.forward(4)
        (count,) = struct.unpack_from(f"{self.order}I", self.content, begin)
        self.lengths.append((begin, count))
        return count

    def align(self, size: int) -> None:
        if self.aligned:
            self.at += (4 - self.at) % size

    def forward(self, size: int) -> None:
        self.at += size
        if self.at > len(self.content):
            raise self.wrong(f"ends after {len(self.content)} bytes, in the midst of its fields")
