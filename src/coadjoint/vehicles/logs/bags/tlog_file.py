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

    Raises FileError for files that are none and where more than a fifth of the packets is damaged, ArgumentError where
    pymavlink is missing.
    """
    with path.open("rb") as opened:
        head = opened.read(9)
    if len(head) < 9 or head[8] not in STARTS:
        raise FileError(f"The file {path} is no telemetry of MAVLink: its ninth byte must be fd or fe.")
    mavutil = library("pymavlink.mavutil", "Reading .tlog")
    rows: dict[str, list[tuple[int, Any]]] = {}
    strange = count = 0
    try:
        stream = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
        while (message := stream.recv_msg()) is not None:
            kind = message.get_type()
            count += 1
            strange += kind == "BAD_DATA"
            if kind != "BAD_DATA":
                rows.setdefault(kind, []).append((round(message._timestamp * 1e6) * 1000, message))
    except Exception as error:
        raise FileError(f"The telemetry {path} cannot be read ({told(error)}).") from error
    if strange > MOST_STRANGE * count:
        raise FileError(f"The telemetry {path} is damaged: {strange} of {count} packets are none.")
    notes = [f"{strange} of {count} packets are damaged, and are passed over."] if strange else []
    found = Dataflash(str(path), notes=notes)
    for kind, messages in rows.items():
        found.found[kind] = _topic(kind, messages if wanted(kind, kind) else [], messages[0][1], str(path))
    return found


def _topic(kind: str, rows: list[tuple[int, Any]], first: Any, where: str) -> Topic:
    """The numbers of messages of one kind, as float64."""
    names = [n for n in first.get_fieldnames() if isinstance(getattr(first, n), (int, float))]
    table = np.array([[float(getattr(message, n)) for n in names] for _, message in rows]).reshape(
        len(rows), len(names)
    )
    size = 8 * len(names)
    times = np.array([time for time, _ in rows], np.int64)
    block = Block(table.tobytes(), size * np.arange(len(rows)), np.full(len(rows), size), times)
    definition = Definition(kind, {kind: tuple(Field(name, "float64") for name in names)})
    return Topic(kind, definition, "packed", (block,) if rows else (), where)
