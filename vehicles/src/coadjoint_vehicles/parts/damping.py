"""Damping by matrices: linear, quadratic and with forward speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.checks import float64
from coadjoint.mechanics import Force
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, numbers, six
from coadjoint_vehicles.parts.part import Flow, Part, speed_of


def _six(value: object, name: str) -> PyTree:
    found = float64(value, f"Argument `{name}`")
    checks.shape(found, name, (6, 6), (6,))
    return found


@dataclass(frozen=True, eq=False)
class Damping(Part):
    """(F, T)_i = −exp(−σ_i|v|) Σ_j D_ij V_j − Σ_j E_ij |V_j|V_j − |u| Σ_j C_ij V_j, with V = (v, ω), u = V_1.

    linear: D; quadratic: E; forward: C; each (6, 6) or its diagonal (6,), in the order surge, sway, heave, roll, pitch,
    yaw, SI units, positive where it brakes. fading: σ, (6,) s/m, with which linear skin friction gives way to drag and
    lift at speed. Raises ArgumentError for other shapes. Source: Fossen (2021), 6.3 and 8.4.2.
    """

    passive: ClassVar[bool] = True
    kind: ClassVar[str] = "damping"
    linear: Measured = measured(None, _six, turn=six, default=None)
    quadratic: Measured = measured(None, _six, turn=six, default=None)
    forward: Measured = measured(None, _six, turn=six, default=None)
    fading: Measured = measured(u.SLOWNESS, numbers(6), default=None)

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        V = jnp.concatenate([flow.velocity, flow.omega])
        total = jnp.zeros(6)
        if "linear" in own:
            braking = _times(own.linear, V)
            total = total - (jnp.exp(-own.fading * speed_of(flow.velocity)) * braking if "fading" in own else braking)
        if "quadratic" in own:
            total = total - _times(own.quadratic, jnp.abs(V) * V)
        if "forward" in own:
            total = total - jnp.abs(V[0]) * _times(own.forward, V)
        return Force(torque=total[3:], force=total[:3])


def _times(matrix: Array, V: Array) -> Array:
    return matrix @ V if jnp.ndim(matrix) == 2 else matrix * V
