"""MCAP files: their topics with the messages, chunk by chunk.

An MCAP file is a row of records, each a byte for its kind, eight for its length and the content; a chunk is a row of
records, compressed. They are read from the first to the last, so that a file needs no index.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from coadjoint.errors import FileError, error_line
from coadjoint_vehicles.logs.bags.bag import Bag, BagChannel
from coadjoint_vehicles.logs.bags.decompressing import LARGEST_CHUNK, MOST_TIMES, lz4, zstd
from coadjoint_vehicles.logs.bags.definitions import short
from coadjoint_vehicles.logs.bags.optional import library

MAGIC = b"\x89MCAP0\r\n"
_HEAD, _MESSAGE = struct.Struct("<BQ"), struct.Struct("<BQHIQQ")
_LATEST = 2**63 - 1
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE_KIND, _CHUNK, _METADATA, _DATA_END = 2, 3, 4, 5, 6, 12, 15


def read_mcap(path: Path, wanted: Callable[[str, str], bool], partial: bool = False) -> Bag:
    """An MCAP file with the messages of those topics for which `wanted(topic, type)` is true.

    partial: read the complete part of a truncated file. Raises FileError for files that are not MCAP, are damaged or
    are not closed, and for chunks that are larger than any writer makes.
    """
    library("mcap", "Reading MCAP")
    with path.open("rb") as opened:
        size = path.stat().st_size
        head = opened.read(len(MAGIC))
        if head != MAGIC:
            what = "is empty" if not head else f"begins with {head.hex(' ')}"
            raise FileError(f"The file {path} is not an MCAP file: it {what}, but must begin with {MAGIC.hex(' ')}.")
        content = memoryview(mmap.mmap(opened.fileno(), size, access=mmap.ACCESS_READ))
    return _Reading(path, content, wanted, partial).all()


class _Reading:
    """A file on its way from the first record to the last."""

    def __init__(self, path: Path, content: memoryview, wanted: Callable[[str, str], bool], partial: bool):
        self.path, self.content, self.asked, self.partial = path, content, wanted, partial
        self.found = Bag(str(path), size=len(content))
        self.schemas: dict[int, tuple[str, str, bytes]] = {0: ("", "", b"")}
        self.wanted: set[int] = set()
        self.opened = 0

    def wrong(self, at: int, what: str) -> FileError:
        return FileError(f"The MCAP file {self.path} is damaged at byte {at}: {what}.")

    def all(self) -> Bag:
        """All records; raises FileError."""
        ended = self.rows(self.content, len(MAGIC), 0)
        if not ended and not self.partial:
            raise FileError(
                f"The MCAP file {self.path} was not closed: it ends after {len(self.content)} bytes without its end. "
                "Repair it by `mcap recover`, or read the complete part with partial=True or --partial."
            )
        if not ended:
            self.found.notes.append("The file was not closed: everything behind its last complete chunk is lost.")
        return self.found

    def rows(self, content: memoryview, at: int, base: int, inside: bool = False) -> bool:
        """The records of a file or of a chunk; whether the end of a file was there."""
        rows: dict[int, list[tuple[int, int, int]]] = {}
        end = len(content)
        try:
            while at < end:
                at = self.messages(content, at, rows)
                if at == end:
                    break
                kind, length = _HEAD.unpack_from(content, at) if at + 9 <= end else (0, end)
                start = at + 9
                if start + length > end:
                    if not inside:
                        return False
                    raise self.wrong(base or at, "a record continues behind the end of its chunk")
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
                if found:
                    self.found.add(number, content, found, alone=inside)

    def messages(self, content: memoryview, at: int, rows: dict[int, list[tuple[int, int, int]]]) -> int:
        """Messages that are wanted, as long as nothing else comes: where they end."""
        last, wanted = len(content) - _MESSAGE.size, self.wanted
        if not wanted:
            return at
        for number in wanted:
            rows.setdefault(number, [])
        while at <= last:
            kind, length, number, _, time, _ = _MESSAGE.unpack_from(content, at)
            after = at + 9 + length
            if kind != _MESSAGE_KIND or number not in wanted or length < 22 or time > _LATEST or after > last + 31:
                break
            rows[number].append((at + 31, length - 22, time))
            at = after
        return at

    def message(self, content: memoryview, at: int, length: int, rows: dict[int, list[tuple[int, int, int]]]) -> None:
        if length < 22:
            raise self.wrong(at, f"a message has {length} bytes")
        _, _, number, _, time, _ = _MESSAGE.unpack_from(content, at)
        if number in self.wanted:
            if time > _LATEST:
                raise self.wrong(at, f"a message of {self.found.channels[number].topic} is of no time, {time} ns")
            rows.setdefault(number, []).append((at + 31, length - 22, time))
        elif number not in self.found.channels:
            raise self.wrong(at, f"a message is of the channel {number}, which comes nowhere before it")

    def record(self, kind: int, content: memoryview, at: int, inside: bool) -> None:
        if kind in (_SCHEMA, _CHANNEL, _METADATA):
            self.found.keep(len(content))
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
            raise self.wrong(at, f"a record of kind {kind} cannot be read ({error_line(error)})") from error

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
        made = BagChannel(topic, self.schemas[schema][0], written, *self.schemas[schema][1:])
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
                plain = zstd(data, size) if compression == "zstd" else lz4(data, size)
            except Exception as error:
                raise self.wrong(at, f"a chunk cannot be decompressed ({error_line(error)})") from error
        if len(plain) != size:
            raise self.wrong(at, f"a chunk says that it holds {size} bytes, but it does not")
        return memoryview(plain)


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
