"""Mechanisms: a system of rigid bodies and joints, made of a description of its reference configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import SO3, Power
from coadjoint.mechanics.constrained_start import checked_start
from coadjoint.mechanics.constraints import Constraint, Holonomic, Nonholonomic
from coadjoint.mechanics.members import Quantity, count_members, each, member_of
from coadjoint.mechanics.reactions import count
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.models.multibody.bodies import Body
from coadjoint.models.multibody.bonds import Bond, Coordinate, Energy, HeldCoordinates, HeldSpeeds
from coadjoint.models.multibody.data import Recorded, joint_data
from coadjoint.models.multibody.joints import KINDS, SPACE, Joint, labels
from coadjoint.models.multibody.placing import Placing
from coadjoint.models.quantities import vector
from coadjoint.overview import Overview, WithOverview, listed
from coadjoint.spaces import Defining, RelativePoses
from coadjoint.spaces.relative_poses import GROUND

if TYPE_CHECKING:
    import xarray

TAKEN = ("mass", "inertia")
UNITS = {
    "xi": "rad/s",
    "mu": "kg m²/s",
    "n": "m",
    "nu": "m/s",
    "q": "m",
    "qdot": "m/s",
    "pi": "kg m/s",
    "energy": "J",
    "discrete_energy": "J",
}


class Mechanism(WithOverview):
    """N rigid bodies on joints in maximal coordinates: SO(3)ᴺ with the mass centres q ∈ ℝ³ᴺ, trees and loops alike.

        pendulum = multibody.Mechanism(
            bodies={"rod": multibody.Body(mass=1.0, inertia=(0.1, 0.1, 0.01), position=(0, 0, -0.5))},
            joints={"hinge": multibody.Joint("revolute", "ground", "rod", at=(0, 0, 0), axis=(0, 1, 0))},
        )
        run = co.simulate(pendulum.system, pendulum.state(coordinates={"hinge": 1.0}), dt=0.01, duration=10.0)

    ℓ = ½ Σ ω·Jω + ½ Σ m|ν|² + Σ m n·γ − springs, where gravity γ and the relative attitudes of jointed bodies are
    advected. A joint is a constraint of `system` under its name, so that its reaction is `reaction_NAME` of a run's
    dataset; a rolling wheel has its contact as a second one, `NAME_contact`.

    Arguments:
        bodies: name → Body.
        joints: name → Joint.
        gravity: the acceleration in space, (3,), m/s², by default (0, 0, −9.81).
        name: for certificates and figures.

    The parameters of `system` are mass, inertia, and for each joint its points on both bodies, from the mass centres,
    and its numbers, as in `system.replace(hinge={"damping": 0.2})`.
    Raises ArgumentError for names that do not fit together.
    """

    system: System

    def __init__(
        self,
        *,
        bodies: Mapping[str, Body],
        joints: Mapping[str, Joint],
        gravity: Quantity = (0.0, 0.0, -9.81),
        name: str = "mechanism",
    ):
        self.bodies: dict[str, Body] = _named(bodies, "bodies", Body, "multibody.Body(mass=…, inertia=…)", SPACE)
        self.joints: dict[str, Joint] = _named(joints, "joints", Joint, 'multibody.Joint("revolute", …)', *TAKEN)
        if not self.bodies:
            raise ArgumentError("A mechanism needs at least one body.")
        self.gravity = np.asarray(vector(gravity, "gravity"))
        self.name = checks.text(name, "name")
        self.links = {SPACE: GROUND, **{body: k for k, body in enumerate(self.bodies)}}
        for key, joint in self.joints.items():
            self._require_ends(key, joint)
        ends = [(self.links[j.first], self.links[j.second]) for j in self.joints.values() if j.kind != "gear"]
        self.pairs = tuple(dict.fromkeys(ends)) or ((GROUND, 0),)
        self.bonds: dict[str, Bond] = {}
        for key in sorted(self.joints, key=lambda key: self.joints[key].kind == "gear"):
            self.bonds[key] = self._bond(key, self.joints[key])
        self.bonds = {key: self.bonds[key] for key in self.joints}
        self._require_names()
        self.system = self._system({})

    def _overview(self) -> Overview:
        facts = {
            "bodies": listed(self.bodies),
            "joints": listed(f"{key} ({joint.kind})" for key, joint in self.joints.items()),
            "mass": f"{sum(body.mass for body in self.bodies.values()):.6g} kg",
            "rows": count(self.system),
            "motors": listed(key for key, joint in self.joints.items() if joint.motor),
        }
        return Overview(f"Mechanism {self.name}", facts)

    def _require_ends(self, key: str, joint: Joint) -> None:
        """Raise ArgumentError unless a joint is between two bodies that exist, or of a gear two joints alike."""
        what = f"The joint `{key}`"
        if joint.first == joint.second:
            raise ArgumentError(f"{what} must connect two, but both ends are `{joint.first}`.")
        known = self.joints if joint.kind == "gear" else self.links
        for end in (joint.first, joint.second):
            checks.known(end, known, "joint" if joint.kind == "gear" else "body", what)
        if joint.kind == "gear":
            kinds = [self.joints[end].kind for end in (joint.first, joint.second)]
            first, second = (KINDS[kind].coordinates[:1] for kind in kinds)
            if first not in (("angle",), ("distance",)) or first != second:
                raise ArgumentError(
                    f"{what} couples two joints with an angle or two that slide, but `{joint.first}` is {kinds[0]} and "
                    f"`{joint.second}` {kinds[1]}."
                )

    def _require_names(self) -> None:
        """Raise ArgumentError where a joint has the name that another gives to a constraint or to joint data."""
        made = [f"{key}_contact" for key, joint in self.joints.items() if joint.kind == "rolling"]
        for key, joint in self.joints.items():
            for name in labels(key, joint.kind).values():
                made += [f"{name}_speed", *([name] if name != key else [])]
        if clash := sorted(set(made) & set(self.joints)):
            raise ArgumentError(f"A joint cannot be called `{clash[0]}`, which is a name that another joint makes.")

    def _bond(self, key: str, joint: Joint) -> Bond:
        if joint.teeth is not None:
            wheels = self.bonds[joint.first], self.bonds[joint.second]
            return Bond(key, joint.kind, GROUND, GROUND, 0, wheels=wheels, teeth=joint.teeth)
        ends = self.links[joint.first], self.links[joint.second]
        attitudes = self.reference(joint.first)[0], self.reference(joint.second)[0]
        axes = tuple(tuple(map(tuple, (R.T @ A).tolist())) for R, A in zip(attitudes, joint.axes(), strict=True))
        ball = joint.kind == "rolling" and joint.axis is None
        return Bond(key, joint.kind, *ends, self.pairs.index(ends), axes, ball=ball)

    def reference(self, body: str) -> tuple[np.ndarray, np.ndarray]:
        """R (3, 3) and the mass centre (3,), m, of a body in the reference configuration; of the ground 1 and 0."""
        if body == SPACE:
            return np.eye(3), np.zeros(3)
        return self.bodies[body].rotation, self.bodies[body].place

    def _parameters(self) -> dict[str, PyTree]:
        found: dict[str, PyTree] = {
            "mass": [body.mass for body in self.bodies.values()],
            "inertia": np.stack([body.inertia for body in self.bodies.values()]),
        }
        for key, joint in self.joints.items():
            if joint.kind != "gear":
                found[key] = self._numbers(joint)
        return found

    def _numbers(self, joint: Joint) -> dict[str, PyTree]:
        """The parameters of a joint."""
        (R, x), (S, y) = self.reference(joint.first), self.reference(joint.second)
        first, second = joint.at, joint.at if joint.to is None else joint.to
        own = {name: getattr(joint, name) for name in ("pitch", "radius", "stiffness", "damping")}
        own = {name: value for name, value in own.items() if value is not None}
        if joint.kind == "rolling":
            lean = 1.0 if joint.axis is None else np.sqrt(1 - (joint.axis @ joint.normal) ** 2)
            if lean < 1e-6:
                raise ArgumentError("The axis of a rolling disk must not be along the normal: the disk lies flat.")
            first = joint.at - own["radius"] * lean * joint.normal
        apart = float(np.linalg.norm(second - first))
        if joint.kind in ("distance", "strut") and not apart:
            raise ArgumentError(f"The points of a `{joint.kind}` joint must be apart: take a spherical joint.")
        if joint.kind == "distance":
            own["length"] = apart if joint.length is None else joint.length
        if joint.stiffness is not None:
            own["rest"] = (apart if joint.kind == "strut" else 0.0) if joint.rest is None else joint.rest
        return {"first": R.T @ (first - x), "second": S.T @ (second - y), **own}

    def _system(self, held: Mapping[str, Constraint]) -> System:
        joints = [(self.bonds[key], joint) for key, joint in self.joints.items()]
        springs = tuple(bond for bond, joint in joints if joint.stiffness is not None)
        forces = {f"{bond.name}_damper": bond.damper for bond, joint in joints if joint.damping is not None}
        forces |= {f"{bond.name}_motor": bond.motor for bond, joint in joints if joint.motor}
        constraints: dict[str, Constraint] = {}
        for bond, joint in joints:
            if joint.kind == "strut":
                continue
            if joint.kind == "rolling":
                constraints[f"{bond.name}_contact"] = Holonomic(bond.gap)
                constraints[bond.name] = Nonholonomic(bond.rolling)
            else:
                constraints[bond.name] = Holonomic(bond.gap)
        return System(
            Power(SO3(), len(self.bodies), "all"),
            Energy(springs).lagrangian,
            additional=Defining(),
            advected={"pose": RelativePoses(self.pairs), "gravity": Defining()},
            parameters=self._parameters(),
            forces=forces or None,
            constraints={**constraints, **held} or None,
            units=UNITS,
            name=self.name,
        )

    def state(
        self,
        *,
        coordinates: Mapping[str, PyTree] | None = None,
        speeds: Mapping[str, PyTree] | None = None,
        poses: Mapping[str, tuple[Quantity, Quantity]] | None = None,
        rates: Mapping[str, Quantity] | None = None,
        velocities: Mapping[str, Quantity] | None = None,
    ) -> State:
        """The state with these coordinates and speeds of joints, and poses of bodies; what is left out follows.

        Bodies are placed along the joints, from the ground, in the reference configuration where nothing is given, and
        then moved the least onto all joints (`System.project`); given coordinates and speeds stay.

        Arguments:
            coordinates, speeds: joint → an angle, rad, or a distance, m, and its rate; of `cylindrical`
                the angle and the distance, (2,).
            poses: body → (R, x), its attitude (3, 3) and the origin of its frame (3,), m, in space.
            rates, velocities: body → ω in its frame, (3,), rad/s, and the velocity of its mass centre in space, m/s.

        Numbers may be `co.each(values)`, for the members of an ensemble. Raises ArgumentError for unknown names, and
        where no such state is near.
        """
        given = [one or {} for one in (coordinates, speeds, poses, rates, velocities)]
        count = count_members(given)
        if count is None:
            return self._state(*self._placed(given))
        rows = [self._placed(member_of(given, k)) for k in range(count)]
        return self._state(*(each(np.stack(column)) for column in zip(*rows, strict=True)))

    def _state(self, *arguments: PyTree) -> State:
        """The state of g, q, ξ and q̇."""
        a0: PyTree = {"pose": None, "gravity": self.gravity}
        return self.system.state(**dict(zip(("g", "q", "xi", "qdot"), arguments, strict=True)), a0=a0)

    def _placed(self, given: list[Mapping[str, PyTree]]) -> tuple[PyTree, ...]:
        """g, q, ξ and q̇ with these coordinates, speeds, poses, rates and velocities."""
        placing = Placing(self, *given)
        for key, found in placing.coordinates.items():
            self.bonds[key].warn_of_turns(found, getattr(self.system.parameters, key))
        if not placing.needs_projection:
            return placing.found()
        g, q, xi, qdot = placing.found()
        if placing.coordinates:
            held = {key: HeldCoordinates(self.bonds[key], both) for key, both in placing.coordinates_and_speeds.items()}
            place = self._projected({key: Holonomic(one.gap) for key, one in held.items()}, g, q, xi, qdot)
            if placing.speeds_are_held:
                return place
            g, q, _, _ = place
        rates = {key: HeldSpeeds(self.bonds[key], tuple(speed.tolist())) for key, speed in placing.speeds.items()}
        return self._projected({key: Nonholonomic(one.rows, one.right) for key, one in rates.items()}, g, q, xi, qdot)

    def _projected(self, held: Mapping[str, Constraint], *arguments: PyTree) -> tuple[PyTree, ...]:
        """g, q, ξ and q̇ moved the least onto all joints, and onto what is held of them."""
        system = self._system({f"{key}__held": one for key, one in held.items()}) if held else self.system
        try:
            place = system.project(self._state(*arguments))
        except ArgumentError as error:
            if len(held) < 2:
                raise
            what = "coordinates" if all(isinstance(one, Holonomic) for one in held.values()) else "speeds"
            near = self.freedoms(self.system.project(self._state(*arguments)))
            raise ArgumentError(
                f"No state has the {what} given for {listed(f'`{key}`' for key in held)}: the mechanism has {near} "
                f"{'freedom' if near == 1 else 'freedoms'} near there, so that others follow from some. Leave out the "
                "numbers that follow, or give those of one motion."
            ) from error
        return place.g, place.q, place.xi, place.qdot

    def freedoms(self, state: State) -> int:
        """The number of independent velocities at a state: 6N less the rank of all rows of constraints."""
        free = 6 * len(self.bodies)
        if not self.system.constraints:
            return free
        independent = checked_start(self.system, state)
        return free - (count(self.system) if independent is None else len(independent))

    def coordinate(self, joint: str) -> Coordinate:
        """The coordinate of a joint as a function of a state, for events, quantities, costs and derivatives.

            angle = linkage.coordinate("hinge")
            slope = jax.grad(lambda k: angle(co.trajectory(…).final))(1.0)

        See `Coordinate`. Raises ArgumentError for unknown joints and those without coordinates.
        """
        checks.known(joint, self.joints, "joint", "Argument `joint`")
        if not labels(joint, self.joints[joint].kind):
            raise ArgumentError(f"The joint `{joint}` is {self.joints[joint].kind} and has no coordinates of its own.")
        return Coordinate(self.bonds[joint], self.system.parameters)

    def joint_data(self, run: State | Recorded) -> xarray.Dataset:
        """The coordinates and speeds of the joints at the records of a run, with turns counted.

            turned = linkage.joint_data(run)

        A variable NAME with the joint's coordinate, rad or m, and NAME_speed, for joints with one; NAME_angle,
        NAME_distance and their speeds for those with two. Turns are counted by the mean speed between two records,
        which must give the change of an angle to within half a turn. Of an ensemble they have the dimension `member`.

        Arguments: run: of this mechanism, or states, as those of `co.trajectory`, which are taken to have the
        parameters of `system`. Raises ArgumentError for states of other systems.
        """
        return joint_data(self.bonds, run, self.system)


def _named(given: Any, name: str, kind: type, words: str, *taken: str) -> dict[str, PyTree]:
    """A dictionary of bodies or joints; raises ArgumentError for anything else."""
    fits = isinstance(given, Mapping) and all(isinstance(one, kind) for one in given.values())
    checks.expect(fits, given, name, f"a dictionary of names and {words}")
    for key in given:
        if not isinstance(key, str) or not key.isidentifier() or key in taken:
            other = f", other than {', '.join(taken)}," if taken else ""
            raise ArgumentError(f"The names in `{name}` must be words such as `crank`{other} but one is {shown(key)}.")
    return dict(given)
