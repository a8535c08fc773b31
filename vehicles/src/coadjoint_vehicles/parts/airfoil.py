"""Airfoils whose lift and drag are lines in the angle of attack, as simulators of robots have them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.mechanics import Force
from coadjoint.models.quantities import number, positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative, place, share, way
from coadjoint_vehicles.parts.part import Command, Flow, Part, acting_at


@dataclass(frozen=True, eq=False)
class Airfoil(Part):
    """½ρA|w|²(C_L across the flow − C_D along it), in the plane of chord c and normal n; δ > 0 as of a `Fin`.

    w is the velocity of its place in that plane, α = atan2(w·n, w·c) + δ − α₀. Up to stall C_L = C_Lα α; beyond
    C_L = ±max(0, C_Lα α_s + C_Lα′(|α| − α_s)). C_D = |C_Dα|α|| + C_Dαα α² up to stall; beyond its first term is
    |C_Dα α_s + C_Dα′(|α| − α_s)|. α > 0 pushes along −n.

    position: of its centre of pressure, (3,) m. chord, normal: unit vectors (3,), at right angles, ahead and across.
    area: A, m². lift_slope: C_Lα, 1/rad. stall: α_s, rad. drag_slope: C_Dα, 1/rad. drag_square: C_Dαα, 1/rad².
    stalled_lift_slope, stalled_drag_slope: C_Lα′, C_Dα′, 1/rad. zero_lift: α₀, rad. swept: 1 where flow along the span
    lessens both by |w|²/|v|², v with the span; 0 where not. reversible: 1 if flow from behind produces a force, 0 if
    not. limit: largest |δ|, rad; without it the foil is fixed. lag: of its actuator, s. rate: of its actuator, rad/s.
    Raises ArgumentError for impossible values. Source: the plugins LiftDrag of Gazebo and uuv_simulator.
    """

    passive: ClassVar[bool] = True
    kind: ClassVar[str] = "airfoil"
    position: Measured = place()
    chord: Measured = way()
    normal: Measured = way()
    area: Measured = measured(u.AREA, not_negative)
    lift_slope: Measured = measured(u.PER_ANGLE, positive)
    stall: Measured = measured(u.ANGLE, positive)
    drag_slope: Measured = measured(u.PER_ANGLE, number, default=0.0)
    drag_square: Measured = measured(u.NUMBER, not_negative, default=0.0)
    stalled_lift_slope: Measured = measured(u.PER_ANGLE, number, default=0.0)
    stalled_drag_slope: Measured = measured(u.PER_ANGLE, number, default=0.0)
    zero_lift: Measured = measured(u.ANGLE, number, default=0.0)
    swept: Measured = measured(u.NUMBER, share, default=0.0)
    reversible: Measured = measured(u.NUMBER, share, default=1.0)
    limit: Measured = measured(u.ANGLE, positive, default=None)
    lag: Measured = measured(u.TIME, not_negative, default=None)
    rate: Measured = measured(u.ANGULAR_VELOCITY, positive, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not traced(self.chord, self.normal) and abs(self.chord @ self.normal) > 1e-6:
            raise ArgumentError(
                f"Argument `normal` of the {self.title}` must be at right angles to its chord, but they are "
                f"{self.normal.tolist()} and {self.chord.tolist()}."
            )

    @property
    def command(self) -> Command | None:
        return None if self.limit is None else Command("rad")

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        w = flow.at(own.position)
        along, across = w @ own.chord, w @ own.normal
        square = along**2 + across**2
        lift, drag = _coefficients(along, across, jnp.zeros(()) if actual is None else actual, own)
        whole = w @ w
        share = jnp.where(whole > 0, square / jnp.where(whole > 0, whole, 1.0), 1.0)
        moving = square > 0
        speed = jnp.where(moving, jnp.sqrt(jnp.where(moving, square, 1.0)), 0.0)
        size = 0.5 * flow.density * own.area * speed * (own.swept * share + 1 - own.swept)
        pushed = (lift * across - drag * along) * own.chord - (lift * along + drag * across) * own.normal
        return acting_at(own.position, size * pushed)


def _coefficients(along: Array, across: Array, angle: Array, own: Named) -> tuple[Array, Array]:
    """(C_L, C_D) of a foil turned by `angle`; both 0 where it does not meet the flow."""
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    chord, normal = along * cosine - across * sine, across * cosine + along * sine
    behind = chord < 0
    sign = jnp.where(behind, -1.0, 1.0)
    moving = chord**2 + normal**2 > 0
    alpha = jnp.arctan2(jnp.where(moving, sign * normal, 0.0), jnp.where(moving, sign * chord, 1.0)) - own.zero_lift
    size, past = jnp.abs(alpha), jnp.abs(alpha) - own.stall
    held = jnp.maximum(0.0, own.lift_slope * own.stall + own.stalled_lift_slope * past)
    lift = jnp.where(past > 0, jnp.sign(alpha) * held, own.lift_slope * alpha)  # with its slope at α = 0
    line = jnp.where(past > 0, own.drag_slope * own.stall + own.stalled_drag_slope * past, own.drag_slope * size)
    meets = jnp.where(behind, own.reversible, 1.0)
    return meets * lift, meets * (jnp.abs(line) + own.drag_square * alpha**2)
