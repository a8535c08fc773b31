"""Joints between two bodies: a table of the rows that each kind holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.members import Quantity
from coadjoint.models.quantities import vector

SPACE = "ground"
PARALLEL = ((0, 2), (1, 2))
UNTURNED = (*PARALLEL, (1, 0))


class Kind(NamedTuple):
    """What a kind of joint holds, with the frames of the joint on both bodies, whose third axis is the joint's.

    points: the components along the first frame that vanish of the vector from the first point to the second.
    entries: those of C = A₁ᵀA₂ that vanish, of the axes A₁, A₂ of both frames: (0, 2) and (1, 2) for parallel axes,
    (1, 0) in addition for the same orientation. ratio: a row of its own, by name. coordinates: what it leaves free, as
    numbers. needs, takes: its options.
    """

    points: tuple[int, ...]
    entries: tuple[tuple[int, int], ...] = ()
    coordinates: tuple[str, ...] = ()
    needs: tuple[str, ...] = ("at", "axis")
    takes: tuple[str, ...] = ()
    ratio: str = ""


DRIVES = ("stiffness", "rest", "damping", "motor")
KINDS = {
    "fixed": Kind((0, 1, 2), UNTURNED, needs=("at",)),
    "revolute": Kind((0, 1, 2), PARALLEL, ("angle",), takes=DRIVES),
    "prismatic": Kind((0, 1), UNTURNED, ("distance",), takes=DRIVES),
    "cylindrical": Kind((0, 1), PARALLEL, ("angle", "distance")),
    "planar": Kind((2,), PARALLEL, ("angle",)),
    "spherical": Kind((0, 1, 2), needs=("at",)),
    "universal": Kind((0, 1, 2), ((2, 0),), needs=("at", "axis", "across")),
    "distance": Kind((), needs=("at", "to"), takes=("length",), ratio="distance"),
    "screw": Kind((0, 1), PARALLEL, ("angle",), needs=("at", "axis", "pitch"), takes=DRIVES, ratio="screw"),
    "gear": Kind((), needs=("teeth",), ratio="gear"),
    "rolling": Kind((), needs=("at", "radius", "normal"), takes=("axis",), ratio="contact"),
    "strut": Kind((), (), ("length",), needs=("at", "to"), takes=DRIVES),
}
"""Every kind of joint by its word."""


def labels(joint: str, kind: str) -> dict[str, str]:
    """The names of the coordinates of a joint in data, by what they are: that of the joint, if it has one alone."""
    names = KINDS[kind].coordinates
    return {name: joint if len(names) == 1 else f"{joint}_{name}" for name in names}


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of one of the kinds of `KINDS` between two bodies, in the reference configuration.

        hinge = multibody.Joint("revolute", "ground", "crank", at=(0, 0, 0), axis=(0, 1, 0), damping=0.1)

    Points and directions are given in space, for the reference configuration, in which the joint's coordinates are
    zero. The second body turns and slides relative to the first, "ground" or the name of a body.

    Arguments:
        kind: fixed, revolute, prismatic, cylindrical, planar, spherical, universal, distance, screw, gear,
            rolling or strut, which holds nothing: a spring, a damper or a motor between two points.
        first, second: names of bodies, or "ground"; of a gear those of two joints that turn, or slide.
        at: the joint's point, (3,), m; of `rolling` the wheel's centre.
        axis: the direction about or along which it moves, (3,); of `planar` the normal of the plane; of `universal` the
            axis on the first body; of `rolling` the axis of the disk, by default none: a ball.
        across: of `universal`, the axis on the second body, (3,), at a right angle to `axis`.
        to: of `distance` and `strut`, the point on the second body, (3,), m.
        length: of `distance`, m, by default that of the reference configuration.
        pitch: of `screw`, the advance in a turn, m; negative of a left-handed screw.
        teeth: of `gear`, (z₁, z₂) with z₁θ₁ + z₂θ₂ = 0, of angles or distances; both positive of wheels with external
            teeth.
        radius: of `rolling`, m.
        normal: of `rolling`, that of the plane of the first body, (3,), towards the wheel.
        stiffness, rest: a spring ½k(x − x₀)² at the coordinate x of the joint, the angle, rad, or the distance, m;
            N m/rad or N/m. x − x₀ of an angle is taken within half a turn; x of a strut is its length, x₀ by default
            that of the reference configuration.
        damping: a damper −cẋ there, N m s or N s/m.
        motor: whether the input of the joint's name acts there, N m or N.

    Raises ArgumentError for an unknown kind, and for options that the kind needs or does not take.
    """

    kind: str
    first: str
    second: str
    at: Any = None
    axis: Any = None
    across: Any = None
    to: Any = None
    length: float | None = None
    pitch: float | None = None
    teeth: tuple[int, int] | None = None
    radius: float | None = None
    normal: Any = None
    stiffness: float | None = None
    rest: float | None = None
    damping: float | None = None
    motor: bool | None = None

    def __post_init__(self):
        checks.choice(self.kind, "kind", tuple(KINDS))
        rule, what = KINDS[self.kind], f"A joint of the kind `{self.kind}`"
        given = [one.name for one in fields(self)[3:] if getattr(self, one.name) is not None]
        for name in rule.needs:
            if name not in given:
                raise ArgumentError(f"{what} needs the argument `{name}`.")
        for name in given:
            if name not in rule.needs + rule.takes:
                raise ArgumentError(f"{what} takes no argument `{name}`, but {checks.either(rule.needs + rule.takes)}.")
        for name in ("at", "to"):
            self._keep(name, vector)
        for name in ("axis", "across", "normal"):
            self._keep(name, _direction)
        for name in ("length", "radius"):
            self._keep(name, checks.positive)
        for name in ("stiffness", "damping"):
            self._keep(name, checks.not_negative)
        self._keep("rest", checks.number)
        self._keep("motor", checks.truth)
        self._keep("pitch", _pitch)
        self._keep("teeth", _teeth)
        if self.rest is not None and self.stiffness is None:
            raise ArgumentError("Argument `rest` is that of a spring: give its `stiffness`, too.")
        if self.across is not None and abs(self.axis @ self.across) > 1e-9:
            raise ArgumentError(
                f"Argument `across` must be at a right angle to `axis`, but the cosine between them is "
                f"{self.axis @ self.across:.3g}."
            )

    def _keep(self, name: str, check: Callable[[Any, str], Any]) -> None:
        value = getattr(self, name)
        if value is not None:
            object.__setattr__(self, name, check(value, name))

    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """The frames of the joint on the first and the second body, in space, (3, 3) each, with columns as axes."""
        if self.kind == "rolling":
            return frame(self.normal), frame(self.axis)
        both = frame(self.axis, self.across)
        return both, both


