"""Bags that are damaged, malicious or not what was asked for: a sentence for each, and nothing else."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coadjoint.errors import CoadjointError, FileError
from coadjoint.identification.log import Log
from coadjoint_vehicles.logs import read_bag, read_log
from coadjoint_vehicles.logs.bags.definitions import definition
from coadjoint_vehicles.logs.bags.schemas import known, schema
from coadjoint_vehicles.logs.bags.serializing import serialized

mcap = pytest.importorskip("mcap.writer")

MAGIC = b"\x89MCAP0\r\n"
SECONDS = np.arange(30)


def record(kind, content):
    return struct.pack("<BQ", kind, len(content)) + content


def text(words):
    return struct.pack("<I", len(words)) + words.encode()


def chunk(plain, compression="", size=None, data=None, crc=None):
    data = plain if data is None else data
    head = struct.pack("<QQQI", 0, 0, len(plain) if size is None else size, zlib.crc32(plain) if crc is None else crc)
    return record(6, head + text(compression) + struct.pack("<Q", len(data)) + data)


def whole(*records):
    return MAGIC + record(1, text("ros2") + text("")) + b"".join(records) + record(15, bytes(4)) + MAGIC


def twist(**values):
    given = {"header.stamp.sec": SECONDS + 1, "twist.twist.linear.x": SECONDS * 0.1, **values}
    return serialized(known("geometry_msgs/TwistWithCovarianceStamped"), len(SECONDS), given)


KIND = "geometry_msgs/TwistWithCovarianceStamped"


def written(path, messages, topic: Any = "/twist", kind=KIND, **options):
    with path.open("wb") as opened:
        writer = mcap.Writer(opened, **options)
        writer.start()
        channels = {}
        for name in [topic] if isinstance(topic, str) else topic:
            number = writer.register_schema(kind.replace("/", "/msg/"), "ros2msg", schema(kind).encode())
            channels[name] = writer.register_channel(name, "cdr", number)
        for i, content in enumerate(messages):
            for channel in channels.values():
                writer.add_message(channel, i * 10**9, content, i * 10**9)
        writer.finish()
    return path


def test_twists_are_read(tmp_path):
    log = read_log(written(tmp_path / "x.mcap", twist()))
    assert np.array_equal(log.columns["u"], SECONDS * 0.1) and log.duration == 29


CHANNEL = struct.pack("<HH", 1, 1) + text("/twist") + text("cdr") + struct.pack("<I", 0)
SCHEMA = struct.pack("<H", 1) + text(KIND) + text("ros2msg") + text(schema(KIND))

DEFINED = record(3, SCHEMA), record(4, CHANNEL)
OTHER = record(3, SCHEMA.replace(b"ros2msg", b"omgidl_"))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (whole(chunk(b"", size=2**62)), "says that it holds 4611686018427387904 bytes, more than any log does"),
        (whole(chunk(b"", size=200_000_000)), "says that it holds 200000000 bytes, more than any log does"),
        (whole(chunk(bytes(64), "zstd", data=b"nothing")), "cannot be decompressed"),
        (whole(chunk(bytes(64), "lz4", data=b"nothing")), "cannot be decompressed"),
        (whole(chunk(bytes(64), "brotli")), 'is compressed by "brotli", but zstd and lz4 are read'),
        (whole(chunk(bytes(64))), "a record is of no kind"),
        (whole(chunk(record(4, CHANNEL), crc=7)), "not what its checksum says"),
        (whole(chunk(record(4, CHANNEL), size=3)), "says that it holds 3 bytes, but it does not"),
        (whole(chunk(struct.pack("<BQ", 4, 99))), "continues behind the end of its chunk"),
        (whole(record(4, CHANNEL)), "is of the schema 1, which comes nowhere before it"),
        (whole(*DEFINED, record(4, CHANNEL.replace(b"wist", b"ling"))), "the channel 1 is"),
        (whole(record(5, bytes(30))), "a message is of the channel 0, which comes nowhere before it"),
        (whole(record(5, bytes(3))), "a message has 3 bytes"),
        (whole(record(3, b"\1\0\xff\xff\xff\xff")), "a record of kind 3 cannot be read"),
        (whole(*DEFINED), "holds no message that measures a vehicle; it holds /twist"),
        (whole(*DEFINED, record(5, struct.pack("<HIQQ", 1, 0, 2**64 - 1, 0))), "of no time"),
        (whole(*DEFINED, record(5, struct.pack("<HIQQ", 1, 0, 0, 0))), "not plain CDR"),
        (whole(*DEFINED, record(5, struct.pack("<HIQQI", 1, 0, 0, 0, 256))), "ends after 4"),
        (whole(OTHER, record(4, CHANNEL), record(5, bytes([1]) + bytes(30))), 'is defined in "omgidl_"'),
    ],
)  # fmt: skip
def test_a_file_that_is_damaged_or_malicious_is_refused(tmp_path, content, words):
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    with pytest.raises(FileError, match=words) as found:
        read_log(path)
    assert str(found.value).endswith(".") and "bad.mcap" in str(found.value)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_bomb_is_not_unpacked_beyond_what_it_says(tmp_path, compression):
    """300 MB of zeros in a few kilobytes, whose head says less."""
    module = pytest.importorskip("zstandard" if compression == "zstd" else "lz4.frame")
    zeros = bytes(30_000_000)
    data = module.ZstdCompressor().compress(zeros) if compression == "zstd" else module.compress(zeros)
    path = tmp_path / "bomb.mcap"
    path.write_bytes(whole(chunk(b"", compression, size=1000, data=data)))
    with pytest.raises(FileError, match="says that it holds 1000 bytes, but it does not"):
        read_log(path)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"header.stamp.sec": SECONDS[::-1]}, "go back in time: message 2 is stamped 1 s before"),
        ({"header.stamp.sec": 0}, "have no stamps, but 0 in all heads"),
        ({"twist.twist.linear.x": np.inf}, "`twist.twist.linear.x` of /twist is infinite in sample 1"),
    ],
)
def test_times_that_go_back_and_numbers_that_are_none_are_refused(tmp_path, values, words):
    with pytest.raises(FileError, match=words):
        read_log(written(tmp_path / "x.mcap", twist(**values)))


def test_quaternions_that_are_none_are_refused(tmp_path):
    kind = "geometry_msgs/PoseStamped"
    stamped = {"header.stamp.sec": SECONDS + 1, "pose.orientation.w": 0.5}
    from coadjoint_vehicles.logs.bags import definitions

    body = "std_msgs/Header header\ngeometry_msgs/Pose pose\n"
    inside = schema("geometry_msgs/PoseWithCovarianceStamped").split("=" * 80, 1)[1]
    text_ = body + "=" * 80 + inside
    messages = serialized(definitions.definition(kind, text_, ""), len(SECONDS), stamped)
    path = tmp_path / "x.mcap"
    with path.open("wb") as opened:
        writer = mcap.Writer(opened)
        writer.start()
        channel = writer.register_channel("/pose", "cdr", writer.register_schema(kind, "ros2msg", text_.encode()))
        for i, content in enumerate(messages):
            writer.add_message(channel, i, content, i)
        writer.finish()
    with pytest.raises(FileError, match=r"quaternions must have length 1, but one has 0\.5"):
        read_log(path)


def test_two_topics_that_measure_the_same_are_not_mixed(tmp_path):
    path = written(tmp_path / "x.mcap", twist(), topic=("/a", "/b"))
    with pytest.raises(FileError, match="both /a and /b measure `u`: say which to take"):
        read_log(path)
    assert np.array_equal(read_log(path, topics=["/b"]).columns["u"], SECONDS * 0.1)
    with pytest.raises(FileError, match=r"has no topic `/c`: .* knows /a, /b"):
        read_log(path, topics=["/c"])


def test_messages_of_one_time_are_told_and_taken_once(tmp_path):
    log = read_log(written(tmp_path / "x.mcap", twist(**{"header.stamp.sec": SECONDS // 2 + 1})))
    assert len(log) == 15 and "15 messages of /twist are of the time of the one before" in log.notes[0]


def test_what_is_whole_of_a_file_that_was_not_closed_is_read_if_asked(tmp_path):
    path = written(tmp_path / "x.mcap", twist(), chunk_size=1000, compression=mcap.CompressionType.NONE)
    path.write_bytes(path.read_bytes()[:8000])
    with pytest.raises(FileError, match="was not closed: it ends after 8000 bytes"):
        read_log(path)
    log = read_log(path, partial=True)
    assert 4 < len(log) < 30 and "was not closed" in log.notes[0]
    assert np.array_equal(log.columns["u"], (SECONDS * 0.1)[: len(log)])


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("x.db3", b"time_s,u_m_s\n", "is not a bag of ROS 2: it is not an SQLite database"),
        ("x.db3", b"SQLite format 3\0" + bytes(500), "is damaged, or no bag of ROS 2"),
        ("x.bag", b"#ROSBAG V1.1\n", "is not a bag of ROS 1: it begins with"),
        ("x.bag", b"#ROSBAG V2.0\n" + bytes(2), "was not closed"),
        ("x.bag", b"#ROSBAG V2.0\n" + bytes(8), "a record cannot be read"),
        ("x.bag", b"#ROSBAG V2.0\n" + bytes([7, 0, 0, 0, 3, 0, 0, 0]) + b"op=" + bytes(4), "a record cannot be read"),
    ],
)
def test_bags_of_other_formats_that_are_none_are_refused(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=words):
        read_log(tmp_path / name)


def test_a_database_without_texts_is_refused(tmp_path):
    import sqlite3

    for kind in ("NULL", "x'00ff'"):
        path = tmp_path / f"{len(kind)}.db3"
        with sqlite3.connect(path) as base:
            base.execute("CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT)")
            base.execute("CREATE TABLE messages (id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)")
            base.execute(f"INSERT INTO topics VALUES (1, '/a', {kind}, 'cdr')")
        with pytest.raises(FileError, match="a row of its table `topics` holds"):
            read_log(path)


def test_a_short_sequence_of_whole_numbers_lacks_values_and_no_number_is_made_up(tmp_path):
    """`data[3]` of a message with two values."""
    kind = "std_msgs/Int64MultiArray"
    layout = schema("std_msgs/Float64MultiArray").split("=" * 80, 1)[1]
    text_ = "std_msgs/MultiArrayLayout layout\nint64[] data\n" + "=" * 80 + layout
    made = definition(kind, text_, "")
    path = tmp_path / "x.mcap"
    with path.open("wb") as opened:
        writer = mcap.Writer(opened)
        writer.start()
        channel = writer.register_channel("/n", "cdr", writer.register_schema(kind, "ros2msg", text_.encode()))
        for i in range(4):
            content = serialized(made, 1, {"data": np.arange(4 if i % 2 else 2)[None]})[0]
            writer.add_message(channel, i * 10**9, content, i * 10**9)
        writer.finish()
    log = read_log(path, sensors={"sensor": [{"topic": "/n", "columns": {"u_m_s": "data[3]"}}]})
    assert np.array_equal(log.columns["u"], [3.0, 3.0]) or np.array_equal(np.isnan(log.columns["u"]), [1, 0, 1, 0])


def test_folders_and_files_that_are_not_there_are_refused(tmp_path):
    with pytest.raises(FileError, match="There is no log"):
        read_log(tmp_path / "none.mcap")
    with pytest.raises(FileError, match=r"is not a bag of ROS 2: it holds no \.mcap and no \.db3"):
        read_log(tmp_path)
    (tmp_path / "x_0.db3.zstd").write_bytes(b"")
    with pytest.raises(FileError, match="unpack them by `zstd -d`"):
        read_log(tmp_path)


@pytest.mark.long
def test_files_that_are_changed_at_random_are_read_or_refused_in_a_sentence(tmp_path):
    """Bytes that are changed, cut out or repeated, in files of four formats."""
    from test_bags import written as bag_of
    from test_dataflash import definitions, message

    random = np.random.default_rng(1812)
    (tmp_path / "1.BIN").write_bytes(
        b"".join([*definitions(), *(message("IMU", 10**5 * i, 0, *[0.1 * i] * 6) for i in range(60))])
    )
    sources = [written(tmp_path / "x.mcap", twist(), chunk_size=4000, compression=mcap.CompressionType.NONE)]
    sources += [tmp_path / "1.BIN", bag_of(tmp_path, "ros1"), next(bag_of(tmp_path, "sqlite").glob("*.db3"))]
    for source in sources:
        content = source.read_bytes()
        for _ in range(80):
            changed, at = bytearray(content), int(random.integers(len(content)))
            kind = random.integers(3)
            if kind == 0:
                changed[at] = int(random.integers(256))
            elif kind == 1:
                del changed[at : at + int(random.integers(1, 40))]
            else:
                changed[at:at] = changed[at : at + int(random.integers(1, 40))]
            bad = Path(tmp_path / f"bad{source.suffix}")
            bad.write_bytes(changed)
            try:
                assert isinstance(read_bag(bad, partial=bool(random.integers(2))), Log)
            except CoadjointError as error:
                assert str(bad) in str(error), error
