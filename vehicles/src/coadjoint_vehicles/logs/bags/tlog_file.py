"""Telemetry of MAVLink, `.tlog`: messages by the definitions of pymavlink, which is under the LGPL and optional.

A packet is eight bytes of time, µs, and a packet of MAVLink 1 or 2. Of pymavlink only the parser is used: its
`mavlink_connection` takes names of files for addresses, and runs a file whose path holds `/bin/`.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from coadjoint.errors import FileError, error_line
from coadjoint_vehicles.logs.bags.bag import TopicLog
from coadjoint_vehicles.logs.bags.dataflash_file import require_short
from coadjoint_vehicles.logs.bags.definitions import Definition, Field
from coadjoint_vehicles.logs.bags.messages import Block, Topic
from coadjoint_vehicles.logs.bags.optional import library

STARTS = (0xFD, 0xFE)
"""The first bytes of packets of MAVLink 2 and 1, behind eight bytes of time."""
MOST_STRANGE = 0.2
"""The share of packets that may be damaged, as those of a radio are."""
LARGEST = 256_000_000
"""The most bytes of a file; numbers of a packet may take 20 times as much memory."""
PAUSE = 3 * 86_400_000_000
"""After a damaged packet, a time further than this from the last one is invalid, µs."""


LATEST = (2**63 - 1) // 1000
"""The last time whose nanoseconds an integer of 64 bits holds, µs; that of a packet with a later one is damaged."""


def read_tlog(path: Path, wanted: Callable[[str, str], bool], partial: bool = False) -> TopicLog:
    """Telemetry with the messages of those kinds for which `wanted(kind, kind)` is true, at the times of logging.

    Where several vehicles send messages of a kind, each has a topic, `ATTITUDE[1]` with the number of its system.
    partial: without effect, since these files have no end that could be missing.
    Raises FileError for files that are not such logs or are larger than `LARGEST`, if more than a fifth of the packets
    is damaged, and for several vehicles without a choice of one; ArgumentError where pymavlink is missing.
    """
    require_short(path, LARGEST)
    with path.open("rb") as opened:
        head = opened.read(9)
        if len(head) < 9 or head[8] not in STARTS:
            raise FileError(f"The file {path} is not telemetry of MAVLink: its ninth byte must be fd or fe.")
        parser = library("pymavlink.dialects.v20.ardupilotmega", "Reading .tlog").MAVLink(None)
        parser.robust_parsing = True
        opened.seek(0)
        try:
            rows, strange, count = _messages(_packets(parser, opened), wanted)
        except Exception as error:
            raise FileError(f"The telemetry {path} cannot be read ({error_line(error)}).") from error
    if strange > MOST_STRANGE * count:
        raise FileError(f"The telemetry {path} is damaged: {strange} of {count} packets are none.")
    notes = [f"{strange} of {count} packets are damaged, and are passed over."] if strange else []
    found = TopicLog(str(path), notes=notes)
    for (kind, system), messages in rows.items():
        systems = sorted(other for name, other in rows if name == kind)
        topic = kind if len(systems) == 1 else f"{kind}[{system}]"
        if len(systems) > 1 and all(wanted(f"{kind}[{other}]", kind) for other in systems):
            raise FileError(
                f"The telemetry {path} holds {kind} of the systems {', '.join(map(str, systems))}: take one vehicle by "
                f'topics=["{kind}[{systems[0]}]", …] or --topics {kind}[{systems[0]}] ….'
            )
        found.found[topic] = messages.topic(topic, kind, wanted(topic, kind), str(path))
    return found


def _packets(parser: Any, opened: BinaryIO) -> Iterator[tuple[int, Any]]:
    """The packets of a file, those that are damaged too, with their times, µs."""
    time, known, damaged = 0, None, False
    while True:
        stamp = opened.read(8)
        if len(stamp) == 8:
            time = int.from_bytes(stamp)
            while damaged and known is not None and abs(time - known) > PAUSE and (more := opened.read(1)):
                stamp = stamp[1:] + more
                time = int.from_bytes(stamp)
        packet = None
        while packet is None:
            more = opened.read(parser.bytes_needed())
            packet = parser.parse_char(more)
            if packet is None and not more:
                return
        damaged = packet.get_type() == "BAD_DATA"
        known = known if damaged else time
        yield time, packet


class _Messages:
    """The numbers of messages of one kind and system, as float64, and their times, ns."""

    def __init__(self, first: Any):
        self.names = [n for n in first.get_fieldnames() if isinstance(getattr(first, n), (int, float))]
        self.numbers, self.times = array("d"), array("q")

    def add(self, time: int, message: object) -> None:
        self.numbers.extend(float(getattr(message, n)) for n in self.names)
        self.times.append(1000 * time)

    def topic(self, topic: str, kind: str, whole: bool, where: str) -> Topic:
        """All messages as a topic; without `whole`, an empty topic with the type."""
        count = len(self.times) if whole else 0
        size = 8 * len(self.names)
        times = np.frombuffer(self.times, np.int64)[:count]
        block = Block(memoryview(self.numbers).cast("B"), size * np.arange(count), np.full(count, size), times)
        definition = Definition(kind, {kind: tuple(Field(name, "float64") for name in self.names)})
        return Topic(topic, definition, "packed", (block,) if count else (), where)


def _messages(
    packets: Iterator[tuple[int, Any]], wanted: Callable[[str, str], bool]
) -> tuple[dict[tuple[str, int], _Messages], int, int]:
    """Messages by kind and system, empty unless wanted; the number of damaged packets, and of all packets."""
    rows: dict[tuple[str, int], _Messages] = {}
    strange = count = 0
    for time, message in packets:
        kind = message.get_type()
        count += 1
        if kind == "BAD_DATA" or time > LATEST:
            strange += 1
            continue
        key = kind, message.get_srcSystem()
        held = rows.get(key) or rows.setdefault(key, _Messages(message))
        if wanted(kind, kind) or wanted(f"{kind}[{key[1]}]", kind):
            held.add(time, message)
    return rows, strange, count
