"""Definitions of ROS messages: which numbers they hold, and a sentence for what is none."""

from __future__ import annotations

import pytest

from coadjoint.errors import FileError
from coadjoint_vehicles.logs.bags.definitions import definition, paths
from coadjoint_vehicles.logs.bags.messages import require_number
from coadjoint_vehicles.logs.bags.schemas import BODIES, known

DVL = """# a Doppler velocity log
std_msgs/Header header
uint8 BOTTOM = 0   # a constant
string<=16 name
float32 altitude 0.5
Beam[] beams
float64[3] offset
================================================================================
MSG: marine/Beam
geometry_msgs/Vector3 velocity
bool[<=4] locked
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def test_a_definition_of_ones_own_is_read_with_its_types():
    found = definition("marine/msg/Dvl", DVL, "here")
    assert found.name == "marine/Dvl"
    assert list(paths(found)) == [
        *("header.stamp.sec", "header.stamp.nanosec", "altitude"),
        *("beams[].velocity.x", "beams[].velocity.y", "beams[].velocity.z", "beams[].locked[]", "offset[]"),
    ]
    assert require_number(found, "beams[1].velocity.z", "") == "f8" and require_number(found, "offset[2]", "") == "f8"


@pytest.mark.parametrize(
    "path", ["depth", "header", "offset[3]", "offset", "altitude[0]", "beams.velocity.x", "name", ""]
)
def test_a_path_that_a_type_does_not_have_is_refused_with_the_nearest(path):
    with pytest.raises(FileError, match=r"^x.bag: /dvl is of marine/Dvl, which has no number `.*`; near to it are"):
        require_number(definition("marine/Dvl", DVL, "here"), path, "x.bag: /dvl")


@pytest.mark.parametrize("name", BODIES)
def test_every_definition_that_is_written_can_be_read(name):
    assert known(name).types[name]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("float64", "a line that is not a field: 'float64'"),
        ("float64 x;import os", "a line that is not a field"),
        ("a/B b", "lacks the type a/B"),
        ("a/A a", "holds the type a/A within itself"),
        ("float64 x\n===\nfloat64 y", "a part without `MSG: package/Type`"),
        ("\n".join(f"B b{i}" for i in range(999)) + "\n===\nMSG: a/B\n" + "bool x\n" * 99, "more than 20000 fields"),
    ],
)  # fmt: skip
def test_a_definition_that_is_none_is_refused(text, words):
    with pytest.raises(FileError, match=words):
        definition("a/A", text, "x.bag")
