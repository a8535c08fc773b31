"""Files of one bag: their messages follow one another, and a topic has one type in all of them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import pytest

from coadjoint.errors import FileError
from coadjoint_vehicles.logs.bags.bag import Bag, BagChannel
from coadjoint_vehicles.logs.bags.messages import Topic
from coadjoint_vehicles.logs.bags.reading import _topics


class Block(NamedTuple):
    """One message."""

    text: str


def bag(where: str, topic: Topic) -> Any:
    """A file of a bag with one topic."""
    whole = replace(topic, where=where)
    listed = {topic.name: (topic.definition.name, len(topic.blocks))}
    return cast(Any, SimpleNamespace(topics=lambda: listed, topic=lambda name: whole))


def of(kind: str, *texts: str) -> Topic:
    definition = cast(Any, SimpleNamespace(name=kind, types={kind: ()}))
    blocks = cast(Any, tuple(map(Block, texts)))
    return Topic("/depth", definition, "cdr", blocks, "")


def test_the_messages_of_a_topic_are_those_of_all_files_in_their_order():
    first = of("Float64", "a", "b")
    (found,) = _topics([bag("0.mcap", first), bag("1.mcap", of("Float64", "c"))])
    assert [block.text for block in found.blocks] == ["a", "b", "c"] and found.where == "0.mcap"


def test_a_topic_without_messages_is_left_out():
    assert _topics([bag("0.mcap", of("Float64"))]) == []


def test_a_topic_whose_type_differs_between_files_raises_file_error():
    with pytest.raises(FileError, match=r"1\.mcap: /depth has messages of another type than in 0\.mcap"):
        _topics([bag("0.mcap", of("Float64", "a")), bag("1.mcap", of("Float32", "b"))])


@pytest.mark.parametrize("other", [{"type": "b/B"}, {"text": b"float32 x"}], ids=["type", "definition"])
def test_a_topic_that_a_file_writes_in_two_ways_raises_file_error(other):
    one = BagChannel("/depth", "a/A", "cdr", "ros2msg", b"float64 x")
    assert Bag("0.mcap", {1: one, 2: one}).topic("/depth").definition.name == "a/A"
    for channels in ({1: one, 2: one._replace(**other)}, {1: one._replace(**other), 2: one}):
        with pytest.raises(FileError, match=r"0\.mcap: /depth has messages of two types"):
            Bag("0.mcap", channels).topic("/depth")
