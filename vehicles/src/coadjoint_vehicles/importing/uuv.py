"""Vehicles of uuv_simulator: URDF with its plugins for underwater objects, thrusters and fins.

Its equations, with ν_r through the water in forward, starboard, down (the plugin turns y and z), at the link's origin:

    τ = −M_A ν̇_r − C_A(ν_r)ν_r + (D + u_r U + diag(Q_ii|ν_i|)) ν_r,    D, U, Q < 0 where they brake,

applied at the link's centre of mass; buoyancy ρVg at the centre of buoyancy, measured from there.
Source: uuv_gazebo_plugins, HydrodynamicModel.cc and BuoyantObject.cc.
"""

from __future__ import annotations

import numpy as np

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import Placement, flag_in, number_in, numbers, text_in
from coadjoint.models.descriptions.links import DescribedLink, impossible, link_named, placed, require_mass, together
from coadjoint.models.descriptions.urdf import joints_of, links_of
from coadjoint_vehicles.importing.draft import Draft
from coadjoint_vehicles.importing.plugins import plugins_named, plugins_of
from coadjoint_vehicles.importing.uuv_actuators import fins, thrusters
from coadjoint_vehicles.parts.damping import Damping

DENSITY = 1028.0
"""The plugin's defaults."""


def read_uuv(root: Element, draft: Draft) -> None:
    """Read a description into a draft; raises FileError with file and line."""
    draft.report.format = "URDF of uuv_simulator"
    root.get("name")
    links, joints, plugins = links_of(root), joints_of(root), plugins_of(root)
    found = plugins_named(plugins, "underwater_object")
    if not found:
        raise root.fail(
            "needs hydrodynamics: systems of Gazebo (gz-sim-hydrodynamics-system, gz-sim-thruster-system) in <gazebo>, "
            "or the plugin libuuv_underwater_object_ros_plugin.so of uuv_simulator, but has neither."
        )
    if len(found) > 1:
        raise root.fail(f"needs one plugin libuuv_underwater_object_ros_plugin.so, but has {len(found)}.")
    plugin = found[0]
    model = _model(plugin)
    base = link_named(links, model.get("name") or "", model)
    poses = placed(links, joints, base.name)
    for link in links.values():
        if link.name not in poses:
            draft.left(link.element, link.element.label, "no joint connects it with the vehicle")
    density = number_in(plugin, "fluid_density", DENSITY)
    draft.body["fluid_density"] = draft.take("body.fluid_density", density, "kg/m^3", _at(plugin, "fluid_density"))
    _body(draft, model, base, links, poses, density)
    _hydrodynamics(draft, model, base)
    thrusters(draft, plugins_named(plugins, "thruster"), links, joints, poses)
    fins(draft, plugins_named(plugins, "uuv_fin"), links, joints, poses)


def _model(plugin: Element) -> Element:
    """The element of the link that has the hydrodynamics: the first, or that of the base link."""
    models = [child for child in plugin.children if child.tag == "link"]
    if not models:
        raise plugin.fail("names no <link> that has hydrodynamics.")
    chosen = next((child for child in models if "base_link" in child.attributes.get("name", "")), models[0])
    chosen.taken = True
    return chosen


def _at(element: Element, tag: str) -> Element:
    """The child of this tag, where there is one, else the element."""
    return element.first(tag) or element


