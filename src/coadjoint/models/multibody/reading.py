"""Mechanisms from URDF: links become bodies, and what the equations leave out is reported."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError, FileError, prefixed
from coadjoint.mechanics.members import Quantity
from coadjoint.models.descriptions.elements import Element, read_elements
from coadjoint.models.descriptions.frames import Placement
from coadjoint.models.descriptions.links import ROUNDED, DescribedJoint, DescribedLink, placed, together
from coadjoint.models.descriptions.urdf import joints_of, links_of
from coadjoint.models.multibody.bodies import Body
from coadjoint.models.multibody.joints import KINDS, SPACE, Joint
from coadjoint.models.multibody.mechanism import Mechanism

MOVING = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "planar": "planar"}
"""The kind of a joint by its type in URDF; links on those of the type fixed become one body, floating ones are free."""

TEETH = 1000
"""The largest whole number in a ratio of joints."""


@dataclass(frozen=True)
class ReadMechanism:
    """A mechanism from a file. report: sentences on what of the file it leaves out or has otherwise."""

    mechanism: Mechanism
    report: tuple[str, ...]

    def __str__(self) -> str:
        return "\n".join(self.report)


def read(
    path: str | os.PathLike[str],
    *,
    floating: bool = False,
    motors: Sequence[str] | bool = (),
    gravity: Quantity = (0.0, 0.0, -9.81),
) -> ReadMechanism:
    """The mechanism of a URDF file.

        arm = multibody.read("arm.urdf", motors=["shoulder", "elbow"])
        print(arm.report)
        run = co.simulate(arm.mechanism.system, arm.mechanism.state(), dt=0.01, duration=1.0, inputs={…})

    Links on fixed joints become one body, which has the name of the first. The reference configuration is that with all
    joints at 0, in the frame of the root link. A joint that mimics another is coupled by a gear where both turn or both
    slide, the multiplier is a ratio of whole numbers up to 1000 and the offset is 0. Damping is taken; limits and dry
    friction are reported. The file runs no code and names no other file.

    Arguments:
        path: the file.
        floating: whether the root link is free; by default it is the ground.
        motors: names of joints at which an input of the joint's name acts, True for all that turn or slide.
        gravity: the acceleration in space, (3,), m/s².

    Raises FileError, with file and line, for unreadable or impossible values, and ArgumentError.
    """
    source = Path(path)
    root = read_elements(source, source.name)
    if root.tag != "robot":
        raise FileError(f"{source.name}: the root is {root.label}, but URDF begins with <robot>.")
    for element in root.walk():
        if element.tag.startswith("xacro:"):
            raise element.fail("is xacro: expand the file first, as `xacro robot.urdf.xacro > robot.urdf` does.")
    reading = _Reading(root, links_of(root), joints_of(root), checks.truth(floating, "floating"))
    bodies = reading.bodies()
    joints = reading.joints(motors)
    with prefixed(f"{source.name}: no mechanism can be made of it"):
        made = Mechanism(bodies=bodies, joints=joints, gravity=gravity, name=root.get("name") or source.stem)
    return ReadMechanism(made, (*reading.report, *_left_out(root)))


class _Reading:
    """Links and joints of a file, while a mechanism is made of them."""

    def __init__(self, root: Element, links: dict[str, DescribedLink], joints: list[DescribedJoint], floating: bool):
        self.links, self.floating = links, floating
        self.report: list[str] = []
        self.above: dict[str, DescribedJoint] = {}
        for joint in joints:
            for end in (joint.parent, joint.child):
                if end not in links:
                    raise joint.element.fail(checks.unknown(f"link {end!r}", "names a link, but the file", end, links))
            if joint.child in self.above:
                raise joint.element.fail(f"is a second joint that has the link {joint.child!r} as its child.")
            self.above[joint.child] = joint
        roots = [name for name in links if name not in self.above]
        if len(roots) != 1:
            raise root.fail(f"needs one link that is no joint's child, but has {', '.join(roots) or 'none'}.")
        self.base = roots[0]
        self.poses = placed(links, joints, self.base)
        if apart := [name for name in links if name not in self.poses]:
            raise links[apart[0]].element.fail("hangs on itself, by joints that form a loop.")

    def carrier(self, link: str) -> str:
        """The link whose body a link is part of."""
        while link in self.above and self.above[link].kind == "fixed":
            link = self.above[link].parent
        return link

    def name(self, link: str) -> str:
        """The name of the body that a link is part of."""
        carrier = self.carrier(link)
        return SPACE if carrier == self.base and not self.floating else self._word(carrier)

    def bodies(self) -> dict[str, Body]:
        """The bodies of all links, those on fixed joints together."""
        found: dict[str, Body] = {}
        for link in dict.fromkeys(map(self.carrier, self.links)):
            parts = [(self.links[part], self.poses[part]) for part in self.links if self.carrier(part) == link]
            if self.name(link) == SPACE:
                if mass := sum(part.mass for part, _ in parts):
                    self.report.append(f"The root link `{link}` is the ground, so that its {mass:g} kg are left out.")
            elif self.name(link) in found:
                raise self.links[link].element.fail(f"has the name `{self.name(link)}`, as another: rename it.")
            else:
                found[self.name(link)] = self._body(link, parts)
            if others := [part.name for part, _ in parts if part.name != link]:
                self.report.append(f"{', '.join(others)}: on fixed joints, and so part of `{self.name(link)}`.")
        return found

    def _body(self, link: str, parts: list[tuple[DescribedLink, Placement]]) -> Body:
        """The body of links, in the frame of the first."""
        element, pose = self.links[link].element, self.poses[link]
        if not sum(part.mass for part, _ in parts) > 0:
            raise element.fail("moves, but has no mass: give it an <inertial>, or fix its joint.")
        back = pose.back()
        whole = together([(part, back.then(at)) for part, at in parts])
        try:
            return Body(
                mass=whole.mass,
                inertia=self._possible(link, whole.inertia),
                center=whole.center,
                position=pose.r,
                rotation=pose.R,
            )
        except ArgumentError as error:
            raise element.fail(f"is no rigid body: {error}") from error

    def _possible(self, link: str, inertia: np.ndarray) -> np.ndarray:
        """An inertia with J₃ = J₁ + J₂ where rounded numbers exceed it by little."""
        moments, axes = np.linalg.eigh(inertia)
        most = moments[0] + moments[1]
        if not most < moments[2] <= (1 + ROUNDED) * most:
            return inertia
        self.report.append(
            f"The largest moment of `{link}`, {moments[2]:.6g} kg m², becomes the sum of the two others."
        )
        return axes @ np.diag([*moments[:2], most]) @ axes.T

    def joints(self, motors: Sequence[str] | bool) -> dict[str, Joint]:
        """The joints that move, and gears where one mimics another."""
        moving = [joint for joint in self.above.values() if joint.kind not in ("fixed", "floating")]
        names = [self._word(joint.name) for joint in moving]
        if isinstance(motors, bool):
            motors = [name for name, one in zip(names, moving, strict=True) if "motor" in _options(one)] * motors
        for name in motors:
            checks.known(name, names, "joint", "Argument `motors`")
        found: dict[str, Joint] = {}
        for name, joint in zip(names, moving, strict=True):
            if name in found:
                raise joint.element.fail(f"has the name `{name}`, as another joint: rename it.")
            found[name] = self._joint(joint, name in motors)
        for name, joint in zip(names, moving, strict=True):
            if joint.mimic is not None:
                found |= self._gear(name, joint, found)
        return found

    def _joint(self, joint: DescribedJoint, motor: bool) -> Joint:
        options, pose = _options(joint), self.poses[joint.child]
        more: dict[str, float | bool] = {"motor": True} if motor else {}
        if joint.damping:
            if "damping" in options:
                more["damping"] = joint.damping
            else:
                self.report.append(f"{joint.element.place}: the damping of `{joint.name}` is left out.")
        limits = {"lower": joint.lower, "upper": joint.upper, "effort": joint.effort, "velocity": joint.velocity}
        if given := [f"{key} {value:g}" for key, value in limits.items() if value is not None]:
            self.report.append(f"{joint.element.place}: the limits of `{joint.name}`, {', '.join(given)}, do not act.")
        if joint.friction:
            self.report.append(f"{joint.element.place}: the dry friction of `{joint.name}` is left out.")
        try:
            return Joint(
                MOVING[joint.kind],
                self.name(joint.parent),
                self.name(joint.child),
                at=pose.r,
                axis=pose.R @ joint.axis,
                **more,  # pyright: ignore[reportArgumentType]
            )
        except ArgumentError as error:
            raise joint.element.fail(f"cannot be read: {error}") from error

    def _gear(self, name: str, joint: DescribedJoint, found: dict[str, Joint]) -> dict[str, Joint]:
        """θ = mθ′ + c of a joint that mimics another as a gear, where c is 0; reports others."""
        leader, multiplier, offset = joint.mimic or ("", 1.0, 0.0)
        other = self._word(leader)
        if other not in found or other == name:
            raise joint.element.fail(f"mimics the joint {leader!r}, which is not there or does not move.")
        ratio = Fraction(multiplier).limit_denominator(TEETH)
        whole = ratio and abs(ratio.numerator) <= TEETH and abs(float(ratio) - multiplier) < 1e-9
        if not whole or offset or found[name].kind != found[other].kind or found[name].kind == "planar":
            self.report.append(
                f"{joint.element.place}: `{name}` moves freely: {multiplier:g} times `{other}` plus {offset:g} is "
                "not a gear between two joints of one kind."
            )
            return {}
        return {f"{name}_mimics_{other}": Joint("gear", name, other, teeth=(ratio.denominator, -ratio.numerator))}

    def _word(self, name: str) -> str:
        """A name with letters, digits and underscores alone; reports changes."""
        word = re.sub(r"\W", "_", name)
        word = word if word.isidentifier() else f"_{word}"
        said = f"{name!r} is called `{word}`."
        if word != name and said not in self.report:
            self.report.append(said)
        return word


def _options(joint: DescribedJoint) -> tuple[str, ...]:
    """The options that a joint takes; raises FileError for an unknown type."""
    if joint.kind not in MOVING:
        raise joint.element.fail(
            f"has the type {joint.kind!r}, but must have {checks.either((*MOVING, 'fixed', 'floating'))}."
        )
    return KINDS[MOVING[joint.kind]].takes


def _left_out(root: Element) -> list[str]:
    """A sentence on the elements of the file, its links and its joints that were not read."""
    parts = [root, *(child for child in root.children if child.taken)]
    left = Counter(child.tag for part in parts for child in part.children if not child.taken)
    return [f"Left out: {', '.join(f'{count} <{tag}>' for tag, count in left.items())}."] if left else []
