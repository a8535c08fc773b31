"""Lifting surfaces and buoyancy engines of Gazebo and of uuv_simulator as parts."""

from __future__ import annotations

import math

import numpy as np

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import Placement, flag_in, number_in, numbers, text_in
from coadjoint.models.descriptions.links import DescribedJoint, DescribedLink, link_named
from coadjoint.texts import Table
from coadjoint_vehicles.importing.draft import Draft
from coadjoint_vehicles.importing.plugins import connected
from coadjoint_vehicles.parts.airfoil import Airfoil
from coadjoint_vehicles.parts.ballast import Ballast

NO_STALL = 0.5 * math.pi


def airfoils(
    draft: Draft,
    plugins: list[Element],
    links: dict[str, DescribedLink],
    joints: list[DescribedJoint],
    poses: dict[str, Placement],
) -> None:
    """A foil for each system LiftDrag; its link's joint moves it."""
    for plugin in plugins:
        link = link_named(links, text_in(plugin, "link_name"), plugin)
        pose = connected(plugin, link.name, poses)
        forward, upward = (_direction(plugin, tag, default) for tag, default in (("forward", 0), ("upward", 2)))
        position = pose.place(_vector(plugin, "cp", np.zeros(3)))
        found = {
            "area": number_in(plugin, "area", 1.0) * number_in(plugin, "air_density", 1.2041) / _water(draft),
            "lift_slope": number_in(plugin, "cla", 1.0),
            "stall": number_in(plugin, "alpha_stall", NO_STALL),
            "drag_slope": number_in(plugin, "cda", 0.01),
            "stalled_lift_slope": number_in(plugin, "cla_stall", 0.0),
            "stalled_drag_slope": number_in(plugin, "cda_stall", 1.0),
            "swept": 1.0,
            "reversible": float(flag_in(plugin, "reversible", False)),
        }
        if flag_in(plugin, "radial_symmetry", False):
            raise plugin.fail("has radial symmetry, which no foil here has.")
        for tag in ("cma", "cma_stall", "cm_delta"):
            if number_in(plugin, tag, 0.0):
                draft.differs(f"{plugin.place}: the moment by <{tag}> is left out.")
        if plugin.first("control_joint_name") is not None:
            draft.differs(f"{plugin.place}: lift by <control_joint_rad_to_cl> is left out; only a turning link steers.")
        draft.differs(f"{plugin.place}: Gazebo's foils do nothing below 0.01 m/s; here they do.")
        joint = next((one for one in joints if one.child == link.name and one.kind in ("revolute", "continuous")), None)
        zero = number_in(plugin, "a0", 0.0)
        add_foil(draft, plugin, link.name, position, pose.R @ forward, pose.R @ upward, joint, pose, zero, found)


def add_foil(
    draft: Draft,
    plugin: Element,
    name: str,
    position: np.ndarray,
    forward: np.ndarray,
    upward: np.ndarray,
    joint: DescribedJoint | None,
    pose: Placement,
    zero: float,
    numbers_of: Table,
    lag: float = 0.0,
) -> None:
    """A foil; directions in the axes of the base. Its normal is such that its command is the angle of its joint."""
    axis = np.cross(forward, upward) if joint is None else pose.R @ joint.axis
    side = float(np.cross(axis, forward) @ upward)
    if joint is not None and abs(side) < 0.99:
        raise plugin.fail("turns about an axis that is not across its forward and its upward direction.")
    sign = 1.0 if side > 0 else -1.0
    given = dict(numbers_of)
    if zero:
        given["zero_lift"] = -sign * zero
    if joint is not None:
        span = [abs(x) for x in (joint.lower, joint.upper) if x is not None]
        given["limit"] = min(max(span, default=NO_STALL), NO_STALL) or NO_STALL
        if len(span) == 2 and abs(span[0] - span[1]) > 1e-6:
            draft.differs(f"{joint.element.place}: its limits are not alike on both sides; here both are the larger.")
    if lag:
        given["lag"] = lag
    word = "".join(letter if letter.isalnum() else "_" for letter in name.rpartition("/")[2])
    word = word if word.isidentifier() else f"foil_{word}"
    units = {"area": "m^2", "stall": "rad", "zero_lift": "rad", "limit": "rad", "lag": "s"}
    units |= dict.fromkeys(("swept", "reversible", "drag_square"), "1")
    geometry = {"position": (position, "m"), "chord": (forward, "1"), "normal": (-sign * upward, "1")}
    where = plugin if joint is None else joint.element
    taken = {key: draft.take(f"{word}.{key}", v * draft.flip, unit, where) for key, (v, unit) in geometry.items()}
    taken |= {
        key: draft.take(f"{word}.{key}", v, units.get(key, "1/rad"), where if key == "limit" else plugin)
        for key, v in given.items()
    }
    draft.parts.append(Airfoil(word, **taken))


def ballast(draft: Draft, plugins: list[Element], links: dict[str, DescribedLink], poses: dict[str, Placement]) -> None:
    """A volume beyond the neutral one for each buoyancy engine."""
    for index, plugin in enumerate(plugins):
        link = link_named(links, text_in(plugin, "link_name"), plugin)
        place = connected(plugin, link.name, poses)
        neutral = number_in(plugin, "neutral_volume", 0.0003)
        scale = number_in(plugin, "fluid_density", 1000.0) / _water(draft)
        low = scale * (number_in(plugin, "min_volume", 0.0) - neutral)
        high = scale * (number_in(plugin, "max_volume", 0.00099) - neutral)
        start = scale * (number_in(plugin, "default_volume", 0.0003) - neutral)
        rate = scale * number_in(plugin, "max_inflation_rate", 3e-6)
        name = "ballast" if index == 0 else f"ballast_{index + 1}"
        if abs(start) > 1e-12:
            draft.report.starts[name] = start
            draft.differs(
                f"{plugin.place}: the engine begins at {start:g} m³ beyond neutral: command it by [mission] "
                f"{name}_m3 = {start:g}, and begin there, [initial] actuators = {{ {name}_m3 = {start:g} }}, as the "
                "mission of --mission does."
            )
        draft.parts.append(
            Ballast(
                name,
                position=draft.take(f"{name}.position", place.r * draft.flip, "m", link.element),
                low=draft.take(f"{name}.low", low, "m^3", plugin),
                high=draft.take(f"{name}.high", high, "m^3", plugin),
                rate=draft.take(f"{name}.rate", rate, "m^3/s", plugin),
            )
        )


def _water(draft: Draft) -> float:
    return draft.body["fluid_density"]


def _vector(plugin: Element, tag: str, default: np.ndarray) -> np.ndarray:
    child = plugin.first(tag)
    return default if child is None else numbers(child, child.text, (3,), f"<{tag}>")


def _direction(plugin: Element, tag: str, default: int) -> np.ndarray:
    found = _vector(plugin, tag, np.eye(3)[default])
    length = float(np.linalg.norm(found))
    if length == 0:
        raise plugin.fail(f"has <{tag}> 0 0 0, which is not a direction.")
    return found / length
