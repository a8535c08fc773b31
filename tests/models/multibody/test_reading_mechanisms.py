"""Mechanisms of URDF: bodies, joints and gears of a small arm, and a sentence for what cannot be read."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups import attitude
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import multibody
from coadjoint.models.descriptions.links import require_mass, together
from coadjoint.models.multibody.placing import Placing


def link(name: str, mass: float = 1.0, inertia: str = 'ixx="0.02" iyy="0.03" izz="0.04"', at: str = "0 0 0") -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia {inertia}/></inertial>'
        f'<visual><geometry><sphere radius="1"/></geometry></visual></link>'
    )


def joint(name: str, kind: str, parent: str, child: str, more: str = "", at: str = 'xyz="0 0 0"') -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin {at}/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


ARM = f"""<robot name="arm">
{link("base")}
{link("upper-arm", mass=2, at="0 0 -0.5")}
<link name="flange"/>
{link("tool", mass=1, at="0.1 0 0")}
{link("left")}
{link("right")}
{link("wheel")}
{
    joint(
        "shoulder",
        "revolute",
        "base",
        "upper-arm",
        '<axis xyz="0 0 2"/><limit lower="-1" upper="2" effort="30" velocity="3"/>'
        '<dynamics damping="0.4" friction="0.1"/>',
        'xyz="0 0 1" rpy="1.5707963267948966 0 0"',
    )
}
{joint("rigid", "fixed", "upper-arm", "flange", at='xyz="0 0 -1"')}
{joint("bolt", "fixed", "flange", "tool", at='xyz="0 0 -0.2"')}
{joint("left_slide", "prismatic", "tool", "left", '<axis xyz="0 1 0"/>')}
{joint("right_slide", "prismatic", "tool", "right", '<axis xyz="0 1 0"/><mimic joint="left_slide" multiplier="-1"/>')}
{joint("turn", "continuous", "upper-arm", "wheel", '<axis xyz="1 0 0"/><mimic joint="shoulder" multiplier="1.5"/>')}
<transmission name="t"/>
</robot>"""


def read(tmp_path, text: str, **more) -> multibody.ReadMechanism:
    (tmp_path / "arm.urdf").write_text(text)
    return multibody.read(tmp_path / "arm.urdf", **more)


def test_links_become_bodies_and_joints_and_mimics_gears(tmp_path):
    found = read(tmp_path, ARM, motors=["shoulder"])
    made = found.mechanism
    assert list(made.bodies) == ["upper_arm", "left", "right", "wheel"]
    arm = made.bodies["upper_arm"]
    turned = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # by a right angle about x
    assert arm.rotation == pytest.approx(turned, abs=1e-15) and arm.position == pytest.approx([0, 0, 1])
    assert arm.mass == 3 and arm.center == pytest.approx([0.1 / 3, 0, (-2 * 0.5 - 1.2) / 3])
    apart = np.array([0.1, 0, -0.7])  # from one mass centre to the other
    steiner = 2 / 3 * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    assert arm.inertia == pytest.approx(2 * np.diag([0.02, 0.03, 0.04]) + steiner)
    shoulder = made.joints["shoulder"]
    assert (shoulder.kind, shoulder.first, shoulder.second) == ("revolute", "ground", "upper_arm")
    assert shoulder.axis == pytest.approx([0, -1, 0], abs=1e-15) and shoulder.at == pytest.approx([0, 0, 1])
    assert shoulder.damping == 0.4 and shoulder.motor and made.joints["turn"].motor is None
    assert made.joints["left_slide"].at == pytest.approx([0, 1.2, 1])
    gears = {key: one.teeth for key, one in made.joints.items() if one.kind == "gear"}
    assert gears == {"right_slide_mimics_left_slide": (1, 1), "turn_mimics_shoulder": (2, -3)}
    text = str(found)
    assert "arm.urdf:9: the limits of `shoulder`, lower -1, upper 2, effort 30, velocity 3, do not act." in text
    assert "dry friction of `shoulder`" in text and "flange, tool: on fixed joints" in text
    assert "'upper-arm' is called `upper_arm`." in text and "1 kg are left out" in text
    assert "Left out: 1 <transmission>, 6 <visual>." in text


def test_the_inertia_of_turned_links_is_symmetric_to_the_bit():
    """I = I₁ + R I₁ Rᵀ + 2 m (|c|²1 − c cᵀ) of two equal links, one of which is turned and 2c away."""
    R, c = attitude.zyx(0.3, -0.7, 1.1), np.array([0.3, -0.2, 0.5])
    one = SimpleNamespace(mass=1.0, center=np.zeros(3), inertia=np.diag([0.7, 0.9, 1.1]))
    poses = [SimpleNamespace(R=turn, place=lambda x, d=d: x + d) for turn, d in ((np.eye(3), 0 * c), (R, 2 * c))]
    found = together(cast(Any, [(one, pose) for pose in poses]))
    assert found.mass == 2 and found.center == pytest.approx(c)
    steiner = 2 * (c @ c * np.eye(3) - np.outer(c, c))
    assert found.inertia == pytest.approx(one.inertia + R @ one.inertia @ R.T + steiner)
    np.testing.assert_array_equal(found.inertia, found.inertia.T)


def test_fingers_that_mimic_one_another_slide_together(tmp_path):
    """The row of a gear of two distances, and the place of the one from that of the other."""
    made = read(tmp_path, ARM).mechanism
    g, q, _, _ = Placing(made, {"left_slide": 0.03}, {}, {}, {}, {}).found()
    assert q[1:3] == pytest.approx(np.array([[0, 1.2, 1.03], [0, 1.2, 0.97]]), abs=1e-15)
    bond = made.bonds["right_slide_mimics_left_slide"]
    at = made.system.state(g=g, q=q, a0={"pose": None, "gravity": [0, 0, 0]})
    gap = evaluate(lambda s: bond.gap(s.named.n, s.named.a, made.system.parameters), at)
    assert gap == pytest.approx([0], abs=1e-15)


def test_a_root_link_is_free_where_it_floats(tmp_path):
    made = read(tmp_path, ARM, floating=True, motors=True).mechanism
    assert next(iter(made.bodies)) == "base" and made.joints["shoulder"].first == "base"
    assert [key for key, one in made.joints.items() if one.motor] == ["shoulder", "left_slide", "right_slide", "turn"]


PAIR = link("a") + link("b")


def hinge(more: str, second: str = link("b")) -> str:
    return f"<robot>{link('a')}{second}{joint('j', 'revolute', 'a', 'b', more)}</robot>"


WRONG = {
    "a document type": ('<!DOCTYPE r [<!ENTITY a "ha">]><robot name="r">&a;</robot>', "document type"),
    "another root": ("<sdf/>", "URDF begins with <robot>"),
    "xacro": ('<robot name="r"><xacro:macro/></robot>', "arm.urdf:1: <xacro:macro> is xacro: expand the file first"),
    "no link": ('<robot name="r"/>', "needs one link that is no joint's child, but has none"),
    "two roots": (f"<robot>{PAIR}</robot>", "but has a, b"),
    "two parents": (
        f"<robot>{PAIR}{link('c')}{joint('i', 'fixed', 'a', 'c')}{joint('j', 'fixed', 'b', 'c')}</robot>",
        "<joint> 'j' is a second joint that has the link 'c' as its child",
    ),
    "a loop": (
        f"<robot>{PAIR}{link('c')}{joint('i', 'fixed', 'b', 'c')}{joint('j', 'fixed', 'c', 'b')}</robot>",
        "<link> 'b' hangs on itself",
    ),
    "an unknown link": (f"<robot>{PAIR}{joint('j', 'fixed', 'a', 'c')}{joint('k', 'fixed', 'a', 'b')}</robot>", "'c'"),
    "an unknown type": (
        f"<robot>{PAIR}{joint('j', 'ball', 'a', 'b')}</robot>",
        "has the type 'ball', but",
    ),
    "no mass": (
        f'<robot>{link("a")}<link name="b"/>{joint("j", "revolute", "a", "b")}</robot>',
        "<link> 'b' moves, but has no mass",
    ),
    "moments of no body": (
        hinge("", link("b", inertia='ixx="1" iyy="1" izz="3"')),
        "<link> 'b' is no rigid body: Argument `inertia` must satisfy",
    ),
    "no axis": (hinge('<axis xyz="0 0 0"/>'), "not zero"),
    "negative damping": (
        hinge('<dynamics damping="-1"/>'),
        "<joint> 'j' cannot be read: Argument `damping`",
    ),
    "no leader": (hinge('<mimic joint="k"/>'), "mimics the joint"),
    "names alike": (
        f"<robot>{link('z')}{link('a.b')}{link('a-b')}{joint('j', 'revolute', 'z', 'a.b')}"
        f"{joint('k', 'revolute', 'z', 'a-b')}</robot>",
        "has the name `a_b`, as another",
    ),
    "a name that is taken": (f"<robot>{PAIR}{joint('mass', 'revolute', 'a', 'b')}</robot>", "other than mass, inertia"),
    "a number that is none": (f"<robot>{link('a', mass='much')}</robot>", "must be numbers, but is 'much'"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_file_that_is_no_mechanism_raises_an_error_with_its_line(wrong, tmp_path):
    text, sentence = WRONG[wrong]
    with pytest.raises(co.errors.FileError) as raised:
        read(tmp_path, text)
    assert sentence in str(raised.value) and "arm.urdf" in str(raised.value)


def test_a_motor_of_an_unknown_joint_and_a_missing_file_are_named(tmp_path):
    with pytest.raises(co.errors.ArgumentError, match="`motors` has no joint `elbow`"):
        read(tmp_path, ARM, motors=["elbow"])
    with pytest.raises(co.errors.FileError, match="There is no file"):
        multibody.read(tmp_path / "none.urdf")


def test_a_mimic_that_is_no_gear_is_reported_and_a_rounded_inertia_mended(tmp_path):
    inertia = 'ixx="0.1" iyy="0.2" izz="0.30001"'
    text = f"<robot>{link('a')}{link('b', inertia=inertia)}{link('c')}{joint('j', 'revolute', 'a', 'b')}"
    text += joint("k", "prismatic", "a", "c", '<mimic joint="j" multiplier="0.5"/>') + "</robot>"
    found = read(tmp_path, text)
    assert list(found.mechanism.joints) == ["j", "k"]
    assert "`k` moves freely: 0.5 times `j` plus 0 is not a gear" in str(found)
    assert np.diag(found.mechanism.bodies["b"].inertia) == pytest.approx([0.1, 0.2, 0.3])


def test_links_without_a_mass_raise():
    massless: Any = (SimpleNamespace(mass=0.0), None)
    heavy: Any = (SimpleNamespace(mass=1.0), None)
    require_mass([massless, heavy], "robot.urdf")
    with pytest.raises(co.errors.FileError, match=r"^robot\.urdf: no link that joints connect has a mass"):
        require_mass([massless], "robot.urdf")
