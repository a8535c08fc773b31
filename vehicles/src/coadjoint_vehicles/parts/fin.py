"""Fins: lift, drag and stall in the flow at their own place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import traced
from coadjoint.mechanics import Force
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative, place, way
from coadjoint_vehicles.parts.part import AHEAD, Command, Flow, Part, acting_at, speed_of


@dataclass(frozen=True, eq=False)
class Fin(Part):
    """A fin, or a pair of fins, anywhere and at any slant; δ > 0 has the trailing edge towards +normal.

    In the velocity w = v + ω × r of its place r through the water, with the chord c along the hull and the normal n,
    the angle of attack is atan2(w·n, w·c) + δ: lift acts across the flow and drag along it, both in the plane of c
    and n. Going ahead, δ > 0 pushes along −n.

    position: r, (3,) m. normal: n, unit vector (3,), not along the hull. area: m², of a pair both. lift_slope: C_Lα,
    1/rad, below 2π; stall: α_s, rad; drag: C_D at zero lift. limit: largest |δ|, rad; without it the fin is fixed.
    lag: of its actuator, s. rate: of its actuator, rad/s. Raises ArgumentError for impossible values.
    """

    passive: ClassVar[bool] = True
    kind: ClassVar[str] = "fin"
    position: Measured = place()
    normal: Measured = way()
    area: Measured = measured(u.AREA, not_negative)
    lift_slope: Measured = measured(u.PER_ANGLE, positive)
    stall: Measured = measured(u.ANGLE, positive)
    drag: Measured = measured(u.NUMBER, not_negative, default=None)
    limit: Measured = measured(u.ANGLE, positive, default=None)
    lag: Measured = measured(u.TIME, not_negative, default=None)
    rate: Measured = measured(u.ANGULAR_VELOCITY, positive, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        of = f"` of the {self.title}"
        if not traced(self.normal) and abs(self.normal[0]) > 0.999:
            raise ArgumentError(f"Argument `normal{of}` must not point along the hull, but is {self.normal.tolist()}.")
        if not traced(self.lift_slope) and self.lift_slope >= 2 * np.pi:
            raise ArgumentError(
                f"Argument `lift_slope{of}` must be below 2π per rad, that of an endless wing, but is "
                f"{self.lift_slope:g}."
            )

    @property
    def command(self) -> Command | None:
        return None if self.limit is None else Command("rad")

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        along = AHEAD - own.normal[0] * own.normal
        chord = along / jnp.sqrt(along @ along)
        w = flow.at(own.position)
        forces = _in_plane(w @ chord, w @ own.normal, jnp.zeros(()) if actual is None else actual, own)
        return acting_at(own.position, 0.5 * flow.density * own.area * (forces[0] * chord + forces[1] * own.normal))


def _in_plane(along: Array, across: Array, angle: Array, own: Named) -> tuple[Array, Array]:
    """Force/(½ρA) along the hull and across it, of a fin turned by `angle` so that it meets more flow from across."""
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    chord, normal = along * cosine - across * sine, across * cosine + along * sine
    lift, drag = lift_and_drag(chord, normal, own.lift_slope, own.stall, own.drag if "drag" in own else 0.0)
    speed = speed_of(jnp.stack([along, across]))
    inverse = jnp.where(speed > 0, 1 / jnp.where(speed > 0, speed, 1.0), 0.0)
    return inverse * (lift * across - drag * along), -inverse * (lift * along + drag * across)


def lift_and_drag(
    chord: Array, normal: Array, slope: PyTree, stall: PyTree, least: PyTree = 0.0
) -> tuple[Array, Array]:
    """(C_L, C_D)|V|² of a fin in a flow with these velocities along its chord and along its normal.

    Below stall C_L = C_Lα sin α cos α and C_D = C_D0 + C_L²/(π Λ), with the aspect ratio Λ = 2C_Lα/(2π − C_Lα) of
    Prandtl's lifting line; above, the plate whose normal force is 2 sin α: C_L = 2 sin α cos α, C_D = C_D0 cos²α +
    2 sin²α; tan α = normal/chord. The two blend by s = ½(1 + tanh(50 (sin²α − sin²α_s))).
    slope: C_Lα, 1/rad, below 2π. stall: α_s, rad. least: C_D0.
    Source: R. E. Sheldahl and P. C. Klimas, SAND80-2114 (1981): NACA 0015 through 180°. The plate is within 0.09
    in C_L and 0.2 in C_D of it from 30° to 90°; broadside, a fin as short as those of vehicles has less.
    """
    square = chord**2 + normal**2
    moving = square > 0
    inverse = jnp.where(moving, 1 / jnp.sqrt(jnp.where(moving, square, 1.0)), 0.0)
    sine, cosine = normal * inverse, chord * inverse
    stalled = 0.5 * (1 + jnp.tanh(50 * (sine**2 - jnp.sin(stall) ** 2)))
    lift = slope * sine * cosine
    induced = least + lift**2 * (2 * jnp.pi - slope) / (2 * jnp.pi * slope)
    plate = least * cosine**2 + 2 * sine**2
    return (
        square * ((1 - stalled) * lift + stalled * 2 * sine * cosine),
        square * ((1 - stalled) * induced + stalled * plate),
    )
