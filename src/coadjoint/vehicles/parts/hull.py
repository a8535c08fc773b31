"""Quadratic drag of a hull: along it, and of strips across it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import Force
from coadjoint.models.quantities import number
from coadjoint.spaces.numbers import float64
from coadjoint.vehicles.parts.part import AHEAD, Flow, Part

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
STATIONS = np.concatenate([(_NODES - 1) / 2, (_NODES + 1) / 2])
WEIGHTS = np.tile(_WEIGHTS / 2, 2)
"""Gauss's nodes and weights for strips on both halves of (−1, 1): exact up to degree 5 in |x|, so for pure turning."""


@dataclass(frozen=True, eq=False)
class Hull(Part):
    """X = −½ρ C_x A u|u| along the hull, and the drag of strips across it: couples sway with yaw, heave with pitch.

    A strip at x meets w(x) = (v_y + ω_z x, v_z − ω_y x) and gives −½ρ (C_y H w_y² + C_z B w_z²) w/|w| a metre; of a
    round hull that is −½ρ C d |w|w. Six Gauss nodes over the length.

    axial_drag: C_x on axial_area A, m². crossflow_drag: C_y = C_z, or the two of them. width: B, seen from above, and
    height: H, seen from the side, m. length: m, with its middle at x = center, m. Sources: Fossen (2021), 8.4.3;
    Healey and Lienard (1993).
    """

    axial_drag: Any
    axial_area: Any
    crossflow_drag: Any
    width: Any
    height: Any
    length: Any
    center: Any = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("axial_drag", "axial_area", "width", "height", "length"):
            self.set(**{key: number(getattr(self, key), f"{key}` of the hull `{self.name}", at_least=0.0)})
        self.set(center=number(self.center, f"center` of the hull `{self.name}"))
        drag = float64(self.crossflow_drag, f"Argument `crossflow_drag` of the hull `{self.name}`")
        if np.shape(drag) not in ((), (2,)):
            raise ArgumentError(
                f"Argument `crossflow_drag` of the hull `{self.name}` must be one number, or two for sway and heave, "
                f"but has shape {np.shape(drag)}."
            )
        self.set(crossflow_drag=drag)

    def force(self, flow: Flow, actual: Any, own: Any) -> Force:
        v, omega = flow.velocity, flow.omega
        half = 0.5 * flow.density
        x = own.center + 0.5 * own.length * STATIONS
        w = v[1:] + jnp.outer(x, jnp.stack([omega[2], -omega[1]]))
        if flow.elsewhere is not None:
            w = w - jnp.stack([flow.elsewhere(x[i] * AHEAD)[1:] for i in range(len(STATIONS))])
        areas = jnp.broadcast_to(own.crossflow_drag, (2,)) * jnp.stack([own.height, own.width])
        square = jnp.sum(w**2, axis=1)
        moving = square > 0
        inverse = jnp.where(moving, 1 / jnp.sqrt(jnp.where(moving, square, 1.0)), 0.0)
        push = -0.5 * own.length * half * (WEIGHTS * (w**2 @ areas) * inverse)[:, None] * w
        sideways, moments = jnp.sum(push, axis=0), x @ push
        along = -half * own.axial_drag * own.axial_area * jnp.abs(v[0]) * v[0]
        return Force(
            torque=jnp.stack([jnp.zeros(()), -moments[1], moments[0]]),
            force=jnp.stack([along, sideways[0], sideways[1]]),
        )
