"""Logs of robots: 4·10⁵ messages of an inertial unit in MCAP, and a log of ArduPilot, beside the readers of others."""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.clock import Contender, interleaved, table_of
from coadjoint_vehicles.logs import read_bag
from coadjoint_vehicles.logs.bags.schemas import known, schema
from coadjoint_vehicles.logs.bags.serializing import serialized

MCAP, ARDUPILOT = "mcap-ros2-support", "pymavlink"
SHARE = 20
"""Of so many messages the slow reader of MCAP reads one, from the first on."""
KINDS = {"IMU": (130, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ"), "ATT": (131, "Qccc", "TimeUS,Roll,Pitch,Yaw")}


def measure(quick: bool) -> dict[str, Any]:
    """Processor time of a message, from the file to a log of columns in the library's axes; theirs to objects."""
    times, count = (1, 40_000) if quick else (5, 400_000)
    with tempfile.TemporaryDirectory() as folder:
        bag, flown = write_mcap(Path(folder) / "imu.mcap", count), write_dataflash(Path(folder) / "1.BIN", count // 2)
        found = {
            "mcap": {
                MCAP: Contender(lambda: sum(1 for _ in islice(_theirs(bag), count // SHARE)), count / SHARE),
                "read_log": Contender(lambda: read_bag(bag), count),
            },
            "ardupilot": {
                ARDUPILOT: Contender(lambda: _pymavlink(flown), count),
                "read_log": Contender(lambda: read_bag(flown), count),
            },
        }
        timed = {name: interleaved(contenders, times) for name, contenders in found.items()}
    rows = {name: table_of(timings, next(iter(timings))) for name, timings in timed.items()}
    return {"messages": count, **rows}


def _theirs(path: Path) -> Iterator[Any]:
    from mcap_ros2.reader import read_ros2_messages

    return read_ros2_messages(str(path))


def _pymavlink(path: Path) -> None:
    from pymavlink.DFReader import DFReader_binary

    reader = DFReader_binary(str(path))
    while reader.recv_match(type=list(KINDS)) is not None:
        pass


def write_mcap(path: Path, count: int) -> Path:
    """`count` messages of an inertial unit at 100 Hz, compressed by zstd in chunks of 1 MB."""
    from mcap.writer import Writer

    random = np.random.default_rng(1)
    turn, rates = random.normal(size=(count, 4)), random.normal(size=(count, 3))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    stamps = np.arange(count) * 10_000_000
    values = {"header.frame_id": "imu", "header.stamp.sec": stamps // 10**9, "header.stamp.nanosec": stamps % 10**9}
    values |= {f"orientation.{axis}": turn[:, i] for i, axis in enumerate("wxyz")}
    values |= {f"angular_velocity.{axis}": rates[:, i] for i, axis in enumerate("xyz")}
    kind = "sensor_msgs/Imu"
    with path.open("wb") as opened:
        writer = Writer(opened)
        writer.start()
        number = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", schema(kind).encode())
        channel = writer.register_channel("/imu", "cdr", number)
        for time, content in zip(stamps.tolist(), serialized(known(kind), count, values), strict=True):
            writer.add_message(channel, time, content, time)
        writer.finish()
    return path


def write_dataflash(path: Path, count: int) -> Path:
    """`count` messages each of gyroscopes and of the attitude."""
    letters = {"Q": "Q", "B": "B", "f": "f", "c": "h"}
    structs = {name: struct.Struct("<" + "".join(letters[c] for c in row[1])) for name, row in KINDS.items()}
    fmt = struct.Struct("<BB4s16s64s")
    rows = [b"\xa3\x95\x80" + fmt.pack(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")]
    for name, (kind, text, columns) in KINDS.items():
        rows.append(
            b"\xa3\x95\x80" + fmt.pack(kind, 3 + structs[name].size, name.encode(), text.encode(), columns.encode())
        )
    for i in range(count):
        rows.append(b"\xa3\x95\x82" + structs["IMU"].pack(10_000 * i, 0, 0.1, 0.2, 0.3))
        rows.append(b"\xa3\x95\x83" + structs["ATT"].pack(10_000 * i, 100, 200, 300))
    path.write_bytes(b"".join(rows))
    return path
