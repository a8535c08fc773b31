"""What is kept of a bag is compared with the size of its file: messages without bytes, schemas and names, too."""

from __future__ import annotations

import bz2
import contextlib
import sqlite3
import struct
from pathlib import Path

import pytest

from coadjoint.errors import FileError
from coadjoint_vehicles.logs.bags.mcap_file import MAGIC, read_mcap
from coadjoint_vehicles.logs.bags.ros1_file import MAGIC as ROS1
from coadjoint_vehicles.logs.bags.ros1_file import read_ros1
from coadjoint_vehicles.logs.bags.sqlite_file import read_sqlite

DECOMPRESSING = "coadjoint_vehicles.logs.bags.decompressing"
KEPT = "more than 50 times the file"


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def record(kind: int, content: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + content


SCHEMA = record(3, struct.pack("<H", 1) + text(b"a/B") + text(b"ros2msg") + text(b"float64 x"))
CHANNEL = record(4, struct.pack("<HH", 1, 1) + text(b"/a") + text(b"cdr") + text(b""))


def mcap(path: Path, plain: bytes) -> Path:
    """An MCAP file with a chunk that grows some hundred times."""
    pytest.importorskip("mcap")
    packed = pytest.importorskip("zstandard").ZstdCompressor().compress(plain)
    head = struct.pack("<QQQI", 0, 0, len(plain), 0) + text(b"zstd") + struct.pack("<Q", len(packed))
    path.write_bytes(MAGIC + SCHEMA + CHANNEL + record(6, head + packed) + record(15, bytes(4)) + MAGIC)
    return path


@pytest.mark.parametrize(
    "plain",
    [
        record(5, struct.pack("<HIQQ", 1, 0, 0, 0)) * 3_000,
        record(3, struct.pack("<H", 2) + text(b"a/C") + text(b"ros2msg") + text(b"#" * 100_000)),
        record(4, struct.pack("<HH", 2, 1) + text(b"/" + b"a" * 100_000) + text(b"cdr") + text(b"")),
        record(12, text(b"more") + text(text(b"a") + text(b"b" * 100_000))),
    ],
    ids=["messages without bytes", "a schema", "a name", "metadata"],
)
def test_an_mcap_file_of_which_more_is_kept_than_it_can_hold_is_refused(tmp_path, monkeypatch, plain):
    file = mcap(tmp_path / "x.mcap", plain)
    assert 51 * file.stat().st_size < 100_000
    read_mcap(file, lambda *_: True)
    monkeypatch.setattr(f"{DECOMPRESSING}.LARGEST_CHUNK", 60_000)
    monkeypatch.setattr("coadjoint_vehicles.logs.bags.mcap_file.LARGEST_CHUNK", 1_000_000)
    with pytest.raises(FileError, match=KEPT):
        read_mcap(file, lambda *_: True)


def test_a_bag_of_ros_1_with_a_definition_that_is_larger_than_it_can_hold_is_refused(tmp_path, monkeypatch):
    def fields(**given: bytes) -> bytes:
        return text(b"".join(text(name.encode() + b"=" + value) for name, value in given.items()))

    more = fields(type=b"a/B", message_definition=b"#" * 200_000)
    plain = fields(op=b"\x07", conn=bytes(4), topic=b"/a") + more
    packed = bz2.compress(plain)
    chunk = fields(op=b"\x05", compression=b"bz2", size=struct.pack("<I", len(plain))) + text(packed)
    bag = fields(op=b"\x03", index_pos=struct.pack("<Q", 1)) + text(b"")
    file = tmp_path / "x.bag"
    file.write_bytes(ROS1 + bag + chunk)
    assert read_ros1(file, lambda *_: True).topics() == {"/a": ("a/B", 0)}
    monkeypatch.setattr(f"{DECOMPRESSING}.LARGEST_CHUNK", 60_000)
    with pytest.raises(FileError, match=KEPT):
        read_ros1(file, lambda *_: True)


def test_rows_of_a_database_that_are_the_same_bytes_are_refused(tmp_path):
    """Three definitions of which each goes on in the same pages, which hold a text of 1 MB once."""
    file = tmp_path / "x.db3"
    with contextlib.closing(sqlite3.connect(file)) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        base.execute("CREATE TABLE message_definitions(topic_type, encoding, encoded_message_definition)")
        for name in ("a/A", "a/B", "a/C"):
            base.execute("INSERT INTO message_definitions VALUES(?, 'ros2msg', ?)", (name, "#" * 300_000))
        base.commit()
        ((page,),) = base.execute("SELECT rootpage FROM sqlite_master WHERE name = 'message_definitions'")
    content = bytearray(file.read_bytes())
    leaf, first = 4096 * (page - 1), 0
    for place in struct.unpack_from(">3H", content, leaf + 8):
        cell = leaf + place
        payload = 0
        for at in range(cell, cell + 3):  # a number of seven bits a byte
            payload = payload << 7 | content[at] & 0x7F
        least = (4096 - 12) * 32 // 255 - 23
        held = least + (payload - least) % 4092
        behind = cell + 3 + 1 + (held if held <= 4096 - 35 else least)
        (chain,) = struct.unpack_from(">I", content, behind)
        first = first or chain
        struct.pack_into(">I", content, behind, first)
    last = first
    while following := struct.unpack_from(">I", content, 4096 * (last - 1))[0]:
        last = following
    struct.pack_into(">I", content, 28, last)
    file.write_bytes(content[: 4096 * last])
    with contextlib.closing(sqlite3.connect(file)) as base:
        held = base.execute("SELECT length(encoded_message_definition) FROM message_definitions").fetchall()
    assert held == [(300_000,)] * 3 and file.stat().st_size < 400_000
    with pytest.raises(FileError, match="its rows have more bytes than the file"):
        read_sqlite(file, lambda *_: True)