def _body(
    draft: Draft,
    model: Element,
    base: DescribedLink,
    links: dict[str, DescribedLink],
    poses: dict[str, Placement],
    density: float,
) -> None:
    """Mass, inertia and centres of all that joints connect, volume and sizes."""
    held = [(links[name], pose) for name, pose in poses.items()]
    require_mass(held, draft.source)
    body = together(held)
    draft.report.impossible += impossible(held)
    loose = [link.name for link, _ in held if link is not base and link.mass > 0]
    note = f"with {len(loose)} links that joints hold, at their position 0" if loose else ""
    at = base.place or base.element.place
    draft.body["mass"] = draft.take("body.mass", body.mass, "kg", at, note)
    draft.body["center_of_mass"] = draft.take("body.center_of_mass", body.center * draft.flip, "m", at, note)
    turned = body.inertia * np.outer(draft.flip, draft.flip)
    draft.body["inertia"] = draft.take("body.inertia", turned, "kg m^2", at, note)
    if loose:
        draft.differs(
            f"{', '.join(loose[:3])}{' and others' if len(loose) > 3 else ''} are part of one rigid body; their own "
            "motion in their joints is left out."
        )
    center = np.zeros(3)
    if model.first("center_of_buoyancy") is not None:
        element = _at(model, "center_of_buoyancy")
        center = numbers(element, element.text, (3,), "the centre of buoyancy")
    note = "from the link's centre of mass there, from its origin here" if np.any(base.center) else ""
    draft.body["center_of_buoyancy"] = draft.take(
        "body.center_of_buoyancy", (base.center + center) * draft.flip, "m", _at(model, "center_of_buoyancy"), note
    )
    if flag_in(model, "neutrally_buoyant", False):
        # Gazebo lumps links on fixed joints into their parent, which may have no mass of its own.
        volume, where = (base.mass or body.mass) / density, _at(model, "neutrally_buoyant")
        if model.first("volume") is not None:
            draft.left(_at(model, "volume"), "<volume>", "a body that is neutrally buoyant there has that of its mass")
    else:
        volume, where = number_in(model, "volume"), _at(model, "volume")
    draft.body["volume"] = draft.take("body.volume", volume, "m^3", where)
    if any(model.first(tag) is not None for tag in ("metacentric_width", "metacentric_length", "submerged_height")):
        raise model.fail("is a vessel at the surface: vehicles here are submerged.")
    box = model.first("box")
    for key in ("length", "width", "height") if box is not None else ():
        draft.body[key] = draft.take(f"body.{key}", number_in(box or model, key), "m", _at(box or model, key))
    if np.any(base.center):
        draft.differs(
            f"{at}: the plugin measures velocities at the link's origin and applies added mass and damping at its "
            "centre of mass; here both are about the origin."
        )
    draft.differs(
        "The plugin's buoyancy fades near the surface with the height of its box, and its added mass acts on an "
        "acceleration that is filtered over some steps; here buoyancy is that of a submerged body and added mass is "
        "in the Lagrangian."
    )


def _hydrodynamics(draft: Draft, model: Element, base: DescribedLink) -> None:
    """Added mass and damping of Fossen's model, in forward, starboard, down as the plugin has them."""
    fossen = model.first("hydrodynamic_model")
    if fossen is None:
        raise model.fail("needs <hydrodynamic_model>.")
    kind = text_in(fossen, "type")
    if kind != "fossen":
        raise fossen.fail(f"is of the type {kind!r}, but only 'fossen' is read: give its matrices.")
    found = _matrix(fossen, "added_mass", (36,))
    mass = np.zeros((6, 6)) if found is None else draft.symmetric(found, _at(fossen, "added_mass"))
    turn = np.outer(*2 * [np.tile(draft.flip * [1, -1, -1], 2)])  # from the axes of the plugin, turned already
    if np.linalg.eigvalsh(mass)[0] < -1e-9 * np.max(np.abs(mass), initial=1e-300):
        raise _at(fossen, "added_mass").fail(
            "must have no negative eigenvalue: uuv_simulator counts it positive, unlike derivatives such as X_u̇."
        )
    draft.body["added_mass"] = draft.take("added_mass.matrix", mass * turn, "SI", _at(fossen, "added_mass"))
    given = {}
    for key, tag in (
        ("linear", "linear_damping"),
        ("quadratic", "quadratic_damping"),
        ("forward", "linear_damping_forward_speed"),
    ):
        matrix = _matrix(fossen, tag, (6, 36))
        if matrix is None or not np.any(matrix):
            continue
        where = _at(fossen, tag)
        if key == "quadratic" and np.any(matrix - np.diag(np.diag(matrix))):
            draft.left(where, "its off-diagonal entries", "the plugin does not use them either")
            matrix = np.diag(np.diag(matrix))
        given[key] = draft.take(f"damping.{key}", -matrix * turn, "SI", where, "with the other sign")
        if np.linalg.eigvalsh(-matrix - matrix.T)[0] < -1e-9:
            draft.differs(f"{where.place}: <{tag}> does not only brake: some motions gain energy by it.")
    if "forward" in given:
        draft.differs(
            "linear_damping_forward_speed is times u there, which drives a vehicle that goes astern, and times |u| "
            "here."
        )
    if given:
        draft.parts.append(Damping("damping", **given))


def _matrix(element: Element, tag: str, count: tuple[int, ...]) -> np.ndarray | None:
    """(6, 6) of 36 numbers or of a diagonal of 6; None if it is missing."""
    child = element.first(tag)
    if child is None:
        return None
    found = numbers(child, child.text, count, f"<{tag}>")
    return np.diag(found) if len(found) == 6 else found.reshape(6, 6)
