"""Links and joints of SDF, with poses that are relative to others, and included models."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from coadjoint.errors import FileError
from coadjoint.models.descriptions.elements import MOST, Element, read_elements
from coadjoint.models.descriptions.frames import (
    HERE,
    Placement,
    inertia,
    limit_of,
    number,
    number_in,
    numbers,
    rotation,
    text_in,
)
from coadjoint.models.descriptions.links import DescribedJoint, DescribedLink
from coadjoint_vehicles.importing.draft import Draft
from coadjoint_vehicles.importing.plugins import SYSTEMS, plugins_named
from coadjoint_vehicles.importing.workspace import package_folder


class _NotThere(FileError):
    """An included model that cannot be read, because it is elsewhere."""


DEEPEST, MOST_FILES = 8, 64
"""The most models that are included within each other, and the most files in all."""


def model_of(root: Element, folder: Path, draft: Draft) -> Element:
    """The model of a file, merged with its includes; raises FileError.

    Of several in a world that with systems of a vehicle; includes of a world that are not there are reported.
    """
    world = root.first("world")
    if world is not None:
        read_gravity(world, draft)
    holders = [root] if world is None else [world, root]
    found = [model for holder in holders for model in holder.children if model.tag == "model"]
    for element in [one for holder in holders for one in holder.children if one.tag == "include"]:
        try:
            found.append(_included(element, folder, draft, 0))
        except FileError as error:
            if world is None or not isinstance(error, _NotThere):
                raise
            draft.left(element, element.label, f"it is not below {folder}: {text_in(element, 'uri')}")
        element.taken = True
    vehicles = [model for model in found if len(found) == 1 or plugins_named(_plugins(model), *SYSTEMS)]
    if len(vehicles) != 1:
        names = ", ".join(model.attributes.get("name", model.tag) for model in found) or "none"
        raise root.fail(f"must hold one <model> of a vehicle, but has {names}: keep that of the vehicle.")
    (model,) = vehicles
    model.taken = True
    model.get("name")
    _merge(model, folder, draft, 0)
    return model


def _plugins(model: Element) -> list[Element]:
    return [child for child in model.children if child.tag == "plugin"]


def read_gravity(world: Element, draft: Draft) -> None:
    """|g| of a <world>, where it says so."""
    gravity = world.first("gravity")
    if gravity is not None:
        value = numbers(gravity, gravity.text, (3,), "<gravity>")
        draft.body["gravity"] = draft.take("body.gravity", float(np.linalg.norm(value)), "m/s^2", gravity)


def _merge(model: Element, folder: Path, draft: Draft, depth: int) -> None:
    """Merge the contents of included models into this one."""
    for element in [child for child in model.children if child.tag == "include"]:
        element.taken = True
        found = _included(element, folder, draft, depth + 1)
        model.children += _moved(element, found, f"__included_{len(model.children)}__")


def _moved(include: Element, model: Element, name: str) -> list[Element]:
    """The children of an included model, with those poses that count from it relative to a frame `name`.

    The frame has the pose of the <include>, which takes the place of that in the <model>.
    """
    if (placed := include.first("placement_frame")) is not None:
        raise placed.fail("is not read: give the pose of the model itself.")
    pose = include.first("pose") or model.first("pose")
    children = [child for child in model.children if child.tag != "pose"]
    if pose is None:
        return children
    frame = Element("frame", {"name": name}, pose.file, pose.line, [pose])
    turns = not np.allclose(pose_of(frame)[0].R, np.eye(3)) or pose_of(frame)[1] != ""
    for child in children:
        if child.tag in ("link", "frame") and not child.attributes.get("attached_to"):
            own = next((one for one in child.children if one.tag == "pose"), None)
            if own is None:
                own = Element("pose", {}, child.file, child.line)
                child.children.append(own)
            if own.attributes.get("relative_to", "") in ("", "__model__"):
                own.attributes["relative_to"] = name
        for one in child.walk() if child.tag == "joint" and turns else ():
            if one.attributes.get("expressed_in") == "__model__":
                raise one.fail("is expressed in a model that is included with a turn: express it in its joint.")
    return [*children, frame]


def _included(element: Element, folder: Path, draft: Draft, depth: int) -> Element:
    if depth > DEEPEST:
        raise element.fail(f"is included within more than {DEEPEST} models.")
    uri = text_in(element, "uri")
    scheme, sign, name = uri.rpartition("://")
    if scheme not in ("", "model", "package", "file"):
        raise _NotThere(
            f"{element.place}: {element.label} includes {uri}: addresses are not opened, copy the model into {folder}."
        )
    path = _model_path(folder, element, name.lstrip("/") if sign else name, scheme)
    if not path.resolve().is_relative_to(folder.resolve()):
        raise element.fail(f"includes {path}, outside of the folder {folder} that files are read from.")
    if not path.is_file():
        raise _NotThere(
            f"{element.place}: {element.label} includes {uri}, and {path} is not there: give the folder of the models "
            "by --folder."
        )
    place = str(path.resolve().relative_to(folder.resolve()))
    draft.report.files.append(place)
    if len(draft.report.files) > MOST_FILES:
        raise element.fail(f"is one more than {MOST_FILES} files, which no vehicle needs.")
    root = read_elements(path, place)
    draft.elements += sum(1 for _ in root.walk())
    if draft.elements > MOST:
        raise element.fail(f"makes more than {MOST:,} elements, which no vehicle needs.")
    model = root.first("model")
    if model is None:
        raise root.fail("holds no <model>.")
    element.get("merge")
    _merge(model, folder, draft, depth)
    added = [child for child in element.children if child.tag in ("plugin", "experimental:params")]
    for child in element.children:
        child.taken = child.taken or child.tag == "name"
    model.children += added
    return model


def _model_path(folder: Path, element: Element, name: str, scheme: str) -> Path:
    """The file of a model: below the folder, or in the package, or the model, of the first word, wherever it is."""
    first, _, rest = name.partition("/")
    for path in (folder / name, package_folder(folder, first) / rest if scheme else folder / name):
        found = path / "model.sdf" if path.is_dir() else path
        if found.is_file():
            return found
    return folder / name


def pose_of(element: Element) -> tuple[Placement, str]:
    """(the pose in an element, the name of its reference frame, "" if it names none)."""
    child = element.first("pose")
    if child is None:
        return HERE, ""
    relative = child.get("relative_to") or ""
    if not child.text.strip():
        return HERE, relative
    if (child.get("rotation_format") or "euler_rpy") != "euler_rpy":
        raise child.fail("must be given by roll, pitch and yaw: rotation_format euler_rpy.")
    found = numbers(child, child.text, (6,), "a pose")
    scale = math.pi / 180 if (child.get("degrees") or "").lower() in ("1", "true") else 1.0
    return Placement(rotation(*(scale * found[3:])), found[:3]), relative


def own_pose(element: Element, link: str) -> Placement:
    """The pose of an inertial or a collision in its link; raises FileError for one relative to something else."""
    pose, relative = pose_of(element)
    if relative not in ("", link):
        raise element.fail(f"has a pose relative to {relative!r}; one in its link {link!r} is read.")
    return pose


def links_of(model: Element, draft: Draft) -> dict[str, DescribedLink]:
    """The links by name, with their poses in the model."""
    found: dict[str, DescribedLink] = {}
    for element in model.all("link"):
        name = element.get("name") or ""
        if not name or name in found:
            raise element.fail("needs its own name.")
        found[name] = _link(name, element, draft)
    frames = {element.get("name") or "": element for element in model.all("frame")}
    joints = {joint.attributes.get("name", ""): joint for joint in model.children if joint.tag == "joint"}
    for link in found.values():
        link.pose = _resolved(link.element, {**{k: v.element for k, v in found.items()}, **frames, **joints}, 0)
    return found


def _resolved(element: Element, named: dict[str, Element], depth: int) -> Placement:
    """The pose of an element in the model, along its chain of reference frames."""
    pose, relative = pose_of(element)
    if element.tag == "frame" and not relative:
        relative = element.get("attached_to") or ""
    if element.tag == "joint" and not relative:
        relative = text_in(element, "child")
    if relative in ("", "__model__"):
        return pose
    if relative not in named or depth > len(named):
        raise element.fail(f"has a pose relative to {relative!r}, which is not there or comes back to itself.")
    return _resolved(named[relative], named, depth + 1).then(pose)


def _link(name: str, element: Element, draft: Draft) -> DescribedLink:
    link = DescribedLink(name, element)
    inertial = element.first("inertial")
    if inertial is None:
        link.mass, link.inertia, link.place = 1.0, np.eye(3), element.place
        draft.differs(f"{element.place}: the link {name!r} has no <inertial>: 1 kg and 1 kg m², as SDF takes it.")
        return link
    link.place = inertial.place
    if (inertial.get("auto") or "").lower() in ("1", "true"):
        raise inertial.fail("is computed from shapes by the simulator: write its numbers.")
    pose = own_pose(inertial, name)
    link.mass, link.center = number_in(inertial, "mass", 1.0), pose.r
    if link.mass < 0:
        raise inertial.fail(f"has the mass {link.mass:g} kg, which must not be negative.")
    matrix = inertial.first("inertia")
    read = {"ixx": 1.0, "iyy": 1.0, "izz": 1.0}
    for child in [] if matrix is None else matrix.children:
        child.taken = True
        read[child.tag] = number(child, child.text, f"<{child.tag}>")
    link.inertia = pose.R @ inertia(matrix or inertial, read) @ pose.R.T
    return link


def joints_of(model: Element, links: dict[str, DescribedLink]) -> list[DescribedJoint]:
    """The joints, with the pose of the child link in the parent link at position 0."""
    return [_joint(element, links) for element in model.all("joint")]


def _joint(element: Element, links: dict[str, DescribedLink]) -> DescribedJoint:
    parent, child = text_in(element, "parent"), text_in(element, "child")
    for name in (parent, child):
        if name not in links:
            raise element.fail(f"joins the link {name!r}, which is not there: there are {', '.join(list(links)[:6])}.")
    made = DescribedJoint(
        element.get("name") or "", element, element.get("type") or "", parent, child, np.array([0.0, 0, 1])
    )
    made.pose = links[parent].pose.back().then(links[child].pose)
    own, relative = pose_of(element)
    if relative == "__model__" or (relative in links and relative != child):
        own = links[child].pose.back().then(own if relative == "__model__" else links[relative].pose.then(own))
    elif relative not in ("", child):
        raise element.fail(f"has a pose relative to {relative!r}; one in a link or in the model is read.")
    axis = element.first("axis")
    if axis is None:
        return made
    xyz = axis.first("xyz")
    direction = np.array([0.0, 0.0, 1.0]) if xyz is None else numbers(xyz, xyz.text, (3,), "<xyz>")
    expressed = "" if xyz is None else xyz.get("expressed_in") or ""
    turn = {"": own.R, child: np.eye(3), "__model__": links[child].pose.R.T}.get(expressed)
    if turn is None:
        raise axis.fail(
            f"has an <xyz> expressed in {expressed!r}, but a direction is read only in the axes of its joint, of its "
            f"child link {child!r} or of the model: leave out expressed_in, or give {child!r} or '__model__'."
        )
    if not np.any(direction):
        raise axis.fail("has the direction 0 0 0, but must point somewhere: give <xyz> a length above 0.")
    made.axis = turn @ direction / np.linalg.norm(direction)
    limit = axis.first("limit")
    if limit is not None:
        ends = [limit.first(tag) for tag in ("lower", "upper", "velocity", "effort")]
        made.lower, made.upper = (None if end is None else limit_of(end, end.text, "its number") for end in ends[:2])
    return made
