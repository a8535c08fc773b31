"""MCAP files: their topics with the messages, chunk by chunk.

An MCAP file is a row of records, each a byte for its kind, eight for its length and the content; a chunk is a row of
records, compressed. They are read from the first to the last, so that a file needs no index.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import FileError, told
from coadjoint.vehicles.logs.bags.definitions import Definition, definition, short
from coadjoint.vehicles.logs.bags.messages import Block, Topic
from coadjoint.vehicles.logs.bags.optional import library

MAGIC = b"\x89MCAP0\r\n"
LARGEST_CHUNK, MOST_TIMES = 256_000_000, 1000
"""The most bytes of a chunk, and how many times as large as the file what it holds may be."""
_HEAD, _MESSAGE = struct.Struct("<BQ"), struct.Struct("<BQHIQQ")
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE_KIND, _CHUNK, _METADATA, _DATA_END = 2, 3, 4, 5, 6, 12, 15


class McapChannel(NamedTuple):
    """A row of messages: the topic, its type, how they are written, and the definition of the type."""

    topic: str
    type: str
    written: str
    format: str
    text: bytes


@dataclass
class Mcap:
    """What an MCAP file holds: its channels by their numbers, their messages, and its metadata."""

    path: str
    channels: dict[int, McapChannel] = field(default_factory=dict)
    blocks: dict[int, list[Block]] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def topics(self) -> dict[str, tuple[str, int]]:
        """Type and number of messages of every topic."""
        return {c.topic: (c.type, sum(map(len, self.blocks.get(n, ())))) for n, c in self.channels.items()}

    def topic(self, name: str) -> Topic:
        """A topic with its messages; raises FileError for one that is not there or that is written in other ways."""
        numbers = [number for number, channel in self.channels.items() if channel.topic == name]
        channel = self.channels[numbers[0]]
        if any(self.channels[n].type != channel.type or self.channels[n].text != channel.text for n in numbers):
            raise FileError(f"{self.path}: {name} has messages of two types, {channel.type} among them.")
        blocks = tuple(block for number in numbers for block in self.blocks.get(number, ()))
        return Topic(name, self._definition(channel), channel.written, blocks, self.path)

    def _definition(self, channel: McapChannel) -> Definition:
        where = f"{self.path}: {channel.topic}"
        if channel.written not in ("cdr", "ros1"):
            raise FileError(
                f'{where} is written in "{channel.written}", but what is read is "cdr" of ROS 2 and "ros1".'
            )
        if channel.format not in ("ros2msg", "ros1msg"):
            raise FileError(f'{where} is defined in "{channel.format}", but what is read is "ros2msg" and "ros1msg".')
        try:
            text = channel.text.decode()
        except UnicodeDecodeError as error:
            raise FileError(f"{where}: the definition of {channel.type} is not a text in UTF-8.") from error
        return definition(channel.type, text, where)


def read_mcap(path: Path, wanted: Callable[[str, str], bool], partial: bool = False) -> Mcap:
    """An MCAP file with the messages of those topics for which `wanted(topic, type)` is true.

    partial: of a file that ends too early take what is whole. Raises FileError for files that are no MCAP, are damaged
    or are not closed, and for chunks that are larger than any that is written.
    """
    library("mcap", "Reading MCAP")
    with path.open("rb") as opened:
        size = path.stat().st_size
        head = opened.read(len(MAGIC))
        if head != MAGIC:
            what = "is empty" if not head else f"begins with {head.hex(' ')}"
            raise FileError(f"The file {path} is no MCAP: it {what}, but must begin with {MAGIC.hex(' ')}.")
        content = memoryview(mmap.mmap(opened.fileno(), size, access=mmap.ACCESS_READ))
    return _Reading(path, content, wanted, partial).all()


class _Reading:
    """A file on its way from the first record to the last."""

    def __init__(self, path: Path, content: memoryview, wanted: Callable[[str, str], bool], partial: bool):
        self.path, self.content, self.asked, self.partial = path, content, wanted, partial
        self.found = Mcap(str(path))
        self.schemas: dict[int, tuple[str, str, bytes]] = {0: ("", "", b"")}
        self.wanted: set[int] = set()
        self.opened = 0

    def wrong(self, at: int, what: str) -> FileError:
        return FileError(f"The MCAP file {self.path} is damaged at byte {at}: {what}.")

    def all(self) -> Mcap:
        """All records; raises FileError."""
        ended = self.rows(self.content, len(MAGIC), 0)
        if not ended and not self.partial:
            raise FileError(
                f"The MCAP file {self.path} was not closed: it ends after {len(self.content)} bytes without its end. "
                "Repair it by `mcap recover`, or read what is whole with partial=True or --partial."
            )
        if not ended:
            self.found.notes.append("The file was not closed: what is behind its last whole chunk is lost.")
        return self.found

    def rows(self, content: memoryview, at: int, base: int, inside: bool = False) -> bool:
        """The records of a file or of a chunk; whether the end of a file was there."""
        rows: dict[int, list[tuple[int, int, int]]] = {}
        end = len(content)
        try:
            while at < end:
                kind, length = _HEAD.unpack_from(content, at) if at + 9 <= end else (0, end)
                start = at + 9
                if start + length > end:
                    if not inside:
                        return False
                    raise self.wrong(base or at, "a record goes on behind the end of its chunk")
                if kind == _MESSAGE_KIND:
                    self.message(content, at, length, rows)
                elif kind in (_DATA_END, _FOOTER) and not inside:
                    return True
                else:
                    self.record(kind, content[start : start + length], at, inside)
                at = start + length
            return inside
        finally:
            for number, found in rows.items():
                table = np.array(found, np.int64).reshape(-1, 3)
                block = Block(content, table[:, 0], table[:, 1], table[:, 2])
                self.found.blocks.setdefault(number, []).append(block.alone() if inside else block)

    def message(self, content: memoryview, at: int, length: int, rows: dict[int, list[tuple[int, int, int]]]) -> None:
        if length < 22:
            raise self.wrong(at, f"a message has {length} bytes")
        _, _, number, _, time, _ = _MESSAGE.unpack_from(content, at)
        if number in self.wanted:
            if time > 2**63 - 1:
                raise self.wrong(at, f"a message of {self.found.channels[number].topic} is of no time, {time} ns")
            rows.setdefault(number, []).append((at + 31, length - 22, time))
        elif number not in self.found.channels:
            raise self.wrong(at, f"a message is of the channel {number}, which comes nowhere before it")

    def record(self, kind: int, content: memoryview, at: int, inside: bool) -> None:
        try:
            if kind == _SCHEMA:
                self.schema(content)
            elif kind == _CHANNEL:
                self.channel(content, at)
            elif kind == _CHUNK and not inside:
                self.chunk(content, at)
            elif kind == _METADATA:
                name, rest = _text(content)
                self.found.metadata[name] = dict(_pairs(rest))
            elif kind == 0:
                raise self.wrong(at, "a record is of no kind")
        except (struct.error, UnicodeDecodeError) as error:
            raise self.wrong(at, f"a record of kind {kind} cannot be read ({told(error)})") from error

    def schema(self, content: memoryview) -> None:
        (number,) = struct.unpack_from("<H", content)
        name, rest = _text(content[2:])
        written, rest = _text(rest)
        self.schemas[number] = name, written, bytes(_long(rest)[0])

    def channel(self, content: memoryview, at: int) -> None:
        number, schema = struct.unpack_from("<HH", content)
        topic, rest = _text(content[4:])
        written, _ = _text(rest)
        if schema not in self.schemas:
            raise self.wrong(at, f"the topic {topic} is of the schema {schema}, which comes nowhere before it")
        made = McapChannel(topic, self.schemas[schema][0], written, *self.schemas[schema][1:])
        if self.found.channels.setdefault(number, made) != made:
            raise self.wrong(at, f"the channel {number} is {self.found.channels[number].topic} and {topic}")
        if self.asked(topic, short(made.type)):
            self.wanted.add(number)

    def chunk(self, content: memoryview, at: int) -> None:
        _, _, size, sum_ = struct.unpack_from("<QQQI", content)
        compression, rest = _text(content[28:])
        data, _ = _long(rest, "<Q")
        self.opened += size
        if size > LARGEST_CHUNK or self.opened > MOST_TIMES * len(self.content):
            raise self.wrong(at, f"a chunk says that it holds {size} bytes, more than any log does")
        plain = self.decompressed(compression, data, size, at)
        if sum_ and zlib.crc32(plain) != sum_:
            raise self.wrong(at, "a chunk is not what its checksum says")
        self.rows(plain, 0, at, inside=True)

    def decompressed(self, compression: str, data: memoryview, size: int, at: int) -> memoryview:
        if compression == "":
            plain: Any = data
        elif compression not in ("zstd", "lz4"):
            raise self.wrong(at, f'a chunk is compressed by "{compression}", but zstd and lz4 are read')
        else:
            try:
                plain = _zstd(data, size) if compression == "zstd" else _lz4(data, size)
            except Exception as error:
                raise self.wrong(at, f"a chunk cannot be decompressed ({told(error)})") from error
        if len(plain) != size:
            raise self.wrong(at, f"a chunk says that it holds {size} bytes, but it does not")
        return memoryview(plain)


def _zstd(data: memoryview, size: int) -> bytes:
    zstandard = library("zstandard", "Reading MCAP")
    told_size = zstandard.frame_content_size(data)
    if told_size >= 0 and told_size != size:
        return b""
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size) if size else b""


def _lz4(data: memoryview, size: int) -> bytes:
    frame = library("lz4.frame", "Reading MCAP").LZ4FrameDecompressor()
    return frame.decompress(data, max_length=size + 1)


def _text(content: memoryview) -> tuple[str, memoryview]:
    """A text behind its length, and the rest."""
    found, rest = _long(content)
    return str(found, "utf-8"), rest


def _long(content: memoryview, count: str = "<I") -> tuple[memoryview, memoryview]:
    """Bytes behind their number, and the rest."""
    size = struct.calcsize(count)
    (length,) = struct.unpack_from(count, content)
    if size + length > len(content):
        raise struct.error("it ends too early")
    return content[size : size + length], content[size + length :]


def _pairs(content: memoryview) -> Iterator[tuple[str, str]]:
    """The pairs of text of metadata."""
    inner, _ = _long(content)
    while len(inner):
        key, inner = _text(inner)
        value, inner = _text(inner)
        yield key, value
