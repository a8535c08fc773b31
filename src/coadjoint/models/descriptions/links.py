"""Links that joints hold together, as one rigid body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from coadjoint.errors import FileError
from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import HERE, Placement

ROUNDED = 1e-3
"""By what part a moment may exceed the sum of the two others: numbers of files are rounded."""


@dataclass(eq=False)
class DescribedLink:
    """A link: its mass, kg, centre of mass and inertia about it, in the link's axes; None for missing values.

    center: (3,), m. inertia: (3, 3), kg m².
    """

    name: str
    element: Element
    mass: float = 0.0
    center: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    place: str = ""
    """The place of its inertial in the file."""
    pose: Placement = HERE
    """In the frame that the description is in."""


@dataclass(eq=False)
class DescribedJoint:
    """A joint: axis and origin in the axes of the child.

    axis: (3,).
    lower, upper: rad or m. effort, velocity: the largest, N m or N, rad/s or m/s. damping, friction: N m s or N s/m,
    N m or N. mimic: the joint that it follows, with the multiplier and the offset.
    """

    name: str
    element: Element
    kind: str
    parent: str
    child: str
    axis: np.ndarray
    pose: Placement = HERE
    """Of the child link in the parent link, at position 0."""
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    mimic: tuple[str, float, float] | None = None


class JoinedLinks(NamedTuple):
    """Links as one body in the axes of the base link: mass, centre from its origin, inertia about the centre.

    center: (3,), m. inertia: (3, 3), kg m².
    """

    mass: float
    center: np.ndarray
    inertia: np.ndarray


def placed(links: Mapping[str, DescribedLink], joints: list[DescribedJoint], base: str) -> dict[str, Placement]:
    """The pose of each link that joints connect with the base, in the base, with all joints at 0; raises FileError."""
    found = {base: HERE}
    waiting = list(joints)
    while waiting:
        ready = [joint for joint in waiting if (joint.parent in found) != (joint.child in found)]
        if not ready:
            break
        for joint in ready:
            if joint.parent in found and joint.child not in found:
                found[joint.child] = found[joint.parent].then(joint.pose)
            elif joint.child in found and joint.parent not in found:
                found[joint.parent] = found[joint.child].then(joint.pose.back())
        waiting = [joint for joint in waiting if joint not in ready]
    for joint in joints:
        for name in (joint.parent, joint.child):
            if name not in links:
                raise joint.element.fail(f"joins the link {name!r}, which is not there: {_known(links)}.")
    return found


def together(links: list[tuple[DescribedLink, Placement]]) -> JoinedLinks:
    """The mass, its centre and the inertia of links in their poses: I = Σ R I Rᵀ + m(|d|²1 − d dᵀ)."""
    mass = sum(link.mass for link, _ in links)
    centers = [pose.place(link.center) for link, pose in links]
    center = sum((link.mass * at for (link, _), at in zip(links, centers, strict=True)), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for (link, pose), at in zip(links, centers, strict=True):
        d = at - center
        inertia = inertia + pose.R @ link.inertia @ pose.R.T + link.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return JoinedLinks(mass, center, 0.5 * (inertia + inertia.T))


def impossible(links: list[tuple[DescribedLink, Placement]]) -> list[str]:
    """Sentences on links with a principal moment above the sum of the others, ∫y² + z² ≤ ∫x² + z² + ∫x² + y²."""
    found = []
    for link, _ in links:
        a, b, c = np.linalg.eigvalsh(link.inertia)
        if c > (1 + ROUNDED) * (a + b):
            found.append(
                f"{link.place}: the link {link.name!r} has the principal moments {a:.4g}, {b:.4g} and {c:.4g} kg m²: "
                "of every body each is at most the sum of the two others; see whether one is wrong."
            )
    return found


def link_named(links: Mapping[str, DescribedLink], name: str, element: Element) -> DescribedLink:
    """The link of this name, or the one that ends in it; raises FileError."""
    for key in (name, *(key for key in links if key.rpartition("/")[2] == name.rpartition("/")[2])):
        if key in links:
            return links[key]
    raise element.fail(f"names the link {name!r}, which is not there: {_known(links)}.")


def _known(links: Mapping[str, DescribedLink]) -> str:
    shown = ", ".join(list(links)[:6])
    return f"there are {shown}" if shown else "there is none"


def require_mass(body_links: list[tuple[DescribedLink, Placement]], name: str) -> None:
    """Raise FileError if no link has a mass."""
    if not sum(link.mass for link, _ in body_links) > 0:
        raise FileError(f"{name}: no link that joints connect has a mass: give its <inertial> a <mass>.")
