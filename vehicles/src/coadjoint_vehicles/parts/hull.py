"""Quadratic drag of a hull: along it, and of strips across it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.mechanics import Force
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative
from coadjoint_vehicles.parts.part import AHEAD, Flow, Part

NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)
TURNING = 1e-30
"""rad²/s²: below it the flow across the hull is the same everywhere."""


def _one_or_two(value: object, name: str) -> PyTree:
    return checks.array(value, name, (), (2,))


@dataclass(frozen=True, eq=False)
class Hull(Part):
    """X = −½ρ C_x A u|u| along the hull, and the drag of strips across it: couples sway with yaw, heave with pitch.

    A strip at x meets w(x) = (v_y + ω_z x, v_z − ω_y x) and gives −½ρ (C_y H w_y² + C_z B w_z²) w/|w| a metre; of a
    round hull that is −½ρ C d |w|w. Four Gauss nodes on either side of the pivot, where |w| is least: exact where the
    hull moves in a plane.

    axial_drag: C_x. axial_area: A, m². crossflow_drag: C_y = C_z, or the two of them. width: B, seen from above, m.
    height: H, seen from the side, m. length: that of the hull, m. center: the x of its middle, m. Sources: Fossen
    (2021), 8.4.3; Healey and Lienard (1993).
    """

    passive: ClassVar[bool] = True
    kind: ClassVar[str] = "hull"
    axial_drag: Measured = measured(u.NUMBER, not_negative)
    axial_area: Measured = measured(u.AREA, not_negative)
    crossflow_drag: Measured = measured(u.NUMBER, _one_or_two)
    width: Measured = measured(u.LENGTH, not_negative)
    height: Measured = measured(u.LENGTH, not_negative)
    length: Measured = measured(u.LENGTH, not_negative)
    center: Measured = measured(u.LENGTH, default=0.0)

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        v, omega = flow.velocity, flow.omega
        half = 0.5 * flow.density
        x, weights = _strips(v + jnp.cross(omega, own.center * AHEAD), omega, 0.5 * own.length)
        x = own.center + x
        w = v[1:] + jnp.outer(x, jnp.stack([omega[2], -omega[1]]))
        if flow.elsewhere is not None:
            w = w - jnp.stack([flow.elsewhere(x[i] * AHEAD)[1:] for i in range(2 * len(NODES))])
        areas = jnp.broadcast_to(own.crossflow_drag, (2,)) * jnp.stack([own.height, own.width])
        square = jnp.sum(w**2, axis=1)
        moving = square > 0
        inverse = jnp.where(moving, 1 / jnp.sqrt(jnp.where(moving, square, 1.0)), 0.0)
        push = -half * (weights * (w**2 @ areas) * inverse)[:, None] * w
        sideways, moments = jnp.sum(push, axis=0), x @ push
        along = -half * own.axial_drag * own.axial_area * jnp.abs(v[0]) * v[0]
        return Force(
            torque=jnp.stack([jnp.zeros(()), -moments[1], moments[0]]),
            force=jnp.stack([along, sideways[0], sideways[1]]),
        )


def _strips(v: Array, omega: Array, end: PyTree) -> tuple[Array, Array]:
    """Places from the middle of the hull and lengths of its strips; v: velocity of the middle, end: half the length.

    They part at the pivot (v_z ω_y − v_y ω_z)/(ω_y² + ω_z²), or at the end that is nearer to it: |w|w is smooth away
    from its zero.
    """
    turning = omega[1] ** 2 + omega[2] ** 2
    parting = jnp.clip(v[2] * omega[1] - v[1] * omega[2], -end * turning, end * turning)
    pivot = jnp.where(turning > TURNING, parting / jnp.where(turning > TURNING, turning, 1.0), 0.0)
    aft, fore = 0.5 * (end + pivot), 0.5 * (end - pivot)
    places = jnp.concatenate([0.5 * (pivot - end) + aft * NODES, 0.5 * (pivot + end) + fore * NODES])
    return places, jnp.concatenate([aft * WEIGHTS, fore * WEIGHTS])
