"""Lift, drag and moments of a winged hull by the angles of the flow, as for underwater gliders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp

from coadjoint.arrays import PyTree
from coadjoint.mechanics import Force
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, numbers
from coadjoint_vehicles.parts.part import Flow, Part


@dataclass(frozen=True, eq=False)
class LiftingBody(Part):
    """Drag D = (K_D0 + K_D α²)V² against the flow, lift L = (K_L0 + K_L α)V² across it, side force S = K_β β V².

    α = atan2(w, u) and β = asin(v/V) of the velocity (u, v, w) through the water. Moments, about the flow's axes:
    (K_MR β + K_p p)V², (K_M0 + K_M α + K_q q)V², (K_MY β + K_r r)V². The flow's axes are the body's, turned by α about
    starboard and by β about down; the force along them is (−D, S, −L). A body moving ahead with α > 0 is lifted up.

    drag: (K_D0, K_D); lift: (K_L0, K_L); side: K_β; kg/m, per rad. roll: (K_MR, K_p); pitch: (K_M0, K_M, K_q);
    yaw: (K_MY, K_r); kg, per rad, and kg s. Fitted for small angles: nothing stalls.
    Raises ArgumentError. Sources: Graver (2005), 3.2; Zhang et al. (2013), (21)–(23).
    """

    passive: ClassVar[bool] = True
    kind: ClassVar[str] = "lifting_body"
    drag: Measured = measured(None, numbers(2))
    lift: Measured = measured(None, numbers(2))
    pitch: Measured = measured(None, numbers(3))
    side: Measured = measured(None, default=0.0)
    roll: Measured = measured(None, numbers(2), default=(0.0, 0.0))
    yaw: Measured = measured(None, numbers(2), default=(0.0, 0.0))

    def force(self, flow: Flow, actual: PyTree, own: Named) -> Force:
        v, omega = flow.velocity, flow.omega
        ahead = v[0] ** 2 + v[2] ** 2
        moving = ahead > 0
        u, w = jnp.where(moving, v[0], 1.0), jnp.where(moving, v[2], 0.0)
        inverse = 1 / jnp.sqrt(jnp.where(moving, ahead, 1.0))
        square = ahead + v[1] ** 2
        along = jnp.where(square > 0, jnp.where(moving, 1 / inverse, 0.0), 1.0)
        alpha, beta = jnp.arctan2(w, u), jnp.arctan2(v[1], along)
        ca, sa = u * inverse, w * inverse
        cb, sb = jnp.cos(beta), jnp.sin(beta)
        turn = jnp.stack(
            [
                jnp.stack([ca * cb, -ca * sb, -sa]),
                jnp.stack([sb, cb, jnp.zeros(())]),
                jnp.stack([sa * cb, -sa * sb, ca]),
            ]
        )
        force = jnp.stack(
            [-(own.drag[0] + own.drag[1] * alpha**2), own.side * beta, -(own.lift[0] + own.lift[1] * alpha)]
        )
        torque = jnp.stack(
            [
                own.roll[0] * beta + own.roll[1] * omega[0],
                own.pitch[0] + own.pitch[1] * alpha + own.pitch[2] * omega[1],
                own.yaw[0] * beta + own.yaw[1] * omega[2],
            ]
        )
        return Force(torque=turn @ (square * torque), force=turn @ (square * force))
