"""The common part of controllers of thruster vehicles: the wrench for an acceleration, and the thrusters' limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import logger
from coadjoint.models.quantities import positive, vector
from coadjoint.spaces import Named
from coadjoint_vehicles.controllers.attitude import attitude_error, attitude_of
from coadjoint_vehicles.model.controller import Controller, Feedback
from coadjoint_vehicles.model.loads import loads
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.allocator import AXES, Allocator
from coadjoint_vehicles.parts.measured import Measured, measured
from coadjoint_vehicles.parts.thrusters import Thrusters
from coadjoint_vehicles.trim.under_way import Level, coadjoint

_log = logger(__name__)

DAMPING_RATIO = 0.9
LARGEST_ACCELERATION = 5.0
"""m/s², rad/s²: assumed of thrusters without limits."""
NOTHING = 1e-14
"""A part of the largest authority that is round-off."""
NEGLIGIBLE = 1e-9
"""A part of the thrusters' mean arm that is round-off."""
SWALLOWED = 0.05
"""The part of the largest thrust that a dead band may have at its edge without a warning."""
SHARE = 0.5
"""The fraction of the thrusters' limit that the largest error may use."""
MOMENTS = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
LARGEST_TURN = 1.0
"""rad: the largest heading change commanded of a level vehicle, so that half a turn is not a special case."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Thrusting(Controller):
    """A controller that asks its thrusters for accelerations: w = M (a, α) − (0, T) − weigh · W.

    W is net weight and righting torque, and T the torque of ad*_V MV on SE(3), V = (v, ω): the Munk moment, which would
    turn the vehicle across the flow, is fed forward. M = M_RB + M_A, the model that the controller has, is the
    parameter `controller.mass`. The wrench w is shared out by `Thrusters.allocate` along the axes that the thrusters
    control. Where one of them is at its limit force gives way before torque, which then is that for the acceleration
    that is left.

    thrusters: the name of the part. attitude_gains: k_R in 1/s², k_I in 1/s³, k_ω in 1/s. reach: a place further off is
    approached as if it were there, m. weigh: how much of net weight and righting torque is fed forward, 0 to 1. mass:
    M, (6, 6), by default that of the vehicle. net_weight: weight less buoyancy, N, by default that of the vehicle.
    righting: the righting torque's vector, N m, by default that of the vehicle.
    """

    thrusters: str | None = None
    attitude_gains: Measured = measured(None, vector, default=None)
    reach: Measured = measured(u.LENGTH, positive, default=1.0)
    weigh: Measured = measured(None, default=0.0)
    mass: Measured = measured(None, None, default=None)
    net_weight: Measured = measured(None, None, default=None)
    righting: Measured = measured(None, None, default=None)

    NEEDS: ClassVar[tuple[str, ...]] = ("surge", "heave", "yaw")
    """The axes along which the thrusters must be able to push."""

    def fitted(self, vehicle: Any) -> Any:
        """The controller with the mass matrix of a vehicle, and proposed values of missing gains.

        Raises ArgumentError without thrusters, and where they cannot push as the controller needs.
        """
        if self.mass is not None:
            return self
        part = self._part(vehicle)
        M, all_of = Level(vehicle).mass, loads(vehicle)
        late = 0.5 * self.period + self.delay + float(part.parameters().get("lag", 0.0))
        most = accelerations(part, M)
        if said := lacking(part, most, self.NEEDS):
            raise ArgumentError(
                f"The controller `{type(self).__name__}` needs thrusters that push in {', '.join(self.NEEDS)}, "
                f"but those of `{vehicle.name}` {said}."
            )
        given = self.proposed(most, late)
        return replace(
            self,
            thrusters=part.name,
            mass=M,
            net_weight=all_of.net_weight,
            righting=all_of.righting,
            **{key: value for key, value in given.items() if getattr(self, key) is None},
        )

    def _part(self, vehicle: Any) -> Thrusters:
        found = [part for part in vehicle.parts if isinstance(part, Thrusters)]
        if self.thrusters is not None:
            found = [part for part in found if part.name == self.thrusters]
        if len(found) != 1:
            named = ", ".join(part.name for part in vehicle.parts if isinstance(part, Thrusters)) or "none"
            raise ArgumentError(
                f"This controller needs one part of the kind `thrusters`, named by `thrusters` where there are "
                f"several, but "
                f"`{vehicle.name}` has: {named}."
            )
        return found[0]

    def proposed(self, most: np.ndarray, late: float) -> dict[str, PyTree]:
        """Gains from the accelerations (6,) that the thrusters can give and how late (s) they follow."""
        turning = most[3:][most[3:] > 0]
        return {"attitude_gains": poles(SHARE * turning.min(initial=np.inf) / LARGEST_TURN, late)}

    def doubts(self, vehicle: Any) -> list[str]:
        """A sentence where thrusters push along an axis by so little that it may be the rounding of their directions.

        Axes along which they push nothing at all are a message of the log.
        """
        part = self._part(vehicle)
        shares = part.allocator.left_out
        named = {axis: f"{AXES[axis]} ({share:.1e})" for axis, share in shares.items()}
        if none := [AXES[axis] for axis, share in shares.items() if share <= NOTHING]:
            _log.info("The thrusters `%s` of %s do not control %s.", part.name, vehicle.name, ", ".join(none))
        little = [text for axis, text in named.items() if shares[axis] > NOTHING]
        found = []
        tipping = [AXES[axis] for axis in (3, 4) if axis in shares]
        if tipping and not loads(vehicle).righting[2] > 0:
            found.append(
                f"The thrusters `{part.name}` do not control {' and '.join(tipping)}, and no righting moment keeps "
                f"{vehicle.name} level: its centre of mass is not below its centre of buoyancy. It may turn over."
            )
        full = np.max(np.abs(part.extremes), axis=0)
        edges = np.max(np.abs(part.edges), axis=0)
        if np.any(wide := edges > SWALLOWED * full):
            i = int(np.argmax(wide))
            found.append(
                f"The dead band of the thrusters `{part.name}` takes every thrust below {0.5 * edges[i]:.3g} N, "
                f"half of that at its edge, of at most {full[i]:.3g} N: less is left to others, or missed."
            )
        if not little:
            return found
        return [
            *found,
            f"The thrusters `{part.name}` have next to no authority in {', '.join(little)} of their largest: "
            f"below `least_authority` = {part.least_authority:g} such a direction is taken as uncontrollable.",
        ]

    @property
    def keeps_level(self) -> bool:
        return True

    def memory(self) -> dict[str, PyTree]:
        return {"lost": np.zeros(6)}

    def allocator(self, part: Thrusters) -> Allocator:
        """That of a part, with the torque C F that an acceleration by F needs, C = M₂₁ M₁₁⁻¹.

        Thrusters at their limits then give the torque for the acceleration that they reach, not for the one wanted.
        """
        if part not in self._allocators:
            M = np.asarray(self.mass, dtype=float)
            C = np.linalg.solve(M[:3, :3].T, M[3:, :3].T).T
            C = np.where(np.abs(C) < NEGLIGIBLE * part.allocator.units[3], 0.0, C)
            self._allocators[part] = replace(part.allocator, coupling=C if np.any(C) else None)
        return self._allocators[part]

    @cached_property
    def _allocators(self) -> dict[Thrusters, Allocator]:
        """By part, so that an allocation is traced once."""
        return {}

    def commands(
        self,
        acceleration: Array,
        turn: Array,
        feedback: Feedback,
        own: Named,
        vehicle: Vehicle,
        drag: Array | float = 0.0,
    ) -> tuple[dict[str, PyTree], Array]:
        """The thrusters' commands for a (m/s²) and α (rad/s²), body axes, and the wrench (6,) that limits take away.

        drag: D, N, against which they push ahead as well, at O.
        """
        weight = jnp.concatenate([own.net_weight * feedback.down, jnp.cross(own.righting, feedback.down)])
        turning = coadjoint(own.mass, jnp.concatenate([feedback.velocity, feedback.omega])) * MOMENTS
        wrench = own.mass @ jnp.concatenate([acceleration, turn]) - turning - own.weigh * weight
        part = self._part(vehicle)
        wrench = wrench.at[0].add(drag)
        allocator = self.allocator(part)
        thrusts = allocator.thrusts(wrench)
        commands = part.commands_for(thrusts, part.nominal)
        given = thrusts if part.dead_band is None else part.thrusts(commands, part.nominal)
        return {part.name: commands}, allocator.lost(wrench, given)

    def turn_to(self, wanted: Array, feedback: Feedback, integral: Array, own: Named) -> tuple[Array, Array]:
        """(α, I): α = −k_R e_R − k_I I − k_ω ω, and I ← I + T e_R where |e_R| < ½; `attitude_gains`: k_R, k_I, k_ω."""
        error = attitude_error(attitude_of(feedback.down, feedback.north), wanted)
        following = jnp.where(error @ error < 0.25, integral + own.period * error, integral)
        gains = own.attitude_gains
        return -gains[0] * error - gains[1] * following - gains[2] * feedback.omega, following


def poles(square: float, late: float) -> np.ndarray:
    """(ω², ω³/8, 2ζω), ω² at most `square`, and slow enough for commands that are `late` (s)."""
    frequency = min(np.sqrt(square), 0.3 / late, 2.0)
    return np.array([frequency**2, frequency**3 / 8, 2 * DAMPING_RATIO * frequency])


def accelerations(part: Thrusters, M: np.ndarray) -> np.ndarray:
    """The largest acceleration along each axis (surge … yaw) by itself, m/s² and rad/s²; 0 without one.

    Both ways, but for surge, which drag brakes: along it the one ahead where there is none astern.
    """
    allocator, found = part.allocator, np.zeros(6)
    for axis in allocator.kept:
        thrusts = allocator.inverse @ M[:, axis]
        ends = [np.where(side * thrusts > 0, allocator.high, -allocator.low) for side in (1, -1)]
        pushing = np.abs(thrusts) > 1e-9 * np.max(np.abs(thrusts))
        ahead, astern = (np.min(most[pushing] / np.abs(thrusts[pushing])) for most in ends)
        if ahead == 0 or astern == 0:
            ahead, astern = (_most(allocator, side * M[:, axis]) for side in (1, -1))
        found[axis] = ahead if axis == 0 and astern == 0 else min(ahead, astern)
    return np.minimum(found, LARGEST_ACCELERATION)


def lacking(part: Thrusters, most: np.ndarray, needed: Sequence[str]) -> str:
    """How thrusters fail to push along axes that are needed: "push only one way in heave"; "" where they do not.

    most: the accelerations of `accelerations`, (6,).
    """
    allocator, found = part.allocator, dict[str, list[str]]()
    for axis in (AXES.index(name) for name in needed):
        if most[axis] > 0:
            continue
        row = allocator.matrix[axis]
        row = np.where(np.abs(row) > 1e-9 * np.max(np.abs(allocator.matrix)), row, 0.0)
        ways = [np.any(side * row * np.sign(end) > 0) for side in (1, -1) for end in (allocator.low, allocator.high)]
        ahead, astern = ways[0] or ways[1], ways[2] or ways[3]
        how = "give nothing" if axis not in allocator.kept or not (ahead or astern) else "push only one way"
        how = "push only together with other axes" if how != "give nothing" and ahead and astern else how
        found.setdefault(how, []).append(AXES[axis])
    return " and ".join(f"{how} in {', '.join(names)}" for how, names in found.items())


def _most(allocator: Allocator, along: np.ndarray) -> float:
    """The largest a ≤ LARGEST_ACCELERATION for which some thrusts within the limits have B f = a · along, (6,).

    The thrusts of least squares may need one that a thruster of one direction does not give, others may not.
    """
    from scipy.optimize import linprog

    kept, count = allocator.kept, len(allocator.low)
    rows = np.column_stack([allocator.matrix[kept], -along[kept]]) / allocator.units[kept, None]
    limits = [*zip(allocator.low, allocator.high, strict=True), (0.0, LARGEST_ACCELERATION)]
    cost = np.append(np.zeros(count), -1.0)
    solved = linprog(cost, A_eq=rows, b_eq=np.zeros(len(kept)), bounds=limits, method="highs")
    most = float(solved.x[-1]) if solved.status == 0 else 0.0
    return most if most > 1e-9 else 0.0
