"""A bag: topics with their messages, whatever the format of the file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from coadjoint.errors import FileError
from coadjoint_vehicles.logs.bags.decompressing import require_kept
from coadjoint_vehicles.logs.bags.definitions import Definition, definition
from coadjoint_vehicles.logs.bags.messages import Block, Topic


class BagChannel(NamedTuple):
    """A row of messages: the topic, its type, how they are written, and the definition of the type."""

    topic: str
    type: str
    written: str
    format: str
    text: bytes


@dataclass
class Bag:
    """The contents of a bag: its channels by their numbers, their messages, and its metadata."""

    path: str
    channels: dict[int, BagChannel] = field(default_factory=dict)
    blocks: dict[int, list[Block]] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    size: int = 0
    """Bytes of the file."""
    kept: int = 0
    """Bytes unpacked and kept: messages with their places, schemas, names and metadata."""

    def topics(self) -> dict[str, tuple[str, int]]:
        """Type and number of messages of every topic."""
        found: dict[str, tuple[str, int]] = {}
        for number, channel in self.channels.items():
            before = found.get(channel.topic, ("", 0))[1]
            found[channel.topic] = channel.type, before + sum(map(len, self.blocks.get(number, ())))
        return found

    def topic(self, name: str) -> Topic:
        """A topic with its messages; raises FileError for one that is not there or that is written in other ways."""
        numbers = [number for number, channel in self.channels.items() if channel.topic == name]
        channel = self.channels[numbers[0]]
        if any(self.channels[n].type != channel.type or self.channels[n].text != channel.text for n in numbers):
            raise FileError(f"{self.path}: {name} has messages of two types, {channel.type} among them.")
        blocks = tuple(block for number in numbers for block in self.blocks.get(number, ()))
        return Topic(name, self._definition(channel), channel.written, blocks, self.path)

    def _definition(self, channel: BagChannel) -> Definition:
        where = f"{self.path}: {channel.topic}"
        if channel.written not in ("cdr", "ros1"):
            raise FileError(f'{where} is written in "{channel.written}", but only "cdr" of ROS 2 and "ros1" are read.')
        if not channel.text:
            raise FileError(f"{where}: the file has no definition of {channel.type}, which is none that is known.")
        if channel.format not in ("ros2msg", "ros1msg"):
            raise FileError(f'{where} is defined in "{channel.format}", but only "ros2msg" and "ros1msg" are read.')
        try:
            text = channel.text.decode()
        except UnicodeDecodeError as error:
            raise FileError(f"{where}: the definition of {channel.type} is not a text in UTF-8.") from error
        return definition(channel.type, text, where)

    def keep(self, size: int) -> None:
        """Count bytes that are kept; raises FileError where they are too many for the file."""
        self.kept += size
        require_kept(self.path, self.kept, self.size)

    def add(self, number: int, content: memoryview, rows: Sequence[tuple[int, int, int]], alone: bool) -> None:
        """Messages of a channel: begin, size and time of each in `content`; `alone`: without the bytes between them."""
        table = np.array(rows, np.int64).reshape(-1, 3)
        block = Block(content, table[:, 0], table[:, 1], table[:, 2])
        if alone:
            self.keep(int(table[:, 1].sum()) + table.nbytes)
        self.blocks.setdefault(number, []).append(block.alone() if alone else block)


@dataclass
class TopicLog:
    """The contents of a log whose topics, such as `ATT` and `IMU[0]` of ArduPilot, are `found` when it is read."""

    path: str
    found: dict[str, Topic] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def topics(self) -> dict[str, tuple[str, int]]:
        """Type and number of messages of every topic."""
        return {name: (topic.definition.name, len(topic)) for name, topic in self.found.items()}

    def topic(self, name: str) -> Topic:
        return self.found[name]
