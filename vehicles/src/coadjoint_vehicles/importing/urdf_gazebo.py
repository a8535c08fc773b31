"""URDF with systems of Gazebo, as ROS 2 has it: the model of SDF that Gazebo makes of it."""

from __future__ import annotations

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.urdf import joints_of
from coadjoint_vehicles.importing.plugins import SYSTEMS, plugins_named, plugins_of


def has_systems(root: Element) -> bool:
    """Whether a description has systems of Gazebo that push it."""
    return bool(plugins_named(plugins_of(root), *SYSTEMS))


def as_sdf(root: Element) -> Element:
    """<sdf><model> of a <robot>: each number keeps its file and line.

    What <gazebo> holds belongs to the model, or to the link of its `reference`. Links without <inertial> have no mass.
    """
    joints = {joint.child: joint.element for joint in joints_of(root)}
    model = _element("model", root, name=root.get("name") or "")
    held: dict[str, list[Element]] = {}
    for gazebo in (child for child in root.children if child.tag == "gazebo"):
        held.setdefault(gazebo.get("reference") or "", []).extend(gazebo.children)
    for child in root.children:
        if child.tag == "link":
            name = child.get("name") or ""
            model.children.append(_link(child, joints.get(name), held.pop(name, [])))
        elif child.tag == "joint":
            model.children.append(_joint(child))
        elif child.tag != "gazebo":
            model.children.append(child)
    model.children += held.pop("", [])
    for reference, children in held.items():
        model.children += [_element("gazebo", children[0], reference=reference, inside=children)] if children else []
    return _element("sdf", root, inside=[model])


def _element(tag: str, at: Element, text: str = "", inside: list[Element] | None = None, **attributes: str) -> Element:
    return Element(tag, attributes, at.file, at.line, inside or [], text)


def _link(link: Element, joint: Element | None, more: list[Element]) -> Element:
    made = _element("link", link, name=link.attributes.get("name", ""))
    parent = None if joint is None else joint.first("parent")
    if joint is not None and parent is not None:
        made.children.append(_pose(joint, relative_to=parent.get("link") or ""))
    inertial = link.first("inertial")
    made.children.append(_inertial(link if inertial is None else inertial, inertial))
    for child in link.children:
        if child.tag == "collision":
            made.children.append(_collision(child))
        elif child.tag != "inertial":
            made.children.append(child)
    made.children += more
    return made


def _pose(element: Element, relative_to: str = "") -> Element:
    """<pose> of the <origin> in an element."""
    origin = next((child for child in element.children if child.tag == "origin"), element)
    xyz, rpy = (origin.attributes.get(key, "0 0 0") if origin is not element else "0 0 0" for key in ("xyz", "rpy"))
    made = _element("pose", origin, f"{xyz} {rpy}")
    if relative_to:
        made.attributes["relative_to"] = relative_to
    return made


def _inertial(at: Element, inertial: Element | None) -> Element:
    """<inertial> of SDF; without one no mass and no inertia."""
    mass, matrix = (None if inertial is None else inertial.first(tag) for tag in ("mass", "inertia"))
    said = "0" if mass is None else mass.attributes.get("value", "")
    entries = {} if matrix is None else matrix.attributes
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    rows = [_element(key, matrix or at, entries.get(key, "0")) for key in keys]
    inside = [_pose(at), _element("mass", mass or at, said), _element("inertia", matrix or at, inside=rows)]
    return _element("inertial", at, inside=inside if inertial is not None else inside[1:])


def _collision(collision: Element) -> Element:
    """<collision> with shapes whose sizes are elements, not attributes."""
    made = _element("collision", collision, name=collision.attributes.get("name", ""), inside=[_pose(collision)])
    for geometry in (child for child in collision.children if child.tag == "geometry"):
        shapes = [
            _element(one.tag, one, inside=[_element(key, one, text) for key, text in one.attributes.items()])
            for one in geometry.children
        ]
        made.children.append(_element("geometry", geometry, inside=shapes))
    return made


def _joint(joint: Element) -> Element:
    made = _element("joint", joint, name=joint.attributes.get("name", ""), type=joint.attributes.get("type", ""))
    for tag in ("parent", "child"):
        end = joint.first(tag)
        made.children.append(_element(tag, end or joint, "" if end is None else end.attributes.get("link", "")))
    axis, limit = joint.first("axis"), joint.first("limit")
    xyz = "1 0 0" if axis is None else axis.attributes.get("xyz", "1 0 0")
    inside = [_element("xyz", axis or joint, xyz)]
    if limit is not None:
        given = [_element(key, limit, limit.attributes[key]) for key in ("lower", "upper") if key in limit.attributes]
        inside.append(_element("limit", limit, inside=given))
    made.children.append(_element("axis", axis or joint, inside=inside))
    return made
