"""Links and joints of URDF."""

from __future__ import annotations

import numpy as np

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import Placement, inertia, limit_of, number, numbers, origin
from coadjoint.models.descriptions.links import DescribedJoint, DescribedLink


def links_of(root: Element) -> dict[str, DescribedLink]:
    """The links by name; raises FileError for invalid numbers and duplicate names."""
    found: dict[str, DescribedLink] = {}
    for element in root.all("link"):
        name = element.get("name") or ""
        if not name or name in found:
            raise element.fail("needs its own name.")
        link = found[name] = DescribedLink(name, element)
        inertial = element.first("inertial")
        if inertial is None:
            continue
        link.place = inertial.place
        pose = origin(inertial)
        mass = inertial.first("mass")
        if mass is None:
            raise inertial.fail("needs <mass value=…>.")
        link.mass, link.center = number(mass, mass.get("value"), "value"), pose.r
        if link.mass < 0:
            raise mass.fail(f"must not be negative, but is {link.mass:g}.")
        link.inertia = _turned(pose, inertial)
    return found


def _turned(pose: Placement, inertial: Element) -> np.ndarray:
    element = inertial.first("inertia")
    if element is None:
        return np.zeros((3, 3))
    read = {key: number(element, element.get(key), key) for key in element.attributes}
    return pose.R @ inertia(element, read) @ pose.R.T


def joints_of(root: Element) -> list[DescribedJoint]:
    """The joints; raises FileError."""
    return [_joint(element) for element in root.all("joint")]


def _joint(element: Element) -> DescribedJoint:
    ends = []
    for tag in ("parent", "child"):
        end = element.first(tag)
        name = None if end is None else end.get("link")
        if not name:
            raise element.fail(f"needs <{tag} link=…>.")
        ends.append(name)
    axis = element.first("axis")
    direction = np.array([1.0, 0.0, 0.0]) if axis is None else numbers(axis, axis.get("xyz"), (3,), "xyz")
    length = float(np.linalg.norm(direction))
    if length == 0:
        raise element.fail("needs an axis that is not zero.")
    parent, child = ends
    made = DescribedJoint(
        element.get("name") or "", element, element.get("type") or "", parent, child, direction / length
    )
    made.pose = origin(element)
    limit, dynamics, mimic = (element.first(tag) for tag in ("limit", "dynamics", "mimic"))
    if limit is not None:
        made.lower, made.upper, made.effort, made.velocity = (
            limit_of(limit, limit.get(key), key) for key in ("lower", "upper", "effort", "velocity")
        )
    if dynamics is not None:
        made.damping, made.friction = (
            number(dynamics, dynamics.get(key) or "0", key) for key in ("damping", "friction")
        )
    if mimic is not None:
        made.mimic = (
            mimic.get("joint") or "",
            number(mimic, mimic.get("multiplier") or "1", "multiplier"),
            number(mimic, mimic.get("offset") or "0", "offset"),
        )
    return made
