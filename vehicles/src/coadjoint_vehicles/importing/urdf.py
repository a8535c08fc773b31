"""Links and joints of URDF, and the plugins of Gazebo in it."""

from __future__ import annotations

import numpy as np

from coadjoint_vehicles.importing.bodies import Joint, Link
from coadjoint_vehicles.importing.elements import Element
from coadjoint_vehicles.importing.frames import Placement, inertia, number, numbers, origin


def links_of(root: Element) -> dict[str, Link]:
    """The links by name; raises FileError for invalid numbers and duplicate names."""
    found: dict[str, Link] = {}
    for element in root.all("link"):
        name = element.get("name") or ""
        if not name or name in found:
            raise element.fail("needs its own name.")
        link = found[name] = Link(name, element)
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


def joints_of(root: Element) -> list[Joint]:
    """The joints; raises FileError."""
    return [_joint(element) for element in root.all("joint")]


def _joint(element: Element) -> Joint:
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
    made = Joint(element.get("name") or "", element, element.get("type") or "", parent, child, direction / length)
    made.pose = origin(element)
    limit = element.first("limit")
    if limit is not None:
        made.lower, made.upper, _ = (
            None if limit.get(key) is None else number(limit, limit.get(key), key)
            for key in ("lower", "upper", "velocity")
        )
    return made


def plugins_of(root: Element) -> list[Element]:
    """The plugins in all <gazebo> of a description."""
    found = []
    for gazebo in root.children:
        if gazebo.tag == "gazebo" and any(child.tag == "plugin" for child in gazebo.children):
            gazebo.taken = True
            found += [child for child in gazebo.children if child.tag == "plugin"]
    return found


def plugins_named(plugins: list[Element], *words: str) -> list[Element]:
    """Those whose file or name has one of these words; they count as read."""
    found = []
    for plugin in plugins:
        said = f"{plugin.attributes.get('filename', '')} {plugin.attributes.get('name', '')}".lower()
        if any(word in said for word in words):
            plugin.taken = True
            plugin.get("filename")
            found.append(plugin)
    return found
