"""Thrusters fixed to the hull: a command each, a force curve, a dead band and a lag."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate, named, traced
from coadjoint.mechanics import Force
from coadjoint.models.quantities import direction, positive, vector
from coadjoint.spaces import Named
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.parts.allocator import ATTITUDE_FIRST, LEAST_AUTHORITY, Allocator
from coadjoint_vehicles.parts.force_curves import Polynomial
from coadjoint_vehicles.parts.measured import Measured, lag_or_none, measured, numbers, share
from coadjoint_vehicles.parts.part import Command, Flow, Part, towards
from coadjoint_vehicles.parts.published_curves import force_curve
from coadjoint_vehicles.parts.supplied_curve import Supplied

COMMANDED = u.Dimension(u.NUMBER.powers, "SI", "commands")
"""The dimension of values in the unit of the commands."""
OF_ALLOCATION = ("least_authority", "axis_weights", "thruster_weights")
"""Fields that count in `allocate` alone."""


def _columns(value: Any, axes: PyTree) -> PyTree:
    return border.twist(np.transpose(value), axes).T


@dataclass(frozen=True, eq=False)
class Thrusters(Part):
    """(F, T) = Σ_i f(u_i) (d_i, r_i × d_i + q_i d_i) of n thrusters, or B f(u) with an allocation matrix B.

    f is the force curve, times ρ/ρ₀ where `density` ρ₀ (kg/m³), that of the water it was measured in, is given; f = 0
    where |u − u₀| < dead_band, u₀ the neutral command. A command is clipped to its limits, and the thruster follows by
    u ← u + (1 − exp(−h/τ))(command − u).

    dead_band: largest |u − u₀| without force. density: ρ₀, kg/m³. curve: as `force_curve` takes it, from commands in
    `unit` to N. positions: r_i, (n, 3) m; directions: d_i, (n, 3), unit vectors in which a positive force pushes;
    torque: q_i, N m about d_i per N, a number or (n,), the reaction of the propellers. Or allocation: B, (6, n), rows
    X, Y, Z, K, M, N. limit: the largest |u|, or (lowest, highest); by default the ends of a table. lag: τ, s, none if
    left out. effectiveness: e_i, the part of its force that a thruster has, from 0, dead, to 1, a number or (n,): B's
    columns are times e_i, also in the model of software on board, unless the parameter is replaced. least_authority:
    the part of the largest singular value of the scaled B below which `allocate` takes a direction as uncontrollable.
    axis_weights: w of surge … yaw, with which `allocate` finds the least squares within the limits (`parts.allocator`),
    by default such that force gives way before torque; thruster_weights: v, (n,): of several the least Σ_i (v_i f_i)².
    Raises ArgumentError for impossible values.
    """

    kind: ClassVar[str] = "thrusters"
    curve: Any
    positions: Measured = measured(u.LENGTH, None, turn=border.body_vector, default=None)
    directions: Measured = measured(u.NUMBER, None, turn=border.body_vector, default=None)
    torque: Measured = measured(u.LENGTH, None, default=None)
    allocation: Measured = measured(None, None, turn=_columns, default=None)
    unit: str = "1"
    limit: Measured = measured(COMMANDED, None, default=None)
    lag: Measured = measured(u.TIME, lag_or_none, default=None)
    dead_band: Measured = measured(COMMANDED, lag_or_none, default=None)
    density: Measured = measured(u.DENSITY, positive, default=None)
    effectiveness: Measured = measured(u.NUMBER, None, default=1.0)
    least_authority: Measured = measured(u.NUMBER, share, default=LEAST_AUTHORITY)
    axis_weights: Measured = measured(u.NUMBER, numbers(6), default=ATTITUDE_FIRST)
    thruster_weights: Measured = measured(u.NUMBER, None, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        of = f"` of the thrusters `{self.name}"
        self.set(curve=force_curve(self.curve, self.name), **self._geometry(of))
        if self.curve.counts - {self.count}:
            raise ArgumentError(
                f"Argument `curve{of}` must have one number for all thrusters or one for each of the {self.count}, but "
                f"has {', '.join(map(str, sorted(self.curve.counts)))}."
            )
        if self.thruster_weights is not None:
            self.set(thruster_weights=checks.array(self.thruster_weights, f"thruster_weights{of}", (self.count,)))
        for name in ("axis_weights", "thruster_weights"):
            if (value := getattr(self, name)) is not None and not np.all(np.asarray(value) > 0):
                raise ArgumentError(f"Argument `{name}{of}` must be positive, but is {np.asarray(value).tolist()}.")
        self.set(limit=self._limits(of), effectiveness=self._effectiveness(of))
        if self.limit is not None:
            low, high = np.min(self.limit[0]), np.max(self.limit[1])
            self.curve.require_growth((low, high), self.name)
            if isinstance(self.curve, Supplied):
                self.curve.require_supply(np.broadcast_to(high, (self.count,)), of)
            reach = np.min(np.max(np.abs(self.limit - self.curve.neutral), axis=0))
            if self.dead_band is not None and self.dead_band >= reach:
                raise ArgumentError(
                    f"Argument `dead_band{of}` must leave something of the commands from {low:g} to "
                    f"{high:g} about the neutral {self.curve.neutral:g}, but is {self.dead_band:g}."
                )

    def _geometry(self, of: str) -> dict[str, object]:
        """The checked positions, directions and torque, or the checked allocation matrix."""
        if (self.allocation is None) == (self.positions is None or self.directions is None):
            raise ArgumentError(
                f"The thrusters `{self.name}` need either `positions` and `directions`, or `allocation`."
            )
        if self.allocation is not None:
            matrix = checks.array(self.allocation, f"allocation{of}", "(6, n)")
            if self.positions is not None or self.directions is not None or self.torque is not None:
                raise ArgumentError(
                    f"Argument `allocation{of}` holds positions, directions and torque: leave them out."
                )
            return {"allocation": matrix}
        given = {"positions": checks.array(self.positions, f"positions{of}", "(n, 3)")}
        given["directions"] = checks.array(self.directions, f"directions{of}", np.shape(given["positions"]))
        for i, row in enumerate(given["directions"]):
            given["directions"][i] = direction(row, f"directions[{i}]{of}")
        if self.torque is not None:
            given["torque"] = checks.array(self.torque, f"torque{of}", (), (len(given["positions"]),))
        return given

    def _effectiveness(self, of: str) -> PyTree:
        """e, (n,)."""
        found = checks.array(self.effectiveness, f"effectiveness{of}", (), (self.count,))
        if not traced(found) and np.any((found < 0) | (found > 1)):
            raise ArgumentError(
                f"Argument `effectiveness{of}` must be from 0, dead, to 1, but is {np.asarray(found).tolist()}."
            )
        return found if traced(found) else np.broadcast_to(found, (self.count,)).copy()

    def _limits(self, of: str) -> PyTree:
        """(lowest, highest) command, (2,), or of each thruster, (2, n)."""
        if self.limit is None:
            if isinstance(self.curve, Polynomial):
                raise ArgumentError(f"Argument `limit{of}` must be given with a polynomial, which falls somewhere.")
            return None if self.curve.reach is None else np.array(self.curve.reach)
        found, rest = float64(self.limit, f"Argument `limit{of}`"), self.curve.neutral
        found = np.array([-found, found]) if np.shape(found) == () else found
        fits = np.shape(found) in ((2,), (2, self.count)) and np.all((found[0] <= rest) & (rest <= found[1]))
        if not fits or np.any(found[0] == found[1]):
            raise ArgumentError(
                f"Argument `limit{of}` must be the largest command, (lowest, highest) or the lowest and the highest of "
                f"each thruster, (2, {self.count}), about the neutral command {rest:g}, but is "
                f"{np.asarray(self.limit).tolist()}."
            )
        return found

    @property
    def count(self) -> int:
        """n."""
        return len(self.positions) if self.allocation is None else self.allocation.shape[1]

    @property
    def command(self) -> Command:
        return Command(self.unit, (self.count,), self.curve.neutral)

    def parameters(self) -> dict[str, PyTree]:
        found = {**super().parameters(), "curve": self.curve.parameters()}
        return {name: value for name, value in found.items() if name not in OF_ALLOCATION}

    def matrix(self, own: Named) -> Array:
        """B, (6, n), from the geometry or as given, of thrusters that have all or a part of their force."""
        return self._whole_matrix(own) * own.effectiveness

    def _whole_matrix(self, own: Named) -> Array:
        if self.allocation is not None:
            return own.allocation
        torques = jnp.cross(own.positions, own.directions)
        if "torque" in own:
            torques = torques + jnp.broadcast_to(own.torque, (self.count,))[:, None] * own.directions
        return jnp.concatenate([own.directions, torques], axis=1).T

    def thrusts(self, actual: Array, own: Named, density: object = None) -> Array:
        """f(u), (n,) N, with the dead band, in water of a density, kg/m³ (None: that of the curve)."""
        found = self.curve.force(actual, own.curve)
        if "dead_band" in own:
            found = jnp.where(jnp.abs(actual - self.curve.neutral) < own.dead_band, 0.0, found)
        return found * (density / own.density) if "density" in own and density is not None else found

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        both = self.matrix(own) @ self.thrusts(actual, own, flow.density)
        return Force(torque=both[3:], force=both[:3])

    @property
    def no_signal(self) -> float | None:
        """0 µs, the absence of pulses, of thrusters whose pulses are longer: the motor stops."""
        ends = self.curve.reach if self.limit is None else self.limit
        return 0.0 if u.same(self.unit, "µs") and ends is not None and ends[0] > 0 else None

    def advance(self, actual: PyTree, command: Array, h: Scalar, own: Named) -> PyTree:
        if self.no_signal is not None:
            command = jnp.where(command == self.no_signal, self.curve.neutral, command)
        return towards(actual, jnp.clip(command, *_ends(own)) if "limit" in own else command, h, own)

    def commands_for(self, thrusts: Array, own: Named) -> Array:
        """The commands whose thrusts are nearest to these, (n,) N."""
        limit = _ends(own)
        u, rest = self.curve.command(thrusts, own.curve, limit), self.curve.neutral
        if "dead_band" in own:
            # A little beyond the edge, which rounding must not put inside.
            edge = rest + jnp.sign(thrusts) * own.dead_band * (1 + 1e-12)
            pushes = jnp.abs(thrusts) > 0.5 * jnp.abs(self.curve.force(edge, own.curve))
            u = jnp.where(jnp.abs(u - rest) > own.dead_band, u, jnp.where(pushes, edge, rest))
        return jnp.clip(u, *limit)

    def allocate(self, wrench: object) -> Array:
        """Commands (n,) for a wrench (X, Y, Z, K, M, N), N and N m, along the axes that the thrusters control.

        Thrusts of least |f| with B f = w along these axes. If one of them would exceed the limit of its thruster, those
        within the limits of least squares by `axis_weights` (`parts.allocator`), by which attitude comes before
        position. Computed with the numbers of the part as it was made, as software on board is. Raises ArgumentError
        for another shape.
        """
        return evaluate(self._allocated, vector(wrench, "wrench", 6))

    def _allocated(self, wrench: Array) -> Array:
        return self.commands_for(self.allocator.thrusts(wrench), self.nominal)

    @cached_property
    def allocator(self) -> Allocator:
        """The allocation of wrenches to its thrusters, with the numbers of the part as it was made."""
        weights = self.axis_weights, self.thruster_weights
        edges = None if self.dead_band is None else self.edges
        return Allocator(self.nominal_matrix, *self.extremes, self.least_authority, *weights, edges)

    @property
    def nominal(self) -> Named:
        """The numbers of the part as it was made, as `own`."""
        return named(self.parameters())

    @property
    def _without_load(self) -> Named:
        """`nominal` at the voltage of the battery without load, as `commands_for` has it."""
        found = self.parameters()
        return named({**found, "curve": {k: v for k, v in found["curve"].items() if k != "resistance"}})

    @property
    def nominal_matrix(self) -> np.ndarray:
        """B, (6, n), with the numbers of the part as it was made."""
        return evaluate(self.matrix, self.nominal)

    @property
    def edges(self) -> np.ndarray:
        """The thrusts at the lower and the upper edge of each dead band, (2, n) N; 0 without one."""
        if self.dead_band is None:
            return np.zeros((2, self.count))
        own, rest = self.nominal, self.curve.neutral
        ends = [np.full(self.count, rest + side * float(self.dead_band)) for side in (-1, 1)]
        return np.array([evaluate(self.curve.force, end, own.curve) for end in ends])

    @property
    def rounding(self) -> np.ndarray:
        """The largest force or torque along each axis, (6,), that commands about the dead band may miss."""
        return 0.51 * np.abs(self.nominal_matrix) @ np.max(np.abs(self.edges), axis=0)

    @property
    def extremes(self) -> tuple[np.ndarray, np.ndarray]:
        """The thrusts of each thruster at the lowest and at the highest command, (n,) N; without limits infinite.

        Of a battery at the voltage without load, as in `commands_for`: at the most thrust all commands are the highest.
        """
        if self.limit is None:
            return np.full(self.count, -np.inf), np.full(self.count, np.inf)
        ends = (np.broadcast_to(end, (self.count,)) for end in self.limit)
        low, high = (evaluate(self.thrusts, end, self._without_load) for end in ends)
        return low, high


def _ends(own: Named) -> tuple[PyTree, PyTree]:
    """The lowest and the highest command; one number replaced for both is the largest."""
    if "limit" not in own:
        return -jnp.inf, jnp.inf
    return (own.limit[0], own.limit[1]) if jnp.ndim(own.limit) else (-own.limit, own.limit)
