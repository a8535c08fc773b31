"""Hydrodynamic forces on a vehicle that moves through water: damping, cross-flow, fins and propellers.

Velocities are v, of the body origin O relative to the water, and ω; forces (X, Y, Z) act with torques (K, M, N) about
O, in body axes forward, starboard, down.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.groups.group import Array
from coadjoint.mechanics.state import Force

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
STRIPS = tuple((side * (1 + x) / 2, w / 2) for side in (-1.0, 1.0) for x, w in zip(_NODES, _WEIGHTS, strict=True))
"""Gauss's nodes and weights for strips on both halves of (−1, 1): exact up to degree 5 in |x|, so for pure turning."""


def size(vector: Array) -> Array:
    """|v|, with derivative 0 at rest."""
    square = vector @ vector
    moving = square > 0
    return jnp.where(moving, jnp.sqrt(jnp.where(moving, square, 1.0)), 0.0)


def linear_damping(v: Array, omega: Array, damping: Any, fading: Any) -> Force:
    """(F, T)_i = −exp(−σ_i |v|) Σ_j D_ij (v, ω)_j.

    damping: D, (6, 6) or its diagonal (6,), in the order surge, sway, heave, roll, pitch, yaw; N s/m, N s, N m s.
    fading: σ, (6,) s/m, with which skin friction gives way to drag and lift at speed. Source: Fossen (2021), 8.4.2.
    """
    D, both = jnp.asarray(damping), jnp.concatenate([v, omega])
    generalised = -jnp.exp(-jnp.asarray(fading) * size(v)) * (D @ both if D.ndim == 2 else D * both)
    return Force(torque=generalised[3:], force=generalised[:3])


def axial_drag(v: Array, density: Any, drag: Any, area: Any) -> Force:
    """X = −½ρ C_d A u|u|. area: A, m², of the largest cross-section."""
    return Force(force=-0.5 * density * drag * area * jnp.abs(v[0]) * v[0] * jnp.array([1.0, 0.0, 0.0]))


def crossflow_drag(v: Array, omega: Array, density: Any, drag: Any, diameter: Any, length: Any) -> Force:
    """Drag of strips of a cylinder in the flow across it: couples sway with yaw and heave with pitch.

    (Y, Z) = −½ρ C_d d ∫ |w|w dx, (M, N) = ½ρ C_d d ∫ x (|w|w_z, −|w|w_y) dx over −L/2 < x < L/2, with the velocity
    w(x) = (v_y + ω_z x, v_z − ω_y x) of the strip across the hull; six Gauss nodes. Source: Fossen (2021), 8.4.3.
    """
    total = jnp.zeros(4)
    for station, weight in STRIPS:
        x = 0.5 * length * station
        w = jnp.stack([v[1] + omega[2] * x, v[2] - omega[1] * x])
        push = -0.25 * weight * density * drag * diameter * length * size(w) * w
        total = total + jnp.stack([push[0], push[1], -x * push[1], x * push[0]])
    zero = jnp.zeros(())
    return Force(torque=jnp.stack([zero, total[2], total[3]]), force=jnp.stack([zero, total[0], total[1]]))


def lift_and_drag(chord: Array, normal: Array, slope: Any, stall: Any) -> tuple[Array, Array]:
    """(C_L, C_D)|V|² of a fin in a flow with these velocities along its chord and along its normal.

    Below stall C_L = C_Lα sin α cos α and C_D = C_L²/(π Λ), with the aspect ratio Λ = 2C_Lα/(2π − C_Lα) of Prandtl's
    lifting line; far above, the flat plate's C_L = 2 sin²α cos α, C_D = 2 sin³α; tan α = normal/chord.
    The two blend by s = ½(1 + tanh(50 (sin²α − sin²α_s))). slope: C_Lα, 1/rad, below 2π. stall: α_s, rad.
    """
    square = chord**2 + normal**2
    moving = square > 0
    inverse = jnp.where(moving, 1 / jnp.sqrt(jnp.where(moving, square, 1.0)), 0.0)
    sine, cosine = normal * inverse, chord * inverse
    stalled = 0.5 * (1 + jnp.tanh(50 * (sine**2 - jnp.sin(stall) ** 2)))
    lift = slope * sine * cosine
    induced = lift**2 * (2 * jnp.pi - slope) / (2 * jnp.pi * slope)
    plate = 2 * jnp.abs(sine) * sine
    return (
        square * ((1 - stalled) * lift + stalled * plate * cosine),
        square * ((1 - stalled) * induced + stalled * plate * sine),
    )


