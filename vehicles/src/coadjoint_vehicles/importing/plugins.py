"""The plugins of Gazebo in a description, and the joints and links that they name."""

from __future__ import annotations

from collections.abc import Mapping

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import Placement
from coadjoint.models.descriptions.links import DescribedJoint

SYSTEMS = ("hydrodynamics-system", "systems::hydrodynamics", "thruster-system", "systems::thruster", "motormodel")
"""Words of the plugins that make a model of Gazebo a vehicle."""


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


def joint_named(joints: list[DescribedJoint], name: str, element: Element) -> DescribedJoint:
    """The joint of this name; raises FileError."""
    for joint in joints:
        if joint.name == name:
            return joint
    raise element.fail(f"names the joint {name!r}, which is not there.")


def connected(element: Element, link: str, poses: Mapping[str, Placement]) -> Placement:
    """The pose of a link in the vehicle; raises FileError where no joint leads to it."""
    if link not in poses:
        raise element.fail(f"acts on the link {link!r}, which no joint connects with the vehicle.")
    return poses[link]
