"""Files that cannot be read: a sentence each, with file and line; nothing is run, opened or expanded without bound."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from coadjoint.cli.main import main
from coadjoint.errors import CoadjointError, FileError
from coadjoint.models.descriptions.frames import numbers
from coadjoint_vehicles.importing import import_vehicle

HERE = Path(__file__).parent / "descriptions"
XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
LAUGHS = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 12))
DOUBLED = "".join(f'<xacro:property name="a{i}" value="${{a{i - 1}}}${{a{i - 1}}}"/>' for i in range(1, 60))
TWICE = '<xacro:macro name="m" params=""><xacro:m/><xacro:m/></xacro:macro><xacro:m/>'
BLOCK = '<xacro:property name="p"><xacro:insert_block name="p"/></xacro:property><xacro:insert_block name="p"/>'
CHAIN = "".join(f'<xacro:property name="a{i}" value="${{a{i - 1}}}"/>' for i in range(1, 3000))
NESTED = "(" * 40 + "1" + ")" * 40

WHOLE = {
    "billion laughs": (f'<!DOCTYPE r [<!ENTITY a0 "ha">{LAUGHS}]><robot name="r">&a11;</robot>', "document type"),
    "external entity": ('<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot>&a;</robot>', "document type"),
    "no XML": ("mass: 3", "XML cannot be read"),
    "an end that is not there": ('<robot name="r"><link name="a">', "XML cannot be read"),
    "too deep": ("<robot>" + "<a>" * 70 + "</a>" * 70 + "</robot>", "64 elements within each other"),
    "too many": ("<robot>" + "<a/>" * 60_000 + "</robot>", "50,000 elements"),
    "another root": ("<mujoco/>", "SDF begins with <sdf>"),
    "no hydrodynamics": ('<robot name="r"><link name="a"/></robot>', "systems of Gazebo (gz-sim-hydrodynamics-system"),
    "Python": (f'<robot {XACRO} a="${{__import__(1)}}"/>', "calls `__import__`"),
    "attributes of objects": (f'<robot {XACRO} a="${{pi.real}}"/>', "no Python is run"),
    "a list": (f'<robot {XACRO} a="${{[1][0]}}"/>', "no Python is run"),
    "no such property": (f'<robot {XACRO} a="${{2*mass}}"/>', "there is no property `mass`"),
    "itself": (f'<robot {XACRO}><xacro:property name="a" value="${{a}}"/><b c="${{a}}"/></robot>', "by itself"),
    "division": (f'<robot {XACRO} a="${{1/0}}"/>', "divides by zero"),
    "parentheses": (f'<robot {XACRO} a="${{{NESTED}}}"/>', "more than 32 parentheses"),
    "doubling": (
        f'<robot {XACRO}><xacro:property name="a0" value="{100 * "ha"}"/>{DOUBLED}<b c="${{a59}}"/></robot>',
        "text of",
    ),
    "doubling nothing": (
        f'<robot {XACRO}><xacro:property name="a0" value=""/>{DOUBLED}<b c="${{a59}}"/></robot>',
        "more",
    ),
    "a chain": (f'<robot {XACRO}>{CHAIN}<b c="${{a2999}}"/></robot>', "more than 64 properties"),
    "a block in itself": (f"<robot {XACRO}>{BLOCK}</robot>", "more than 64 elements, macros"),
    "macros in macros": (f"<robot {XACRO}>{TWICE}</robot>", "more than 64 elements, macros"),
    "outside": (f'<robot {XACRO}><xacro:include filename="../../etc/passwd"/></robot>', "outside of the folder"),
    "root of the disk": (f'<robot {XACRO}><xacro:include filename="/etc/passwd"/></robot>', "outside of the folder"),
    "an address": (f'<robot {XACRO}><xacro:include filename="https://example.org/a"/></robot>', "addresses are not"),
    "a command": (f'<robot {XACRO} a="$(eval 1+1)"/>', "only `arg` and `find`"),
    "an argument": (f'<robot {XACRO} a="$(arg mass)"/>', "--set mass=VALUE"),
    "a world of two": ('<sdf><model name="a"/><model name="b"/></sdf>', "one <model>"),
    "a model from afar": (
        "<sdf><model name='a'><include><uri>https://a.org/b</uri></include></model></sdf>",
        "addresses",
    ),
    "a model outside": ("<sdf><model name='a'><include><uri>../../b</uri></include></model></sdf>", "outside"),
}
ROV = {
    "a matrix cut short": ("7.8033\n", "7.8033 1\n", "must hold 36 numbers, but has 37"),
    "a word in a matrix": ("779.79", "many", "must be numbers"),
    "added mass of derivatives": ("779.79 ", "-779.79 ", "no negative eigenvalue"),
    "crooked added mass": ("51.29 3659.9", "951.29 3659.9", "symmetric matrix"),
    "another model": ("fossen", "sphere", "only 'fossen' is read"),
    "no volume": ("<volume>${volume}</volume>", "", "needs <volume>"),
    "another link": ('<link name="${ns}/base_link">', '<link name="hull">', "names the link 'hull'"),
    "an infinite volume": ("<volume>${volume}", "<volume>inf", "must be finite"),
}
TORPEDO = {
    "a joint that is not there": ("<joint_name>propeller_joint", "<joint_name>screw", "names the joint 'screw'"),
    "added mass with the other sign": ("<xDotU>-4", "<xDotU>4", "added mass below zero"),
    "a link that is not there": ("<child>propeller<", "<child>screw<", "joins the link 'screw'"),
    "poses in a circle": (
        "<pose>1.05 0 0 0 0 0</pose>",
        '<pose relative_to="horizontal_fins"/>',
        "comes back to itself",
    ),
    "a pose of five": ("<pose>1.43162 0 0 0 0 0</pose>", "<pose>1.43162 0 0 0 0</pose>", "must hold 6 numbers"),
    "a mass below zero": ("<mass>147.0671", "<mass>-1", "must not be negative"),
    "a fin about its chord": ("<xyz>0 0 1</xyz>", "<xyz>1 0 0</xyz>", "turns about an axis"),
    "an axis in the parent's axes": (
        "<xyz>-1 0 0</xyz>",
        '<xyz expressed_in="base_link">1 0 0</xyz>',
        "expressed in 'base_link', but a direction is read only in the axes of its joint, of its child link",
    ),
    "an axis of no length": ("<xyz>-1 0 0</xyz>", "<xyz>0 0 0</xyz>", "has the direction 0 0 0"),
    "a propeller on nothing": (
        "<parent>base_link</parent><child>propeller<",
        "<parent>propeller</parent><child>propeller<",
        "acts on the link 'propeller', which no joint connects",
    ),
    "an inertial elsewhere": (
        "<inertial>",
        '<inertial><pose relative_to="propeller">0 0 0 0 0 0</pose>',
        "in its link",
    ),
    "quaternions": ("<pose>1.43162", '<pose rotation_format="quat_xyzw">1.43162', "roll, pitch and yaw"),
}


def refused(path: Path, expected: str) -> None:
    with pytest.raises(CoadjointError) as caught:
        import_vehicle(path)
    sentence = str(caught.value)
    assert expected in sentence and path.name in sentence
    assert "\n" not in sentence and len(sentence) < 400


@pytest.mark.parametrize("case", WHOLE)
def test_a_wrong_file_has_a_sentence(case: str, tmp_path: Path) -> None:
    text, expected = WHOLE[case]
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "wrong.xml").write_text(text)
    refused(tmp_path / "below" / "wrong.xml", expected)


@pytest.mark.parametrize("case", ROV)
def test_a_wrong_description_has_a_sentence(case: str, tmp_path: Path) -> None:
    old, new, expected = ROV[case]
    for source in (HERE / "rov").iterdir():
        text = source.read_text()
        changed = text.replace(old, new, 1) if source.name == "hydrodynamics.xacro" else text
        assert source.name != "hydrodynamics.xacro" or changed != text
        (tmp_path / source.name.replace("hydrodynamics", "rov_water")).write_text(
            changed.replace("hydrodynamics.xacro", "rov_water.xacro").replace("$(find rov)/", "")
        )
    with pytest.raises(CoadjointError, match=expected.replace("(", r"\(")):
        import_vehicle(tmp_path / "rov.xacro")


@pytest.mark.parametrize("case", TORPEDO)
def test_a_wrong_model_has_a_sentence(case: str, tmp_path: Path) -> None:
    old, new, expected = TORPEDO[case]
    text = (HERE / "torpedo.sdf").read_text()
    assert old in text
    (tmp_path / "wrong.sdf").write_text(text.replace(old, new, 1))
    refused(tmp_path / "wrong.sdf", expected)


@pytest.mark.long
def test_the_command_writes_a_vehicle_file_and_never_over_one(tmp_path: Path, capsys) -> None:
    out = tmp_path / "torpedo.toml"
    command = ["import", str(HERE / "torpedo.sdf"), "--forward", "-x", "--out", str(out)]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "Taken over:" in said and "torpedo.sdf:" in said and "Not taken over:" in said
    assert "[[part]]" in out.read_text() and main(["vehicles", "show", str(out)]) == 0
    capsys.readouterr()
    assert main(command) == 2 and "must be a new file" in capsys.readouterr().err
    assert main(["import", str(tmp_path / "nothing.sdf")]) == 2


def test_files_that_include_without_end_are_bounded(tmp_path: Path, monkeypatch) -> None:
    """Files, their bytes and what is made of them in all."""
    (tmp_path / "empty.xml").write_text("<r/>")
    (tmp_path / "long.xml").write_text(f'<r a="{"b" * 90_000}"/>')
    (tmp_path / "made.xml").write_text(f'<r><s a="{"b" * 90_000}"/></r>')
    include = '<xacro:include filename="{}.xml"/>'
    for name, count, expected in (("empty", 300, "256 files"), ("long", 180, "16 MB"), ("made", 120, "characters in")):
        (tmp_path / "wrong.xml").write_text(f"<robot {XACRO}>{count * include.format(name)}</robot>")
        with pytest.raises(CoadjointError, match=expected):
            import_vehicle(tmp_path / "wrong.xml")
    part = "<sdf><model name='p'>{}</model></sdf>"
    (tmp_path / "part.sdf").write_text(part.format("<link name='a'/>"))
    (tmp_path / "large.sdf").write_text(part.format(30_000 * "<a/>"))
    for name, count, expected in (("part", 70, "more than 64 files"), ("large", 2, "50,000 elements")):
        included = count * f"<include><uri>{name}.sdf</uri></include>"
        (tmp_path / "wrong.sdf").write_text(f"<sdf><model name='a'>{included}</model></sdf>")
        with pytest.raises(CoadjointError, match=expected):
            import_vehicle(tmp_path / "wrong.sdf")


@pytest.mark.parametrize("encoding", ["utf-7", "iso-8859-1", "none"])
def test_a_text_in_utf_8_is_read_as_that_whatever_it_says(encoding: str, tmp_path: Path) -> None:
    text = (HERE / "torpedo.sdf").read_text().replace('model name="torpedo"', 'model name="Schraübe"')
    head, _, rest = text.partition("?>") if text.startswith("<?xml") else ("", "", text)
    assert "Schraübe" in rest and not head.count("<model")
    (tmp_path / "torpedo.sdf").write_text(f'<?xml version="1.0" encoding="{encoding}"?>{rest}')
    found = import_vehicle(tmp_path / "torpedo.sdf", forward="-x")
    assert found.vehicle.name == "Schraübe"


def test_one_number_beyond_all_bounds_is_told():
    element: Any = SimpleNamespace(fail=lambda told: FileError(told))
    assert numbers(element, "1 -1e15", (2,), "xyz").tolist() == [1.0, -1e15]
    for text in ("1 2e30", "inf 1", "nan 1"):
        with pytest.raises(FileError, match="xyz must be finite"):
            numbers(element, text, (2,), "xyz")
