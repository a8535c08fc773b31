"""Telemetry of MAVLink, `.tlog`: messages by the definitions of pymavlink, which is under the LGPL and optional."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from coadjoint.errors import FileError, told
from coadjoint.vehicles.logs.bags.dataflash_file import Dataflash
from coadjoint.vehicles.logs.bags.definitions import Definition, Field
from coadjoint.vehicles.logs.bags.messages import Block, Topic
from coadjoint.vehicles.logs.bags.optional import library

STARTS = (0xFD, 0xFE)
"""The first bytes of packets of MAVLink 2 and 1, behind eight bytes of time."""
MOST_STRANGE = 0.2
"""The share of packets that may be damaged, as those of a radio are."""


def read_tlog(path: Path, wanted: Callable[[str, str], bool]) -> Dataflash:
    """Telemetry with the messages of those kinds for which `wanted(kind, kind)` is true, at the times of logging.

    Where several vehicles send messages of a kind, each has a topic, `ATTITUDE[1]` with the number of its system.
    Raises FileError for files that are none, where more than a fifth of the packets is damaged, and for several
    vehicles of which none was chosen; ArgumentError where pymavlink is missing.
    """
    with path.open("rb") as opened:
        head = opened.read(9)
    if len(head) < 9 or head[8] not in STARTS:
        raise FileError(f"The file {path} is no telemetry of MAVLink: its ninth byte must be fd or fe.")
    mavutil = library("pymavlink.mavutil", "Reading .tlog")
    try:
        stream = mavutil.mavlink_connection(str(path.absolute()), dialect="ardupilotmega")
        try:
            rows, strange, count = _messages(stream, wanted)
        finally:
            stream.close()
    except Exception as error:
        raise FileError(f"The telemetry {path} cannot be read ({told(error)}).") from error
    if strange > MOST_STRANGE * count:
        raise FileError(f"The telemetry {path} is damaged: {strange} of {count} packets are none.")
    notes = [f"{strange} of {count} packets are damaged, and are passed over."] if strange else []
    found = Dataflash(str(path), notes=notes)
    for (kind, system), messages in rows.items():
        systems = sorted(other for name, other in rows if name == kind)
        topic = kind if len(systems) == 1 else f"{kind}[{system}]"
        if len(systems) > 1 and all(wanted(f"{kind}[{other}]", kind) for other in systems):
            raise FileError(
                f"The telemetry {path} holds {kind} of the systems {', '.join(map(str, systems))}: take one vehicle by "
                f'topics=["{kind}[{systems[0]}]", …] or --topics {kind}[{systems[0]}] ….'
            )
        found.found[topic] = _topic(topic, kind, messages if wanted(topic, kind) else [], messages[0][1], str(path))
    return found


def _messages(
    stream: Any, wanted: Callable[[str, str], bool]
) -> tuple[dict[tuple[str, int], list[tuple[int, Any]]], int, int]:
    """Messages with their times, ns, by kind and system, one of those that nobody wants; how many packets are damaged,
    and of how many."""
    rows: dict[tuple[str, int], list[tuple[int, Any]]] = {}
    strange = count = 0
    while (message := stream.recv_msg()) is not None:
        kind = message.get_type()
        count += 1
        if kind == "BAD_DATA":
            strange += 1
            continue
        system = message.get_srcSystem()
        held = rows.setdefault((kind, system), [])
        if not held or wanted(kind, kind) or wanted(f"{kind}[{system}]", kind):
            held.append((round(message._timestamp * 1e6) * 1000, message))
    return rows, strange, count


def _topic(topic: str, kind: str, rows: list[tuple[int, Any]], first: Any, where: str) -> Topic:
    """The numbers of messages of one kind, as float64."""
    names = [n for n in first.get_fieldnames() if isinstance(getattr(first, n), (int, float))]
    table = np.array([[float(getattr(message, n)) for n in names] for _, message in rows]).reshape(
        len(rows), len(names)
    )
    size = 8 * len(names)
    times = np.array([time for time, _ in rows], np.int64)
    block = Block(table.tobytes(), size * np.arange(len(rows)), np.full(len(rows), size), times)
    definition = Definition(kind, {kind: tuple(Field(name, "float64") for name in names)})
    return Topic(topic, definition, "packed", (block,) if rows else (), where)
