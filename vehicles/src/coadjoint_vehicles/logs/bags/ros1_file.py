"""Bags of ROS 1, version 2.0: their topics with the messages, record by record.

A record is a head, which is a row of names with values, and data, each behind its length. Chunks hold connections and
messages, compressed by bzip2 or lz4. The index is not needed.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from coadjoint.errors import FileError, error_line
from coadjoint_vehicles.logs.bags.bag import Bag, BagChannel
from coadjoint_vehicles.logs.bags.decompressing import LARGEST_CHUNK, MOST_TIMES, bz2, lz4
from coadjoint_vehicles.logs.bags.definitions import short

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7
_LENGTH = struct.Struct("<I")


def read_ros1(path: Path, wanted: Callable[[str, str], bool], partial: bool = False) -> Bag:
    """A bag of ROS 1 with the messages of those topics for which `wanted(topic, type)` is true.

    partial: read the complete part of a truncated file. Raises FileError for files that are not ROS 1 bags, are damaged
    or were not closed, and for chunks that are larger than any writer makes.
    """
    with path.open("rb") as opened:
        head = opened.read(len(MAGIC))
        if head != MAGIC:
            what = "is empty" if not head else f"begins with {head!r}"
            raise FileError(f"The file {path} is not a bag of ROS 1: it {what}, but must begin with {MAGIC!r}.")
        content = memoryview(mmap.mmap(opened.fileno(), path.stat().st_size, access=mmap.ACCESS_READ))
    return _Reading(path, content, wanted, partial).all()


class _Reading:
    """A file on its way from the first record to the last."""

    def __init__(self, path: Path, content: memoryview, wanted: Callable[[str, str], bool], partial: bool):
        self.path, self.content, self.asked, self.partial = path, content, wanted, partial
        self.found = Bag(str(path), size=len(content))
        self.wanted: set[int] = set()
        self.opened = 0
        self.closed = False

    def wrong(self, at: int, what: str) -> FileError:
        return FileError(f"The bag {self.path} is damaged at byte {at}: {what}.")

    def all(self) -> Bag:
        """All records; raises FileError."""
        whole = self.rows(self.content, len(MAGIC), 0)
        if not (whole and self.closed) and not self.partial:
            raise FileError(
                f"The bag {self.path} was not closed: it ends after {len(self.content)} bytes without an index. Repair "
                "it by `rosbag reindex`, or read the complete part with partial=True or --partial."
            )
        if not (whole and self.closed):
            self.found.notes.append("The file was not closed: everything behind its last complete chunk is lost.")
        return self.found

    def rows(self, content: memoryview, at: int, base: int, inside: bool = False) -> bool:
        """The records of a file or of a chunk; whether the last of them is complete."""
        rows: dict[int, list[tuple[int, int, int]]] = {}
        end = len(content)
        try:
            while at < end:
                begin = at
                places = []
                for _ in range(2):
                    length = _LENGTH.unpack_from(content, at)[0] if at + 4 <= end else end
                    if at + 4 + length > end:
                        if inside:
                            raise self.wrong(base, "a record continues behind the end of its chunk")
                        return False
                    places.append((at + 4, length))
                    at += 4 + length
                (head, size), (data, length) = places
                try:
                    self.record(content, content[head : head + size], data, length, rows, inside)
                except (struct.error, UnicodeDecodeError, KeyError, IndexError) as error:
                    raise self.wrong(base or begin, f"a record cannot be read ({error_line(error)})") from error
            return True
        finally:
            for number, found in rows.items():
                self.found.add(number, content, found, alone=inside)

    def record(
        self,
        content: memoryview,
        head: memoryview,
        data: int,
        length: int,
        rows: dict[int, list[tuple[int, int, int]]],
        inside: bool,
    ) -> None:
        fields = _fields(head)
        kind = fields["op"][0]
        if kind == _MESSAGE:
            (number,) = struct.unpack("<I", fields["conn"])
            if number in self.wanted:
                seconds, nanoseconds = struct.unpack("<II", fields["time"])
                rows.setdefault(number, []).append((data, length, seconds * 1_000_000_000 + nanoseconds))
            elif number not in self.found.channels:
                raise self.wrong(data, f"a message is of the connection {number}, which comes nowhere before it")
        elif kind == _CONNECTION:
            self.found.keep(len(head) + length)
            self.connection(fields, _fields(content[data : data + length]))
        elif kind == _CHUNK and not inside:
            self.chunk(fields, content[data : data + length], data)
        elif kind == _BAG:
            self.closed = struct.unpack("<Q", fields["index_pos"])[0] > 0
        elif kind not in (_INDEX, _CHUNK_INFO):
            raise self.wrong(data, f"a record is of the kind {kind}, which there is not")

    def connection(self, fields: dict[str, bytes], more: dict[str, bytes]) -> None:
        (number,) = struct.unpack("<I", fields["conn"])
        topic, kind = fields["topic"].decode(), more["type"].decode()
        made = BagChannel(topic, kind, "ros1", "ros1msg", more["message_definition"])
        self.found.channels.setdefault(number, made)
        if self.asked(topic, short(kind)):
            self.wanted.add(number)

    def chunk(self, fields: dict[str, bytes], data: memoryview, at: int) -> None:
        (size,), compression = struct.unpack("<I", fields["size"]), fields["compression"].decode()
        self.opened += size
        if size > LARGEST_CHUNK or self.opened > MOST_TIMES * len(self.content):
            raise self.wrong(at, f"a chunk says that it holds {size} bytes, more than any log does")
        known: dict[str, Callable[[memoryview, int], Any]] = {"none": lambda data, size: data, "bz2": bz2, "lz4": lz4}
        if compression not in known:
            raise self.wrong(at, f'a chunk is compressed by "{compression}", but bz2 and lz4 are read')
        try:
            plain = known[compression](data, size)
        except (OSError, ValueError, RuntimeError, EOFError) as error:
            raise self.wrong(at, f"a chunk cannot be decompressed ({error_line(error)})") from error
        if len(plain) != size:
            raise self.wrong(at, f"a chunk says that it holds {size} bytes, but it does not")
        self.rows(memoryview(plain), 0, at, inside=True)


def _fields(head: memoryview) -> dict[str, bytes]:
    """Names and values of a head."""
    found: dict[str, bytes] = {}
    at = 0
    while at < len(head):
        (length,) = _LENGTH.unpack_from(head, at)
        if at + 4 + length > len(head):
            raise struct.error("a field ends too early")
        name, equals, value = bytes(head[at + 4 : at + 4 + length]).partition(b"=")
        if not equals:
            raise struct.error("a field has no value")
        found[name.decode()] = value
        at += 4 + length
    return found
