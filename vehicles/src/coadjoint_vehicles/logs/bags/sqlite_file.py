"""Bags of ROS 2 as SQLite databases, `.db3`."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from urllib.parse import quote

from coadjoint.errors import FileError, error_line
from coadjoint_vehicles.logs.bags.bag import Bag, BagChannel
from coadjoint_vehicles.logs.bags.definitions import short
from coadjoint_vehicles.logs.bags.schemas import BODIES, schema

SMALL = 1_000_000
"""Bytes that a text or message may have in any file; computed columns could make more than the file has."""
WORK, LEAST, EACH = 100, 10_000_000, 10_000
"""Instructions of SQLite that reading may take: so many a byte of the file, and as many in any file; how many between
two looks. Pages that count as parts of many others could make rows without end."""
ROW = 8
"""Bytes of the file that a row takes at least, besides those of its texts and messages."""
MAGIC = b"SQLite format 3\0"
_TABLES = """SELECT name FROM sqlite_master
WHERE type = 'table' AND name IN ('topics', 'messages', 'message_definitions')"""


def read_sqlite(path: Path, wanted: Callable[[str, str], bool], partial: bool = False) -> Bag:
    """A database of rosbag2 with the messages of those topics for which `wanted(topic, type)` is true.

    partial: without effect. Definitions of messages are those in the file; files before ROS Iron have none and get
    those of the library. Raises FileError for files that are not such bags or cannot be read.
    """
    with path.open("rb") as opened:
        if opened.read(len(MAGIC)) != MAGIC:
            raise FileError(f"The file {path} is not a bag of ROS 2: it is not an SQLite database.")
    journal = path.with_name(path.name + "-wal")
    if journal.is_file() and journal.stat().st_size:
        raise FileError(
            f"The bag {path} was not closed, and {journal.name} next to it holds messages: stop the recorder, then "
            f"write them into the bag by `sqlite3 {path.name} 'PRAGMA wal_checkpoint(TRUNCATE)'`."
        )
    try:
        base = sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1", uri=True)
        try:
            base.execute("PRAGMA trusted_schema = OFF")
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(path.stat().st_size, SMALL))
            base.set_progress_handler(_within(LEAST + WORK * path.stat().st_size), EACH)
            return _read(base, path, wanted)
        finally:
            base.close()
    except sqlite3.Error as error:
        raise FileError(f"The bag {path} is damaged, or no bag of ROS 2 ({error_line(error)}).") from error


def _read(base: sqlite3.Connection, path: Path, wanted: Callable[[str, str], bool]) -> Bag:
    found = Bag(str(path), size=path.stat().st_size)
    tables = {name for (name,) in base.execute(_TABLES)}
    if not {"topics", "messages"} <= tables:
        raise FileError(f"The file {path} is not a bag of ROS 2: it has no tables `topics` and `messages`.")
    for table in sorted(tables):
        if any(hidden for *_, hidden in base.execute(f"PRAGMA table_xinfo({table})")):
            raise FileError(
                f"The file {path} is not a bag of ROS 2: its table `{table}` has columns that are computed."
            )
    held, texts = 0, dict[str, tuple[str, bytes]]()
    if "message_definitions" in tables:
        rows = base.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        for row in rows:
            _require_texts(path, "message_definitions", row)
            kind, written, text = row
            held = _held(found, held, *row)
            texts[kind] = written, text.encode()
    for number, *row in base.execute("SELECT id, name, type, serialization_format FROM topics"):
        _require_texts(path, "topics", row)
        topic, kind, written = row
        held = _held(found, held, *row)
        if kind not in texts and short(kind) in BODIES:
            texts[kind] = "ros2msg", schema(short(kind)).encode()
        found.channels[number] = BagChannel(topic, kind, written, *texts.get(kind, ("", b"")))
        if wanted(topic, short(kind)):
            held = _messages(base, number, found, held)
    return found


def _within(most: int) -> Callable[[], bool]:
    """The callback of SQLite after every `EACH` instructions: stops it after more than `most` of them."""
    looks = count(1)
    return lambda: next(looks) * EACH > most


def _require_texts(path: Path, table: str, row: Sequence[object]) -> None:
    for value in row:
        if not isinstance(value, str):
            raise FileError(f"The bag {path} is damaged: a row of its table `{table}` holds {value!r:.40} for a text.")


def _held(found: Bag, held: int, *parts: str | bytes) -> int:
    """The bytes that rows take in the file at least, with one more row; raises FileError for more than the file has."""
    held += ROW + sum(map(len, parts))
    if held > found.size:
        raise FileError(f"The bag {found.path} is damaged: its rows have more bytes than the file.")
    return held


def _messages(base: sqlite3.Connection, number: int, found: Bag, held: int) -> int:
    """Add the messages of a topic; the bytes that they and the rows before, `held`, take in the file at least."""
    rows, parts, at = [], [], 0
    asked = "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY id"
    for time, data in base.execute(asked, (number,)):
        if not isinstance(time, int) or not isinstance(data, bytes):
            raise FileError(f"{found.path}: a message of {found.channels[number].topic} has no time or no bytes.")
        rows.append((at, len(data), time))
        parts.append(data)
        at += len(data)
        held = _held(found, held, data)
    found.add(number, memoryview(b"".join(parts)), rows, alone=False)
    return held