def stern_planes(v: Array, omega: Array, angle: Any, p: Any) -> Force:
    """A pair of horizontal fins at x_f on the axis; δ > 0 has the trailing edge down and pitches the nose down.

    With the flow (u, w) = (v_x, v_z − ω_y x_f) at the fins, X and Z are lift across it and drag along it, and
    M = −x_f Z. p: fluid_density, fin_area (of the pair, m²), fin_lift_slope, fin_stall, fin_position (x_f, m).
    """
    along, across = _fin(v[0], v[2] - omega[1] * p.fin_position, angle, p)
    zero = jnp.zeros(())
    return Force(torque=jnp.stack([zero, -p.fin_position * across, zero]), force=jnp.stack([along, zero, across]))


def rudders(v: Array, omega: Array, angle: Any, p: Any) -> Force:
    """A pair of vertical fins at x_f; δ > 0 has the trailing edge to starboard and turns the nose to starboard.

    The flow is (v_x, v_y + ω_z x_f), and N = x_f Y.
    """
    along, across = _fin(v[0], v[1] + omega[2] * p.fin_position, angle, p)
    zero = jnp.zeros(())
    return Force(torque=jnp.stack([zero, zero, p.fin_position * across]), force=jnp.stack([along, across, zero]))


def _fin(along: Array, across: Array, angle: Any, p: Any) -> tuple[Array, Array]:
    """The force along the hull and across it, of a fin turned by `angle` so that it meets more flow from across."""
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    chord, normal = along * cosine - across * sine, across * cosine + along * sine
    lift, drag = lift_and_drag(chord, normal, p.fin_lift_slope, p.fin_stall)
    half = 0.5 * p.fluid_density * p.fin_area
    speed = size(jnp.stack([along, across]))
    inverse = jnp.where(speed > 0, 1 / jnp.where(speed > 0, speed, 1.0), 0.0)
    return half * inverse * (lift * across - drag * along), -half * inverse * (lift * along + drag * across)


def propeller(v: Array, revolutions: Any, p: Any) -> Force:
    """X = (1 − t) ρ D⁴ (K_T0 n|n| + K_T1 |n| V_a/D), K = k ρ D⁵ (K_Q0 n|n| + K_Q1 |n| V_a/D).

    V_a = (1 − w) max(u, 0), and V_a = 0 where n < 0. revolutions: n, 1/s. p: fluid_density, propeller_diameter,
    thrust (K_T0, K_T1), torque (K_Q0, K_Q1), thrust_deduction t, advance 1 − w, torque_fraction k, what the hull feels
    of the torque. Source: Fossen (2021), 9.3.
    """
    D, n = p.propeller_diameter, revolutions
    advance = jnp.where(n > 0, p.advance * jnp.maximum(v[0], 0.0) / D, 0.0)
    thrust = p.fluid_density * D**4 * jnp.abs(n) * (p.thrust[0] * n + p.thrust[1] * advance)
    torque = p.fluid_density * D**5 * jnp.abs(n) * (p.torque[0] * n + p.torque[1] * advance)
    ahead = jnp.array([1.0, 0.0, 0.0])
    return Force(torque=p.torque_fraction * torque * ahead, force=(1 - p.thrust_deduction) * thrust * ahead)
