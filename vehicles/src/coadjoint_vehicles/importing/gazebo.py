"""Vehicles of Gazebo (gz-sim): SDF with its systems for hydrodynamics, buoyancy, thrusters, lift and drag.

With ν_r through the water in the link's axes, forward, port, up, at its origin, the system Hydrodynamics adds

    τ = M_a ν̇_r − C(ν_r)ν_r + Σ_j (D_ij + Σ_k Q_ijk |ν_k| + Σ_k P_ijk ν_k) ν_j,

with derivatives as Fossen has them: M_a = −M_A is negative (xDotU), D and Q are negative where they brake (xU, xUabsU).
<fluid_added_mass> is M_A itself. Source: gz-sim, systems/hydrodynamics, buoyancy, thruster, lift_drag.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import Placement, flag_in, number, number_in, numbers, text_in
from coadjoint.models.descriptions.links import DescribedLink, impossible, link_named, placed, require_mass, together
from coadjoint_vehicles.importing.draft import Draft
from coadjoint_vehicles.importing.gazebo_actuators import airfoils, ballast
from coadjoint_vehicles.importing.gazebo_damping import COLUMNS, ROWS, damping
from coadjoint_vehicles.importing.gazebo_thrusters import thrusters
from coadjoint_vehicles.importing.plugins import plugins_named
from coadjoint_vehicles.importing.sdf import joints_of, links_of, model_of, own_pose, read_gravity

DENSITY = 1000.0
"""kg/m³, the default of the system Buoyancy."""


def read_gazebo(root: Element, world: Element | None, folder: Path, draft: Draft, title: str) -> None:
    """Read a model into a draft; raises FileError with file and line.

    world: a <world> that the model is not in. title: of the format.
    """
    draft.report.format = title
    root.get("version")
    model = model_of(root, folder, draft)
    if world is not None:
        read_gravity(world, draft)
    draft.name = model.get("name") or draft.name
    static = model.first("static")
    if static is not None and flag_in(model, "static", False):
        draft.report.held = (
            f"{static.place}: <static> is true, so that the model does not move in the simulator; here it moves."
        )
    links = links_of(model, draft)
    joints = joints_of(model, links)
    held = [holder for holder in (model, root, root.first("world"), world) if holder is not None]
    plugins = [child for holder in held for child in holder.children if child.tag == "plugin"]
    found = plugins_named(plugins, "hydrodynamics")
    if len(found) > 1:
        raise found[1].fail("is a second system of hydrodynamics: a vehicle here is one body with one of them.")
    base = _base(found[0] if found else None, links, model)
    poses = placed(links, joints, base.name)
    for link in links.values():
        if link.name not in poses:
            draft.left(link.element, link.element.label, "no joint connects it with the vehicle")
    buoyancy = plugins_named(plugins, "gz-sim-buoyancy-system", "systems::buoyancy", "ignition-gazebo-buoyancy")
    engines = [plugin for plugin in buoyancy if "engine" in " ".join(plugin.attributes.values()).lower()]
    engines += plugins_named(plugins, "buoyancy-engine", "buoyancyengine")
    engines = list({id(plugin): plugin for plugin in engines}.values())
    floats = [plugin for plugin in buoyancy if plugin not in engines]
    _density(draft, floats, found)
    _current(draft, found)
    _body(draft, base, links, poses)
    _volume(draft, floats, links, poses)
    _added_mass(draft, base, found[0] if found else None)
    if found:
        damping(draft, found[0])
    motors = plugins_named(plugins, "motormodel", "motor-model", "motor_model")
    thrusters(draft, plugins_named(plugins, "thruster-system", "systems::thruster"), motors, links, joints, poses)
    airfoils(draft, plugins_named(plugins, "lift-drag", "liftdrag"), links, joints, poses)
    ballast(draft, engines, links, poses)
    draft.differs(
        "Gazebo's buoyancy and hydrodynamics are summed link by link and step by step; added mass of the system "
        "Hydrodynamics acts on the acceleration of the step before, here it is in the Lagrangian."
    )


def _base(plugin: Element | None, links: dict[str, DescribedLink], model: Element) -> DescribedLink:
    """The link that the hydrodynamics act on, else the first."""
    if plugin is not None:
        return link_named(links, text_in(plugin, "link_name"), plugin)
    if not links:
        raise model.fail("has no <link>.")
    return next(iter(links.values()))


def _density(draft: Draft, floats: list[Element], hydrodynamics: list[Element]) -> None:
    """ρ of the system Buoyancy, of one fluid or of layers, else of Hydrodynamics, else 1000 kg/m³."""
    layers = [layered for plugin in floats for layered in plugin.all("graded_buoyancy")]
    for holder, tag in [
        *((plugin, "uniform_fluid_density") for plugin in floats),
        *((layered, "default_density") for layered in layers),
        *((plugin, tag) for plugin in hydrodynamics for tag in ("water_density", "waterDensity")),
    ]:
        child = holder.first(tag)
        if child is not None and "fluid_density" not in draft.body:
            value = number(child, child.text, f"<{tag}>")
            draft.body["fluid_density"] = draft.take("body.fluid_density", value, "kg/m^3", child)
    for change in (one for layered in layers for one in layered.all("density_change")):
        above, density = (number_in(change, tag, 0.0) for tag in ("above_depth", "density"))
        draft.differs(
            f"{change.place}: above z = {above:g} m the fluid has {density:g} kg/m³ there, here the same as below."
        )
    if "fluid_density" not in draft.body:
        note = "the default of the system Buoyancy" if floats else "where no system of buoyancy is in the file"
        draft.body["fluid_density"] = draft.given("body.fluid_density", DENSITY, "kg/m^3", note)


def _current(draft: Draft, hydrodynamics: list[Element]) -> None:
    """<default_current> of the system Hydrodynamics, m/s: x, y, z of the world as north, west and up."""
    for plugin in hydrodynamics:
        child = plugin.first("default_current")
        if child is None or not child.text.strip():
            continue
        found = numbers(child, child.text, (3,), "<default_current>") * [1.0, -1.0, -1.0] + 0.0
        draft.report.current = tuple(found.tolist())
        if np.any(found):
            draft.differs(
                f"{child.place}: a current is no part of a vehicle: give it to a mission, in [water] velocity_m_s = "
                f"{found.tolist()}, north, east, down with the world's x to the north."
            )


def _body(draft: Draft, base: DescribedLink, links: dict[str, DescribedLink], poses: dict[str, Placement]) -> None:
    """Mass, centre and inertia of all links that joints connect."""
    held = [(links[name], pose) for name, pose in poses.items()]
    require_mass(held, draft.source)
    body = together(held)
    draft.report.impossible += impossible(held)
    others = [link for link, _ in held if link is not base]
    note = f"with {len(others)} links that joints hold, at their position 0" if others else ""
    draft.body["mass"] = draft.take("body.mass", body.mass, "kg", base.place, note)
    draft.body["center_of_mass"] = draft.take("body.center_of_mass", body.center * draft.flip, "m", base.place, note)
    turned = body.inertia * np.outer(draft.flip, draft.flip)
    draft.body["inertia"] = draft.take("body.inertia", turned, "kg m^2", base.place, note)
    if others:
        named = ", ".join(link.name for link in others[:3])
        draft.differs(
            f"{named}{' and others' if len(others) > 3 else ''} are part of one rigid body; their own motion in their "
            "joints is left out."
        )


def _volume(draft: Draft, floats: list[Element], links: dict[str, DescribedLink], poses: dict[str, Placement]) -> None:
    """V and the centre of buoyancy by the shapes of the collisions, as the system Buoyancy has them."""
    enabled = {child.text.strip().rpartition("::")[2] for plugin in floats for child in plugin.all("enable")}
    total, moment, where = 0.0, np.zeros(3), []
    for name, pose in poses.items():
        for collision in [] if enabled and not enabled & {name, draft.name} else links[name].element.children:
            if collision.tag != "collision":
                continue
            volume = _shape_volume(draft, collision)
            at = own_pose(collision, name)
            total, moment = total + volume, moment + volume * pose.place(at.r)
            where += [collision] if volume else []
    if not total:
        volume = draft.body["mass"] / draft.body["fluid_density"]
        draft.body["volume"] = draft.given(
            "body.volume", volume, "m^3", "neutral: no collision has a shape with a volume"
        )
        center = draft.body["center_of_mass"]
        draft.body["center_of_buoyancy"] = draft.given("body.center_of_buoyancy", center, "m", "that of mass")
        return
    if not floats:
        draft.differs("No system of buoyancy is in the file; it is taken as in a world that has one.")
    note = f"of {len(where)} collisions" if len(where) > 1 else ""
    draft.body["volume"] = draft.take("body.volume", total, "m^3", where[0], note)
    center = moment / total * draft.flip
    draft.body["center_of_buoyancy"] = draft.take("body.center_of_buoyancy", center, "m", where[0], note)


def _shape_volume(draft: Draft, collision: Element) -> float:
    """m³ of a box, sphere, cylinder, capsule or ellipsoid; reports any other shape and returns 0."""
    geometry = collision.first("geometry")
    shape = geometry.children[0] if geometry is not None and geometry.children else None
    if geometry is None or shape is None:
        return 0.0
    if shape.tag in ("box", "ellipsoid"):
        tag, factor = ("size", 1.0) if shape.tag == "box" else ("radii", 4 / 3 * math.pi)
        child = shape.first(tag)
        if child is None:
            raise shape.fail(f"needs <{tag}>.")
        found = factor * float(np.prod(numbers(child, child.text, (3,), f"<{tag}>")))
    elif shape.tag in ("sphere", "cylinder", "capsule"):
        radius = number_in(shape, "radius")
        length = number_in(shape, "length") if shape.tag != "sphere" else 0.0
        ends = 4 / 3 * math.pi * radius**3 if shape.tag != "cylinder" else 0.0
        found = ends + math.pi * radius**2 * length
    else:
        draft.left(shape, f"<{shape.tag}> of {collision.label}", "the volume of such a shape is not computed")
        return 0.0
    shape.taken = True
    if found < 0:
        raise shape.fail("must have positive sizes.")
    return found


def _added_mass(draft: Draft, base: DescribedLink, plugin: Element | None) -> None:
    """M_A = <fluid_added_mass> − M_a of the plugin, about the origin of the link."""
    total, where = np.zeros((6, 6)), None
    inertial = base.element.first("inertial")
    fluid = None if inertial is None else inertial.first("fluid_added_mass")
    if fluid is not None:
        where = fluid
        for i, row in enumerate("xyzpqr"):
            for j, column in enumerate("xyzpqr"):
                if j >= i:
                    total[i, j] = total[j, i] = number_in(fluid, row + column, 0.0)
    by_plugin = np.zeros((6, 6))
    for i, row in enumerate(ROWS):
        for j, column in enumerate(COLUMNS):
            child = None if plugin is None else plugin.first(f"{row}Dot{column}")
            if child is not None:
                by_plugin[i, j] = number(child, child.text, f"<{child.tag}>")
                where = where or child
    _told_added_mass(draft, plugin, fluid, by_plugin)
    if plugin is not None and flag_in(plugin, "disable_added_mass", False):
        by_plugin = np.zeros((6, 6))
    signs = np.concatenate([draft.flip, draft.flip])
    at = where or base.element
    mass = draft.symmetric(total - by_plugin, at) * np.outer(signs, signs)
    if np.linalg.eigvalsh(mass)[0] < -1e-9 * np.max(np.abs(mass), initial=1e-300):
        raise at.fail(
            "gives added mass below zero: <fluid_added_mass> is positive, and <xDotU> and so on are derivatives, "
            "which are negative."
        )
    draft.body["added_mass"] = draft.take("added_mass.matrix", mass, "SI", at)


def _told_added_mass(draft: Draft, plugin: Element | None, fluid: Element | None, by_plugin: np.ndarray) -> None:
    """Report differences in the Coriolis terms and a twofold added mass."""
    if plugin is None:
        return
    disabled = flag_in(plugin, "disable_coriolis", False) or not flag_in(plugin, "enable_coriolis", True)
    if disabled and np.any(by_plugin):
        draft.differs(
            f"{plugin.place}: the Coriolis and Munk terms of the added mass are switched off there; here they are in, "
            "as mechanics has them."
        )
    if fluid is not None and np.any(by_plugin) and not flag_in(plugin, "disable_added_mass", False):
        draft.differs(f"{plugin.place}: added mass is given twice, and is the sum of both, as there.")
    if np.any(by_plugin - np.diag(np.diag(by_plugin))):
        draft.differs(
            f"{plugin.place}: the Coriolis terms of off-diagonal added mass are left out there, but not here."
        )
