"""ArduPilot's JSON interface for simulators: a packet of pulses in, a line of JSON with what is measured out.

A packet is little-endian: magic (18458 with 16 pulses, 29569 with 32), frame rate (Hz), frame count, pulses (µs); the
answer has timestamp, imu (gyro, accel_body), position, velocity, quaternion, in SI units, north, east, down and
forward, starboard, down (ArduPilot, libraries/SITL/examples/JSON/readme.md).
"""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from coadjoint.errors import ArgumentError
from coadjoint.groups.attitude import to_quaternion
from coadjoint.log import logger
from coadjoint.vehicles.parts.thrusters import Thrusters
from coadjoint.vehicles.serving.frames import Motor, commands
from coadjoint.vehicles.serving.served import Reading, Served

PORT = 9002
LATE = 10
"""By how many frames a packet may be late; one that is further back is of an autopilot that has started anew."""

_log = logger(__name__)

_LAYOUTS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
_MAGIC = struct.Struct("<H")


class Packet(NamedTuple):
    """What ArduPilot sends: the rate, Hz, and the number of its frame, and a pulse, µs, for each output."""

    rate: int
    number: int
    pulses: tuple[int, ...]


def unpacked(data: bytes) -> Packet:
    """A packet; raises ArgumentError for what is none."""
    layout = _LAYOUTS.get(_MAGIC.unpack_from(data)[0]) if len(data) >= _MAGIC.size else None
    if layout is None or len(data) != layout.size:
        sizes = " or ".join(f"{layout.size} bytes with the magic {magic}" for magic, layout in _LAYOUTS.items())
        raise ArgumentError(f"A packet of ArduPilot has {sizes}, but {len(data)} bytes came that begin {data[:4]!r}.")
    _, rate, count, *pulses = layout.unpack(data)
    return Packet(rate, count, tuple(pulses))


def line(reading: Reading) -> bytes:
    """What is measured, as ArduPilot reads it."""
    measured = {
        "timestamp": reading.t,
        "imu": {
            "gyro": reading.angular_velocity.tolist(),
            "accel_body": reading.specific_force.tolist(),
        },
        "position": reading.position.tolist(),
        "velocity": reading.velocity.tolist(),
        "quaternion": to_quaternion(reading.rotation).tolist(),
    }
    return f"\n{json.dumps(measured, separators=(',', ':'), allow_nan=False)}\n".encode()


class Lockstep:
    """Answers packets: one step for each new frame, the same answer again for a frame that comes twice.

    begin: a craft to be stepped by a frame rate, Hz; it is called at the first packet, and when the count goes back by
    more than a few: an autopilot that has started anew, with which the craft begins anew, too. A frame that comes late
    gets the last answer. `counts` tells of frames, duplicates, late and lost ones, and restarts.
    """

    def __init__(self, begin: Callable[[int], Served], thrusters: Thrusters, motors: Sequence[Motor]):
        self.begin, self.thrusters, self.motors = begin, thrusters, motors
        self.served: Served | None = None
        self.counts: Counter[str] = Counter()
        self._last, self._answer = -1, b""

    def answer(self, data: bytes) -> bytes:
        """The line that answers a packet; raises ArgumentError for what is none, StepError where a step fails."""
        packet = unpacked(data)
        if self.served is None:
            self.served = self.begin(packet.rate)
        elif packet.number == self._last or (packet.number and 0 < self._last - packet.number <= LATE):
            self.counts["duplicates" if packet.number == self._last else "late"] += 1
            return self._answer
        elif packet.number < self._last:
            self.counts["restarts"] += 1
            _log.warning("ArduPilot began anew, at %d Hz: the vehicle is back at its start.", packet.rate)
            self.served = self.begin(packet.rate)
            self.served.reset()
        else:
            self._lose(packet.number - self._last - 1)
        self.served.advance({self.thrusters.name: commands(self.motors, self.thrusters, packet.pulses)}, 1)
        self.counts["frames"] += 1
        self._last, self._answer = packet.number, line(self.served.reading())
        return self._answer

    def _lose(self, frames: int) -> None:
        if frames:
            self.counts["lost"] += frames

    @property
    def t(self) -> float:
        """The time of the craft, s."""
        return 0.0 if self.served is None else float(self.served.stepper.t)
