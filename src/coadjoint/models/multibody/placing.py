"""Where the bodies of a mechanism are, and how they move, from coordinates of joints and poses of bodies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.models.multibody.bodies import Body, rotation
from coadjoint.models.multibody.joints import KINDS, SPACE, Joint
from coadjoint.models.quantities import vector

Pose = tuple[np.ndarray, np.ndarray]
"""R (3, 3) and the mass centre x (3,), m, in space."""
Twist = tuple[np.ndarray, np.ndarray]
"""The angular velocity and the velocity of the mass centre, (3,) each, in space."""


FREE = ("gear", "rolling", "distance", "strut")
"""Kinds along which no body is placed."""
GIVEN = ("coordinates", "speeds", "poses", "rates", "velocities")
WORDS = "a dictionary of names and values"
TRACED = "known numbers outside traces (differentiate `System.project` of a state of the system instead)"


class Described(Protocol):
    """The bodies and joints of a mechanism by their names, and the pose of each body in the reference configuration."""

    @property
    def bodies(self) -> Mapping[str, Body]: ...

    @property
    def joints(self) -> Mapping[str, Joint]: ...

    def reference(self, body: str, /) -> Pose: ...


class Placing:
    """Bodies placed one after the other along the joints, first along those whose coordinates are given."""

    def __init__(
        self,
        mechanism: Described,
        coordinates: Mapping[str, PyTree],
        speeds: Mapping[str, PyTree],
        poses: Mapping[str, PyTree],
        rates: Mapping[str, PyTree],
        velocities: Mapping[str, PyTree],
    ):
        self.mechanism = mechanism
        for name, given in zip(GIVEN, (coordinates, speeds, poses, rates, velocities), strict=True):
            checks.mapping(given, name, WORDS)
            checks.expect(not traced(given), given, name, TRACED)
        self.coordinates = {key: self._numbers(key, value, "coordinates") for key, value in coordinates.items()}
        self.speeds = {key: self._numbers(key, value, "speeds") for key, value in speeds.items()}
        for name, given in {"poses": poses, "rates": rates, "velocities": velocities}.items():
            for body in given:
                checks.known(body, mechanism.bodies, "body", f"Argument `{name}`")
        self.rates = {key: vector(value, f"rates` of `{key}") for key, value in rates.items()}
        self.velocities = {key: vector(value, f"velocities` of `{key}") for key, value in velocities.items()}
        self.placed = self._along_gears(self.coordinates), self._along_gears(self.speeds)
        self.places: dict[str, Pose] = {SPACE: (np.eye(3), np.zeros(3))}
        self.twists: dict[str, Twist] = {SPACE: (np.zeros(3), np.zeros(3))}
        for body, pose in poses.items():
            self.places[body], self.twists[body] = self._posed(body, pose), (np.zeros(3), np.zeros(3))
        followed = self._follow()
        holding = [key for key, joint in mechanism.joints.items() if joint.kind != "strut"]
        held = any(mechanism.joints[key].kind == "strut" for key in (*coordinates, *speeds))
        rigid = len(followed) == len(holding) and not poses and not held
        self.needs_projection = bool(holding or held) and not (rigid and not rates and not velocities)

    @property
    def coordinates_and_speeds(self) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
        """x₀ and v of every joint whose coordinates are given; v is 0 where no speed is."""
        return {
            key: (tuple(place.tolist()), tuple(self.speeds.get(key, np.zeros_like(place)).tolist()))
            for key, place in self.coordinates.items()
        }

    @property
    def speeds_are_held(self) -> bool:
        """Whether `coordinates_and_speeds` says all velocities: those of the same joints, or none."""
        moving = [key for given in (self.speeds, self.rates, self.velocities) for key in given]
        return not moving or set(self.coordinates) == set(moving) == set(self.speeds)

    def found(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """g (N, 3, 3), q (N, 3), ξ (N, 3) in the body frames, q̇ (N, 3)."""
        bodies = list(self.mechanism.bodies)
        R, x = (np.stack([self.places[body][k] for body in bodies]) for k in (0, 1))
        omega, v = (np.stack([self.twists[body][k] for body in bodies]) for k in (0, 1))
        xi = np.einsum("nji,nj->ni", R, omega)
        for k, body in enumerate(bodies):
            xi[k] = self.rates.get(body, xi[k])
            v[k] = self.velocities.get(body, v[k])
        return R, x, xi, v

    def _numbers(self, key: str, value: Any, name: str) -> np.ndarray:
        joints = self.mechanism.joints
        checks.known(key, joints, "joint", f"Argument `{name}`")
        kind = joints[key].kind
        size = len(KINDS[kind].coordinates)
        if not size:
            raise ArgumentError(
                f"The joint `{key}` is {kind} and has no coordinates of its own: give the pose or the rate of a body."
            )
        return np.atleast_1d(checks.array(value, f"{name}` of `{key}", () if size == 1 else (size,)))

    def _along_gears(self, given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """With the angles, or their rates, of wheels that mesh with given ones, θ₂ = −(z₁/z₂)θ₁."""
        found, joints = dict(given), self.mechanism.joints
        gears = [(joint.first, joint.second, joint.teeth) for joint in joints.values() if joint.teeth]
        gears += [(second, first, (b, a)) for first, second, (a, b) in gears]
        while mesh := next((one for one in gears if one[0] in found and one[1] not in found), None):
            first, second, (own, other) = mesh
            found[second] = np.zeros(len(KINDS[joints[second].kind].coordinates))
            found[second][0] = -own / other * found[first][0]
        return found

    def _posed(self, body: str, pose: Any) -> Pose:
        if not isinstance(pose, (tuple, list)) or len(pose) != 2:
            raise ArgumentError(f"Argument `poses` of `{body}` must be a pair (R, x) of attitude and position.")
        R, x = rotation(pose[0], f"poses` of `{body}"), vector(pose[1], f"poses` of `{body}")
        return R, x + R @ self.mechanism.bodies[body].center

    def _follow(self) -> set[str]:
        """Place all bodies; the joints along which they are placed."""
        joints, followed = self.mechanism.joints, set()
        given = {key for found in self.placed for key in found}
        order = [key for key in joints if joints[key].kind not in FREE]
        order.sort(key=lambda key: key not in given)
        while True:
            along = next((key for key in order if self._reached(joints[key]) == 1), None)
            if along is not None:
                self._place(along, joints[along])
                followed.add(along)
                continue
            left = [body for body in self.mechanism.bodies if body not in self.places]
            if not left:
                return followed
            self.places[left[0]] = self.mechanism.reference(left[0])
            self.twists[left[0]] = np.zeros(3), np.zeros(3)

    def _reached(self, joint: Joint) -> int:
        return (joint.first in self.places) + (joint.second in self.places)

    def _place(self, key: str, joint: Joint) -> None:
        """Place the body at the other end of a joint."""
        moved, twist = self._displacement(key, joint)
        back = joint.first not in self.places
        known, new = (joint.second, joint.first) if back else (joint.first, joint.second)
        if back:
            moved = moved[0].T, -moved[0].T @ moved[1]
            twist = -moved[0] @ twist[0], -moved[0] @ twist[1] + np.cross(moved[0] @ twist[0], moved[1])
        (R0, x0), (S0, y0) = self.mechanism.reference(known), self.mechanism.reference(new)
        R, x = self.places[known]
        turn, shift = R @ R0.T, x - R @ R0.T @ x0  # of the known body from the reference configuration
        whole = turn @ moved[0], turn @ moved[1] + shift
        place = whole[0] @ S0, whole[0] @ y0 + whole[1]
        omega, v = self.twists[known]
        spin = turn @ twist[0]
        origin = turn @ twist[1] + np.cross(spin, -shift)  # the field of velocities at the origin of space
        self.places[new] = place
        self.twists[new] = omega + spin, v + np.cross(omega, place[1] - x) + origin + np.cross(spin, place[1])

    def _displacement(self, key: str, joint: Joint) -> tuple[Pose, Twist]:
        """Of the second body against the first from the reference configuration: x ↦ Rx + s, ω and ẋ at the origin."""
        names = KINDS[joint.kind].coordinates
        A, at = joint.axes()[0], np.zeros(3) if joint.at is None else joint.at
        axis = A[:, 2]
        size = dict.fromkeys(("angle", "distance"), 0.0)
        coordinate = {**size, **dict(zip(names, self.placed[0].get(key, np.zeros(len(names))), strict=True))}
        speed = {**size, **dict(zip(names, self.placed[1].get(key, np.zeros(len(names))), strict=True))}
        if joint.pitch is not None:
            for one in (coordinate, speed):
                one["distance"] = joint.pitch / (2 * np.pi) * one["angle"]
        cross, angle = np.cross(np.eye(3), axis), coordinate["angle"]
        R = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        shift = at - R @ at + coordinate["distance"] * axis
        spin = speed["angle"] * axis
        return (R, shift), (spin, np.cross(spin, -at) + speed["distance"] * axis)
