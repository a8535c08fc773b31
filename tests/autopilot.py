"""A double of ArduPilot: it sends packets and waits for each answer, over UDP or without."""

from __future__ import annotations

import json
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Thread
from typing import Any

from coadjoint_vehicles.serving.loop import Answering, Loop

RATE = 400


def packet(number: int, pulses: list[int], rate: int = RATE) -> bytes:
    """A frame of 16 or 32 outputs; those that are not given are off."""
    outputs = 16 if len(pulses) <= 16 else 32
    magic = {16: 18458, 32: 29569}[outputs]
    return struct.pack(f"<HHI{outputs}H", magic, rate, number, *pulses, *[0] * (outputs - len(pulses)))


@contextmanager
def listening(loop: Loop, answering: Answering, answers: int) -> Iterator[Callable[[bytes], bytes]]:
    """A function that sends a datagram to a loop in a thread of its own and returns what comes back."""
    thread = Thread(target=loop.run, args=(answering, answers, 20.0), daemon=True)
    address = loop.address
    thread.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.settimeout(20.0)

        def ask(data: bytes) -> bytes:
            own.sendto(data, address)
            return own.recv(65_536)

        yield ask
    thread.join(20.0)
    assert not thread.is_alive()


def told(answer: bytes) -> dict[str, Any]:
    """An answer as ArduPilot reads it: the last whole line."""
    assert answer.startswith(b"\n") and answer.endswith(b"\n")
    return json.loads(answer)
