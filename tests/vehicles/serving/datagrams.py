"""Datagrams as somebody else might send them: requests and packets that are changed at random."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from random import Random
from typing import Any

from autopilot import packet

REQUESTS: tuple[dict[str, Any], ...] = (
    {"id": 7, "commands": {"thrusters": [1500.0, 1510.0, 1490.0, 1500.0, 1500.0, 1500.0, 1520.0, 1500.0]}, "steps": 2},
    {"id": "a", "reset": True, "steps": 0},
    {"reset": {"position": [0.0, 0.0, 5.0], "speed": 0.5, "euler_zyx": [0.1, 0.2, 0.3]}},
    {"reset": {"velocity": [0.1, 0.0, 0.0], "angular_velocity": [0.0, 0.1, 0.0]}, "steps": 1},
    {"reset": {"actuators": {"thrusters": [1500.0] * 8}}, "steps": 1},
    {},
)
"""Requests that can be carried out."""

HOSTILE: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2**63, -(2**64), 10**300, 0.5, 1e308, -1e308, 1e-320, "", "x", "\x1b[2J", "\ud800",
    "speed", "9" * 5000, [], [[]], [1], [1e200] * 3, [None] * 3, ["a"] * 8, [1e308] * 8, [[1.0] * 8], [1.0, "a", None],
    {}, {"thrusters": None}, {"thrusters": {"a": 1}}, {"": 1}, {"values": [1, 2]}, {"error": "x"}, [0.0] * 1000,
)  # fmt: skip
"""What may stand where a value is expected."""

RAW = (b"1e999", b"-1e999", b"NaN", b"Infinity", b"[" * 50_000, b'{"a":' * 20_000, b"1" * 10_000, b"\x00", b"\xff", b"")
"""What may stand where JSON has a value, and is none, or none that a number can hold."""


def mutated(seed: int, number: int) -> Iterator[bytes]:
    """So many datagrams, requests and packets in turns, from a seed."""
    random = Random(seed)
    for index in range(number):
        yield _packet(random) if index % 4 == 3 else _request(random)


def _request(random: Random) -> bytes:
    request = copy.deepcopy(random.choice(REQUESTS))
    for _ in range(random.randint(1, 3)):
        _change(request, random)
    data = json.dumps(request).encode()
    kind = random.randrange(8)
    if kind == 0:
        return _flipped(data, random)
    if kind == 1:
        places = [place for place, byte in enumerate(data) if byte in b":,["]
        place = random.choice(places) + 1 if places else 0
        return data[:place] + random.choice(RAW) + (data[place + 1 :] if random.random() < 0.5 else b"")
    return data


def _change(request: Any, random: Random) -> None:
    """Put a value that does not belong there at any depth of a request, or take one away, or name one anew."""
    places = list(_places(request))
    if not places:
        request[random.choice(("id", "steps", "commands", "reset", "error", "\x1b[2J"))] = random.choice(HOSTILE)
        return
    holder, key = random.choice(places)
    kind = random.randrange(6)
    if kind == 0:
        del holder[key]
    elif kind == 1 and isinstance(holder, dict):
        holder[random.choice(("id", "steps", "reset", "axes", "t", "position", "speed", "velocity"))] = holder.pop(key)
    else:
        holder[key] = copy.deepcopy(random.choice(HOSTILE))


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        yield value, key
        if isinstance(inner, (dict, list)):
            yield from _places(inner)


def _packet(random: Random) -> bytes:
    kind = random.randrange(4)
    number = random.choice((0, 1, 2**32 - 1, random.randrange(100)))
    pulses = [random.choice((0, 1500, 1100, 65535, random.randrange(65536))) for _ in range(random.choice((16, 32)))]
    data = packet(number, pulses, random.choice((0, 1, 400, 400, 65535)))
    return data if kind else _flipped(data, random)


def _flipped(data: bytes, random: Random) -> bytes:
    """Bits flipped, cut off, or with more behind it."""
    changed = bytearray(data or b"\0")
    for _ in range(random.randint(1, 4)):
        changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    kind = random.randrange(3)
    return bytes(changed[: random.randrange(len(changed))] if kind == 0 else changed * 2 if kind == 1 else changed)
