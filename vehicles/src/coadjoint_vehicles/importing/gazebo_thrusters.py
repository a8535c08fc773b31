"""Thrusters of Gazebo, its own and those of motor models, as one part where their commands are of one kind."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import numpy as np

from coadjoint.models.descriptions.elements import Element
from coadjoint.models.descriptions.frames import Placement, flag_in, limit_of, number_in, text_in
from coadjoint.models.descriptions.links import DescribedJoint, DescribedLink, link_named
from coadjoint.texts import Table
from coadjoint_vehicles.importing.draft import Draft, places
from coadjoint_vehicles.importing.plugins import connected, joint_named
from coadjoint_vehicles.parts.thrusters import Thrusters

LARGEST_THRUST = 1000.0
"""N, of a thruster of Gazebo without limits."""
STATING = ("min_thrust_cmd", "max_thrust_cmd", "maxRotVelocity", "motorType")
"""Elements of a plugin that state the limits of its command."""
ROWS = np.linspace(0.0, 1.0, 21)
"""The duty cycles at which a polynomial of a motor model is tabulated."""


class Thruster(NamedTuple):
    """A thruster in the axes of the base link. kind, numbers: its force curve. low, high: of its command."""

    kind: str
    numbers: tuple[object, ...]
    unit: str
    position: np.ndarray
    direction: np.ndarray
    low: float
    high: float
    dead_band: float
    lag: float
    torque: float
    plugin: Element
    origin: Element


def thrusters(
    draft: Draft,
    plugins: list[Element],
    motors: list[Element],
    links: dict[str, DescribedLink],
    joints: list[DescribedJoint],
    poses: dict[str, Placement],
) -> None:
    """A part for all thrusters, or for each kind of command: k = ρCD⁴ N s²/rad² of revolutions in rad/s."""
    found = [_thruster(draft, plugin, joints, poses) for plugin in plugins]
    found += [_motor(draft, plugin, links, joints, poses) for plugin in motors]
    groups: dict[object, list[Thruster]] = {}
    for one in found:
        shape = one.numbers if one.kind == "table" else ()
        groups.setdefault((one.kind, one.unit, shape, one.dead_band, one.lag), []).append(one)
    for index, group in enumerate(groups.values()):
        _part(draft, "thrusters" if index == 0 else f"thrusters_{index + 1}", group)
    if len(groups) > 1:
        draft.differs(
            f"Its thrusters are {len(groups)} parts, because their commands, dead bands or lags differ: controllers of "
            "thrusters take one of them."
        )


def _part(draft: Draft, name: str, group: list[Thruster]) -> None:
    """A part of thrusters whose commands are of one kind; numbers that they share are given once."""
    first, where, origins = group[0], places(one.plugin for one in group), places(one.origin for one in group)
    given = np.array([one.numbers for one in group], dtype=float)
    value = given[0] if first.kind == "table" else shared(given.T)
    value = value[0] if first.kind == "linear" else value
    draft.take(f"{name}.curve.{first.kind}", value, "SI", where)
    more: Table = {}
    if first.dead_band:
        more["dead_band"] = draft.take(f"{name}.dead_band", first.dead_band, first.unit, where)
    if first.lag:
        more["lag"] = draft.take(f"{name}.lag", first.lag, "s", where)
    if any(one.torque for one in group):
        torque = np.array([one.torque for one in group])
        more["torque"] = draft.take(f"{name}.torque", torque, "m", where)
    ways = np.array([one.direction for one in group])
    if (limit := _limit(draft, group)) is not None:
        stated = any(one.plugin.first(tag) is not None for one in group for tag in STATING)
        more["limit"] = (
            draft.take(f"{name}.limit", limit, first.unit, where)
            if stated
            else draft.given(f"{name}.limit", limit, first.unit, "that of thrusters of Gazebo which give none")
        )
    draft.parts.append(
        Thrusters(
            name,
            curve={first.kind: value},
            unit=first.unit,
            positions=draft.take(
                f"{name}.positions", np.array([one.position for one in group]) * draft.flip, "m", origins
            ),
            directions=draft.take(f"{name}.directions", ways * draft.flip, "1", origins),
            **more,
        )
    )


def _limit(draft: Draft, group: list[Thruster]) -> np.ndarray | None:
    """The lowest and the highest command, (2,) or (2, n); None where no thruster has any."""
    ends = np.array([[one.low for one in group], [one.high for one in group]])
    endless = np.isinf(ends)
    if np.all(endless):
        return None
    if np.any(endless):
        most = max(LARGEST_THRUST, float(np.max(np.abs(ends[~endless]))))
        ends = np.where(endless, np.sign(ends) * most, ends)
        draft.differs(f"Limits of thrusters that are infinite, next to finite ones, are {most:g} {group[0].unit} here.")
    return shared(ends)


def shared(rows: np.ndarray) -> np.ndarray:
    """(k,) of rows (k, n) that each hold one number for all thrusters, else the rows."""
    return rows[:, 0].copy() if np.all(rows == rows[:, :1]) else rows


def _thruster(draft: Draft, plugin: Element, joints: list[DescribedJoint], poses: dict[str, Placement]) -> Thruster:
    """One of the system Thruster, which pushes at the origin of its link, along the axis of its joint."""
    joint = joint_named(joints, text_in(plugin, "joint_name"), plugin)
    pose = connected(plugin, joint.child, poses)
    direction = pose.R @ joint.axis
    low, high = (_end(plugin, tag, way) for tag, way in (("min_thrust_cmd", -1.0), ("max_thrust_cmd", 1.0)))
    if not low <= 0 <= high or low == high:
        raise plugin.fail(f"has thrusts from {low:g} to {high:g} N, which must lie about 0.")
    rad = flag_in(plugin, "use_angvel_cmd", False)
    k = _coefficient(draft, plugin)
    if rad and k < 0:
        k, direction, low, high = -k, -direction, -high, -low
    numbers: tuple[object, ...] = (k, k) if rad else (1.0,)
    if rad:
        low, high = -math.sqrt(-low / k), math.sqrt(high / k)
    dead = number_in(plugin, "deadband", 0.0)
    draft.differs(
        "The joints of propellers and their gains are left out: a thrust of Gazebo's system Thruster follows "
        "immediately."
    )
    kind, unit = ("quadratic", "rad/s") if rad else ("linear", "N")
    return Thruster(kind, numbers, unit, pose.r, direction, low, high, dead, 0.0, 0.0, plugin, joint.element)


def _end(plugin: Element, tag: str, way: float) -> float:
    """A limit of the thrust, N: that of Gazebo where none is given, infinite where its number is."""
    child = plugin.first(tag)
    if child is None or not child.text.strip():
        return way * LARGEST_THRUST
    found = limit_of(child, child.text, "its number")
    return way * math.inf if found is None else found


def _coefficient(draft: Draft, plugin: Element) -> float:
    """ρCD⁴, N s²/rad²."""
    if plugin.first("thrust_coefficient") is None and number_in(plugin, "alpha_2", 0.0) != 0:
        draft.differs(f"{plugin.place}: the fall of the thrust with speed by <alpha_2> is left out.")
    C = number_in(plugin, "thrust_coefficient", number_in(plugin, "alpha_1", 1.0))
    if C == 0:
        raise plugin.fail("has the thrust coefficient 0, so that it never pushes.")
    return C * number_in(plugin, "fluid_density", 1000.0) * number_in(plugin, "propeller_diameter", 0.02) ** 4


def _motor(
    draft: Draft,
    plugin: Element,
    links: dict[str, DescribedLink],
    joints: list[DescribedJoint],
    poses: dict[str, Placement],
) -> Thruster:
    """One of a motor model of multicopters, which pushes along the z axis of its link.

    A motor of the type `velocity` pushes by k ω|ω|, one of the type `force_polynomial` by a polynomial of its duty
    cycle, from −1 to 1 where it turns both ways.
    """
    link = link_named(links, text_in(plugin, "linkName"), plugin)
    pose = connected(plugin, link.name, poses)
    joint = joint_named(joints, text_in(plugin, "jointName"), plugin)
    both = flag_in(plugin, "bidirectionalMotor", False)
    turning = {"ccw": 1.0, "cw": -1.0}.get(text_in(plugin, "turningDirection", "ccw"))
    if turning is None:
        raise plugin.fail("must turn cw or ccw by <turningDirection>.")
    torque = -turning * number_in(plugin, "momentConstant", 0.0)
    up, down = (number_in(plugin, f"timeConstant{way}", 0.0) for way in ("Up", "Down"))
    if up != down:
        draft.differs(
            f"The motors speed up with a lag of {up:g} s and slow down with one of {down:g} s; here both are {up:g} s."
        )
    kind = text_in(plugin, "motorType", "velocity")
    if kind == "velocity":
        k, most = number_in(plugin, "motorConstant"), number_in(plugin, "maxRotVelocity")
        if k <= 0 or most <= 0:
            raise plugin.fail("needs <motorConstant> and <maxRotVelocity> above 0.")
        curve: tuple[str, tuple[object, ...], str] = ("quadratic", (k, k), "rad/s")
    elif kind == "force_polynomial":
        curve, most = ("table", _duty(plugin, both), "1"), 1.0
    else:
        raise plugin.fail(f"is a motor of the type {kind!r}; velocity and force_polynomial are read.")
    low = -most if both else 0.0
    return Thruster(*curve, pose.r, pose.R[:, 2], low, most, 0.0, up, torque, plugin, joint.element)


def _duty(plugin: Element, both: bool) -> tuple[object, ...]:
    """Rows (duty cycle, N) of the polynomials of a motor, whose coefficients begin with the constant."""
    ahead = np.polynomial.polynomial.polyval(ROWS, _coefficients(plugin, "positiveThrustPolynomial"))
    forces = np.maximum.accumulate(np.maximum(ahead, 0.0))
    rows = list(zip(ROWS, forces, strict=True))
    if both:
        astern = np.polynomial.polynomial.polyval(ROWS, _coefficients(plugin, "negativeThrustPolynomial"))
        falling = np.maximum.accumulate(np.maximum(astern, 0.0))
        rows = [(-u, -F) for u, F in zip(ROWS[:0:-1], falling[:0:-1], strict=True)] + rows
    if rows[-1][1] == 0:
        raise plugin.fail("never pushes by its <positiveThrustPolynomial>.")
    rows[len(rows) - len(ROWS)] = (0.0, 0.0)
    return tuple((float(u), float(F)) for u, F in rows)


def _coefficients(plugin: Element, tag: str) -> list[float]:
    words = re.split(r"[\s,\[\]]+", text_in(plugin, tag).strip())
    try:
        found = [float(word) for word in words if word]
    except ValueError:
        found = []
    if not found or not np.all(np.isfinite(found)):
        raise plugin.fail(f"needs the coefficients of a polynomial in <{tag}>.")
    return found
