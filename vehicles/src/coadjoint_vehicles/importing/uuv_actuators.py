"""Thrusters and fins of uuv_simulator."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import Placement, number_in, numbers, text_in
from coadjoint.models.descriptions.links import DescribedJoint, DescribedLink, link_named
from coadjoint.texts import Table
from coadjoint_vehicles.importing.draft import Draft, places
from coadjoint_vehicles.importing.gazebo_actuators import add_foil
from coadjoint_vehicles.importing.gazebo_thrusters import shared
from coadjoint_vehicles.parts.thrusters import Thrusters

SAMPLES = 201
"""Rows of a curve that has to be tabulated."""


class UuvThruster(NamedTuple):
    """A thruster in forward, starboard, down; curve: as Thrusters takes it; limits of its command, rad/s."""

    number: int
    position: np.ndarray
    direction: np.ndarray
    curve: tuple[Any, ...]
    limit: tuple[float, float] | None
    lag: float
    plugin: Element
    origin: Element


def thrusters(
    draft: Draft,
    plugins: list[Element],
    links: dict[str, DescribedLink],
    joints: list[DescribedJoint],
    poses: dict[str, Placement],
) -> None:
    """The thrusters of their plugins, as one part for those whose curves are of one kind and whose lags are alike."""
    found = sorted((_thruster(draft, plugin, links, joints, poses) for plugin in plugins), key=lambda one: one.number)
    groups: dict[Any, list[UuvThruster]] = {}
    for one in found:
        shape = one.curve if one.curve[0] == "table" else one.curve[0]
        groups.setdefault((shape, one.limit is None, one.lag), []).append(one)
    for index, group in enumerate(groups.values()):
        add_thrusters(draft, "thrusters" if index == 0 else f"thrusters_{index + 1}", group)
    if len(groups) > 1:
        draft.differs(
            f"Its thrusters are {len(groups)} parts, because their curves or lags differ: controllers of thrusters "
            "take one of them."
        )


def add_thrusters(draft: Draft, name: str, group: list[UuvThruster]) -> None:
    """A part of thrusters whose curves are of one kind and whose lags are alike."""
    first = group[0]
    place, where = places(one.plugin for one in group), places(one.origin for one in group)
    kind, *values = first.curve
    value = np.array(values) if kind == "table" else shared(np.transpose([one.curve[1:] for one in group]))
    more: Table = {}
    if first.limit is not None:
        limit = shared(np.transpose([one.limit for one in group if one.limit is not None]))
        more["limit"] = draft.take(f"{name}.limit", limit, "rad/s", place)
    if first.lag:
        more["lag"] = draft.take(f"{name}.lag", first.lag, "s", place)
    draft.take(f"{name}.curve.{kind}", value, "SI", place)
    draft.parts.append(
        Thrusters(
            name,
            curve={kind: value},
            unit="rad/s",
            positions=draft.take(f"{name}.positions", np.array([one.position for one in group]), "m", where),
            directions=draft.take(f"{name}.directions", np.array([one.direction for one in group]), "1", where),
            **more,
        )
    )


def _thruster(
    draft: Draft,
    plugin: Element,
    links: dict[str, DescribedLink],
    joints: list[DescribedJoint],
    poses: dict[str, Placement],
) -> UuvThruster:
    name = text_in(plugin, "linkName")
    link = link_named(links, name, plugin)
    if link.name not in poses:
        raise plugin.fail(f"pushes the link {link.name!r}, which no joint connects with the vehicle.")
    wanted = text_in(plugin, "jointName", "")
    joint = next((one for one in joints if one.name == wanted or (not wanted and one.child == link.name)), None)
    axis = np.array([1.0, 0.0, 0.0]) if joint is None else joint.axis
    pose = poses[link.name]
    gain, efficiency = number_in(plugin, "gain", 1.0), _share(plugin, "thrust_efficiency")
    scale = _share(plugin, "propeller_efficiency")
    low, high = _interval(draft, plugin, "clamp")
    clamp = None if math.isinf(low) and math.isinf(high) else (gain * low, gain * high)
    if gain != 1.0:
        draft.differs(
            f"{plugin.place}: the command of the thruster is here what its <gain> of {gain:g} makes of it, rad/s."
        )
    curve, limit = _curve(draft, plugin, efficiency, scale, clamp)
    direction = pose.R @ axis
    if curve[0] == "quadratic" and curve[1] < 0:
        curve, direction = ("quadratic", -curve[1], -curve[2]), -direction
    where = pose.place(link.center)
    lag = _lag(draft, plugin)
    identifier = int(number_in(plugin, "thrusterID", 0.0))
    at = link.element if joint is None else joint.element.first("origin") or joint.element
    return UuvThruster(identifier, where * draft.flip, direction * draft.flip, curve, limit, lag, plugin, at)


def _share(plugin: Element, tag: str) -> float:
    """An efficiency from 0 to 1; the plugin replaces any other number by 1."""
    found = number_in(plugin, tag, 1.0)
    return found if 0 <= found <= 1 else 1.0


def _interval(draft: Draft, plugin: Element, word: str) -> tuple[float, float]:
    """(lowest, highest); the plugin has none where they are exchanged."""
    low = number_in(plugin, f"{word}Min", -math.inf)
    high = number_in(plugin, f"{word}Max", math.inf)
    if low >= high:
        draft.differs(
            f"{plugin.place}: <{word}Min> {low:g} is not below <{word}Max> {high:g}, so that neither counts, as there."
        )
        return -math.inf, math.inf
    return low, high


def _lag(draft: Draft, plugin: Element) -> float:
    """τ of a first order, s; 0 of none."""
    dynamics = plugin.first("dynamics")
    kind = "ZeroOrder" if dynamics is None else text_in(dynamics, "type")
    if dynamics is None or kind == "ZeroOrder":
        return 0.0
    if kind == "FirstOrder":
        return number_in(dynamics, "timeConstant")
    draft.differs(f"{dynamics.place}: the rotor's dynamics {kind!r} is left out: the thruster follows immediately.")
    return 0.0


def _curve(
    draft: Draft, plugin: Element, efficiency: float, scale: float, clamp: tuple[float, float] | None
) -> tuple[tuple[Any, ...], tuple[float, float] | None]:
    """(the curve from rad/s to N, the limits of the command)."""
    conversion = plugin.first("conversion")
    if conversion is None:
        raise plugin.fail("needs <conversion>, from the speed of its rotor to its thrust.")
    kind = text_in(conversion, "type")
    least, most = _interval(draft, plugin, "thrust")
    if kind == "Basic":
        k = efficiency * scale**2 * number_in(conversion, "rotorConstant")
        if k == 0:
            raise conversion.fail("has the rotorConstant 0, so that it never pushes.")
        return ("quadratic", k, k), _limited(draft, plugin, k, clamp, (least, most))
    if kind == "LinearInterp":
        tables = [numbers_in(conversion, tag) for tag in ("inputValues", "outputValues")]
        if len(tables[0]) != len(tables[1]):
            raise conversion.fail(f"has {len(tables[0])} inputValues, but {len(tables[1])} outputValues.")
        commands, forces = tables[0] / max(scale, 1e-300), efficiency * tables[1]
    elif kind == "Bessa":
        if clamp is None or math.isinf(clamp[0]) or math.isinf(clamp[1]):
            raise plugin.fail("has a dead zone, and needs <clampMin> and <clampMax> to be tabulated between.")
        commands = np.linspace(*clamp, SAMPLES)
        forces = efficiency * _bessa(conversion, scale * commands)
        draft.differs(f"{conversion.place}: the curve with a dead zone is tabulated at {SAMPLES} commands.")
    else:
        raise conversion.fail(f"is of the type {kind!r}; Basic, Bessa and LinearInterp are read.")
    rows = zip(commands, np.clip(forces, least, most), strict=True)
    limit = None if clamp is None else (max(clamp[0], commands[0]), min(clamp[1], commands[-1]))
    return ("table", *((float(u), float(f)) for u, f in rows)), limit


def _bessa(conversion: Element, command: np.ndarray) -> np.ndarray:
    """k (x|x| − δ) beyond the dead zone from δ_L to δ_R, and 0 in it."""
    left, right = (number_in(conversion, f"rotorConstant{side}") for side in "LR")
    low, high = (number_in(conversion, f"delta{side}") for side in "LR")
    square = command * np.abs(command)
    return np.where(square <= low, left * (square - low), np.where(square >= high, right * (square - high), 0.0))


def _limited(
    draft: Draft, plugin: Element, k: float, clamp: tuple[float, float] | None, thrust: tuple[float, float]
) -> tuple[float, float] | None:
    """The limits of the command by those of its input and of its thrust, n = ±√(|T|/|k|)."""
    low, high = clamp or (-math.inf, math.inf)
    least, most = thrust
    if not (math.isinf(least) and math.isinf(most)):
        if k < 0:
            least, most = -most, -least
        low = max(low, math.copysign(math.sqrt(abs(least / k)), least)) if math.isfinite(least) else low
        high = min(high, math.copysign(math.sqrt(abs(most / k)), most)) if math.isfinite(most) else high
        draft.differs(
            f"{plugin.place}: the thrust is limited there after the lag of the rotor, here its command is, before it."
        )
    if math.isinf(low) and math.isinf(high):
        return None
    size = max(abs(x) for x in (low, high) if math.isfinite(x))
    if not low <= 0 <= high or low == high:
        raise plugin.fail(f"has limits from {low:g} to {high:g} rad/s, which must lie about 0.")
    return (low if math.isfinite(low) else -10 * size, high if math.isfinite(high) else 10 * size)


def fins(
    draft: Draft,
    plugins: list[Element],
    links: dict[str, DescribedLink],
    joints: list[DescribedJoint],
    poses: dict[str, Placement],
) -> None:
    """The fins of their plugins: lift and drag in the plane across the z axis of their links."""
    density = draft.body["fluid_density"]
    for plugin in plugins:
        number_in(plugin, "fin_id", 0.0)
        link = link_named(links, text_in(plugin, "link_name"), plugin)
        if link.name not in poses:
            raise plugin.fail(f"moves the link {link.name!r}, which no joint connects with the vehicle.")
        wanted = text_in(plugin, "joint_name", "")
        joint = next((one for one in joints if one.name == wanted), None)
        if joint is None:
            raise plugin.fail(f"names the joint {wanted!r}, which is not there.")
        model = plugin.first("liftdrag")
        if model is None:
            raise plugin.fail("needs <liftdrag>.")
        kind, zero = text_in(model, "type"), 0.0
        if kind == "Quadratic":
            area = 1.0
            found = {"lift_slope": 2 * number_in(model, "lift_constant") / density, "stall": 0.5 * math.pi}
            found["drag_square"] = 2 * number_in(model, "drag_constant") / density
        elif kind == "TwoLines":
            area = number_in(model, "area") * number_in(model, "fluid_density") / density
            names = {"lift_slope": "cla", "stall": "alpha_stall", "drag_slope": "cda"}
            names |= {"stalled_lift_slope": "cla_stall", "stalled_drag_slope": "cda_stall"}
            stalled = {"cla_stall": 0.0, "cda_stall": 0.0}
            found = {key: number_in(model, tag, stalled.get(tag)) for key, tag in names.items()}
            zero = number_in(model, "a0")
            draft.differs(
                f"{model.place}: at negative angles the plugin's drag pushes, and its stalled lift takes the slope of "
                "the drag; here both angles are alike."
            )
        else:
            raise model.fail(f"is of the type {kind!r}; Quadratic and TwoLines are read.")
        pose = poses[link.name]
        x, y = pose.R[:, 0], pose.R[:, 1]
        given = {"area": area, **found}
        add_foil(draft, plugin, link.name, pose.place(link.center), x, y, joint, pose, zero, given, _lag(draft, plugin))


def numbers_in(element: Element, tag: str) -> np.ndarray:
    """Two numbers or more in a child element."""
    child = element.first(tag)
    if child is None:
        raise element.fail(f"needs <{tag}>.")
    words = child.text.split()
    if len(words) < 2:
        raise child.fail("needs two numbers or more.")
    return numbers(child, child.text, (len(words),), f"<{tag}>")