def frame(axis: np.ndarray | None, across: np.ndarray | None = None) -> np.ndarray:
    """A right-handed frame (3, 3) whose third column is the axis, and whose first is `across`."""
    if axis is None:
        return np.eye(3)
    if across is None:
        aside = np.eye(3)[np.argmin(np.abs(axis))]
        aside = aside - (aside @ axis) * axis
        return frame(axis, aside / np.linalg.norm(aside))
    return np.stack([across, np.cross(axis, across), axis], axis=1)


def _direction(value: Quantity, name: str) -> np.ndarray:
    found = np.asarray(vector(value, name))
    length = np.linalg.norm(found)
    if length == 0:
        raise ArgumentError(f"Argument `{name}` must be a direction, but is zero.")
    return found / length


def _pitch(value: float, name: str) -> float:
    found = checks.number(value, name)
    if found == 0:
        raise ArgumentError("Argument `pitch` must not be 0: take a revolute joint.")
    return found


def _teeth(value: tuple[int, int], name: str) -> tuple[int, int]:
    fits = isinstance(value, (tuple, list)) and len(value) == 2 and all(checks.is_whole(z) and z for z in value)
    checks.expect(fits, value, name, "two whole numbers other than 0, such as (20, 30)")
    common = int(np.gcd(*value))
    return int(value[0]) // common, int(value[1]) // common
