"""ArduPilot's JSON interface for simulators: a packet of pulses in, a line of JSON with measurements out.

A packet is little-endian: magic (18458 with 16 pulses, 29569 with 32), frame rate (Hz), frame count, pulses (µs); the
answer has timestamp, imu (gyro, accel_body), position, velocity, quaternion, in SI units, north, east, down and
forward, starboard, down (ArduPilot, libraries/SITL/examples/JSON/readme.md).
"""

from __future__ import annotations

import json
import logging
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from coadjoint.errors import ArgumentError, CoadjointError, StepError
from coadjoint.extending import logger
from coadjoint.groups.attitude import to_quaternion
from coadjoint_vehicles.parts.thrusters import Thrusters
from coadjoint_vehicles.serving.frames import Motor, commands
from coadjoint_vehicles.serving.served import Reading, Served

PORT = 9002
RATE = 400.0
"""Of ArduSub's loop, Hz."""
MOST_RATES = 4
"""For how many frame rates a craft is prepared."""
TOLD = 10
"""How many restarts are logged as warnings."""
LATE = 10
"""By how many frames a packet may be late; one that is further back is of an autopilot that has restarted."""

_log = logger(__name__)

_LAYOUTS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
_MAGIC = struct.Struct("<H")


class Packet(NamedTuple):
    """A packet of ArduPilot: the rate, Hz, and the number of its frame, and a pulse, µs, for each output."""

    rate: int
    number: int
    pulses: tuple[int, ...]


def unpacked(data: bytes) -> Packet:
    """A packet; raises ArgumentError for an invalid one."""
    layout = _LAYOUTS.get(_MAGIC.unpack_from(data)[0]) if len(data) >= _MAGIC.size else None
    if layout is None or len(data) != layout.size:
        sizes = " or ".join(f"{layout.size} bytes with the magic {magic}" for magic, layout in _LAYOUTS.items())
        raise ArgumentError(f"A packet of ArduPilot has {sizes}, but {len(data)} bytes came that begin {data[:4]!r}.")
    _, rate, count, *pulses = layout.unpack(data)
    return Packet(rate, count, tuple(pulses))


def line(reading: Reading) -> bytes:
    """The measurements, as ArduPilot reads them."""
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


class Rates:
    """The craft for a frame rate, Hz: made once for each, for at most `MOST_RATES`; others raise ArgumentError.

    make: the craft for a number of steps per second. only: a fixed rate that overrides that of packets.
    """

    def __init__(self, make: Callable[[float], Served], only: float | None = None):
        self._make, self._only = make, only
        self._made: dict[float, Served | CoadjointError] = {}
        self._prepared(only or RATE)

    def __call__(self, rate: int) -> Served:
        if self._only is None and rate < 1:
            raise ArgumentError(f"ArduPilot's packets have a frame rate of {rate} Hz: give --rate.")
        found = self._prepared(self._only or float(rate))
        if isinstance(found, CoadjointError):
            raise found
        return found

    def _prepared(self, rate: float) -> Served | CoadjointError:
        if rate not in self._made:
            if len(self._made) == MOST_RATES:
                raise ArgumentError(
                    f"ArduPilot's packets have the frame rate {rate:g} Hz after {MOST_RATES} others: give --rate."
                )
            try:
                self._made[rate] = self._make(rate)
            except CoadjointError as error:
                self._made[rate] = error
        return self._made[rate]


class Lockstep:
    """Answers packets: one step for each new frame, the same answer again for a frame that comes twice.

    begin: a craft to be stepped by a frame rate, Hz, as `Rates` is; it is called at the first packet, and when the
    count goes back by more than a few: an autopilot that has restarted, with which the craft restarts, too. A
    frame that comes late gets the last answer. Where a step fails the craft stays at the last good node, and the next
    frame tries again. `counts` has the frames, duplicates, late, lost and failed ones, and restarts.
    """

    def __init__(self, begin: Callable[[int], Served], thrusters: Thrusters, motors: Sequence[Motor]):
        self.begin, self.thrusters, self.motors = begin, thrusters, motors
        self.served: Served | None = None
        self.counts: Counter[str] = Counter()
        self._last, self._answer = -1, b""

    def answer(self, data: bytes) -> bytes:
        """The line that answers a packet; raises ArgumentError for an invalid packet, StepError if a step fails."""
        packet = unpacked(data)
        if self.served is None:
            self._start(packet)
        elif packet.number == self._last or (packet.number and 0 < self._last - packet.number <= LATE):
            self.counts["duplicates" if packet.number == self._last else "late"] += 1
            return self._answer
        elif packet.number < self._last:
            self._start(packet)
            self.counts["restarts"] += 1
            level = logging.WARNING if self.counts["restarts"] <= TOLD else logging.DEBUG
            _log.log(level, "ArduPilot began anew, at %d Hz: the vehicle is back at its start.", packet.rate)
        assert self.served is not None
        try:
            self.served.advance({self.thrusters.name: commands(self.motors, self.thrusters, packet.pulses)}, 1)
        except StepError:
            self.counts["failed"] += 1
            self.served.stepper.restore(self.served.stepper.state)
            raise
        self.counts["frames"] += 1
        if lost := packet.number - self._last - 1:
            self.counts["lost"] += lost
        self._last, self._answer = packet.number, line(self.served.reading())
        return self._answer

    def _start(self, packet: Packet) -> None:
        """Restart, as if the frame before this packet had been the last one."""
        served = self.begin(packet.rate)
        served.reset()
        self.served, self._last = served, packet.number - 1

    @property
    def t(self) -> float:
        """The time of the craft, s."""
        return 0.0 if self.served is None else float(self.served.stepper.t)
