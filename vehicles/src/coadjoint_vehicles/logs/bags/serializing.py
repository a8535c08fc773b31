"""Messages in CDR, many at a time: the same text and the same number of values in all, so that one layout holds."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from coadjoint_vehicles.logs.bags.definitions import NUMBERS, SEQUENCE, STRING, Definition

_HEAD = b"\x00\x01\x00\x00"


def serialized(definition: Definition, count: int, values: Mapping[str, object]) -> list[bytes]:
    """`count` messages of a type, in the order of bytes of most machines.

    values: by path, numbers (count,) or one for all; of several (count, k) or (k,); a text; and of a sequence of
    messages how many there are, whose fields are `transforms[0].header.frame_id`. Missing fields are 0, "" or empty.
    """
    if count == 0:
        return []
    pieces: list[tuple[int, np.ndarray | bytes]] = [(0, _HEAD)]
    end = _message(definition, definition.name, "", count, values, pieces, 4)
    table = np.zeros((count, end), np.uint8)
    for place, piece in pieces:
        rows = np.frombuffer(piece, np.uint8)[None] if isinstance(piece, bytes) else piece
        table[:, place : place + rows.shape[1]] = rows
    whole = table.tobytes()
    return [whole[i : i + end] for i in range(0, count * end, end)]


def _message(
    definition: Definition,
    name: str,
    before: str,
    count: int,
    values: Mapping[str, Any],
    pieces: list[tuple[int, np.ndarray | bytes]],
    at: int,
) -> int:
    """Add the pieces of a message that begins at `at`; where it ends."""
    for field in definition.types[name]:
        path = f"{before}{field.name}"
        if field.kind == STRING:
            text = str(values.get(path, "")).encode() + b"\0"
            at = _aligned(at, 4)
            pieces.append((at, struct.pack("<I", len(text)) + text))
            at += 4 + len(text)
        elif field.kind in NUMBERS:
            at = _numbers(NUMBERS[field.kind], field.many, values.get(path), count, pieces, at)
        elif field.many is None:
            at = _message(definition, field.kind, f"{path}.", count, values, pieces, at)
        else:
            many = int(values.get(path, 0)) if field.many == SEQUENCE else field.many
            if field.many == SEQUENCE:
                at = _aligned(at, 4)
                pieces.append((at, struct.pack("<I", many)))
                at += 4
            for i in range(many):
                at = _message(definition, field.kind, f"{path}[{i}].", count, values, pieces, at)
    return at


def _numbers(
    kind: str, many: int | None, given: object, count: int, pieces: list[tuple[int, np.ndarray | bytes]], at: int
) -> int:
    size = int(kind[1])
    if given is None:
        given = 0.0 if many is None else np.zeros(max(many, 0))
    numbers = np.asarray(given)
    shape = (count,) if many is None else (count, numbers.shape[-1])
    table = np.ascontiguousarray(np.broadcast_to(numbers, shape).reshape(count, -1), f"<{kind}")
    if many == SEQUENCE:
        at = _aligned(at, 4)
        pieces.append((at, struct.pack("<I", table.shape[1])))
        at += 4
    if table.shape[1]:
        at = _aligned(at, size)
        pieces.append((at, table.view(np.uint8)))
    return at + size * table.shape[1]


def _aligned(at: int, size: int) -> int:
    return at + (4 - at) % size
