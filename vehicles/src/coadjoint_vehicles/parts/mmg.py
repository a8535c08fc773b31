"""Hull, propeller and rudder of a ship in the plane, by the MMG standard method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import jax.numpy as jnp

from coadjoint import units as u
from coadjoint.arrays import Array, Scalar
from coadjoint.mechanics import Force
from coadjoint.models.quantities import positive
from coadjoint.spaces import Named
from coadjoint_vehicles.parts.measured import Measured, measured, not_negative, numbers
from coadjoint_vehicles.parts.part import Command, Flow, Part

SURGE, SWAY = ("vv", "vr", "rr", "vvvv"), ("v", "r", "vvv", "vvr", "vrr", "rrr")
"""The coefficients of X'_H, and of Y'_H and N'_H, by the powers of v' and r'."""


class Inflow(NamedTuple):
    """K_T of the propeller; u_R and v_R of the rudder, m/s."""

    thrust: Array
    along: Array
    across: Array


@dataclass(frozen=True, eq=False)
class Mmg(Part):
    """X, Y and N about O, midships, of hull, propeller and rudder, with v' = v/U, r' = rL/U and U² = u² + v².

        hull         ½ρLdU² (−R'₀ + Σ X'_ij v'^i r'^j, Σ Y'_ij v'^i r'^j, L Σ N'_ij v'^i r'^j)
        propeller    X = (1 − t_P) ρ n² D⁴ K_T,  K_T = k₀ + k₁ J + k₂ J²,  J = u (1 − w_P)/(n D)
                     1 − w_P = (1 − w_P0)(1 + (C_2 − 1)(1 − exp(−C_1|β_P|))),  β_P = β − x'_P r'
        rudder       (X, Y, N) = −F_N ((1 − t_R) sin δ, (1 + a_H) cos δ, (x'_R + a_H x'_H) L cos δ)
                     F_N = ½ρ A_R U_R² f_α sin(δ − atan(v_R/u_R)),  v_R = U γ_R (β − l'_R r')

    u_R is that of the propeller's race over D/H_R of the span. δ > 0 turns to starboard. It holds under way ahead, not
    near rest, where r' has no meaning; at rest the hull has no force. The revolutions stay what they are.

    length: L, m. draught: d, m. resistance: R'₀. surge: X'_vv, X'_vr, X'_rr, X'_vvvv. sway, yaw: of Y' and N', v, r,
    vvv, vvr, vrr, rrr. munk: m_y − m_x of the added mass, kg, whose Munk moment is in N' and in ℓ, and is taken away
    once. diameter: D, m. thrust: k₀, k₁, k₂. thrust_deduction: t_P. wake: w_P0, C_1, C_2 for β_P > 0 and < 0.
    propeller_at: x'_P. revolutions: n, 1/s. area: A_R, m². span: H_R, m. lift_slope: f_α. interaction: t_R, a_H, x'_H.
    rudder_at: x'_R, l'_R. inflow: ε, κ, γ_R for β_R < 0 and > 0. limit: largest |δ|, rad. lag: of its actuator, s.
    rate: of its actuator, rad/s. Commanded by δ, rad. Raises ArgumentError. Source: Yasukawa and Yoshimura (2015).
    """

    kind: ClassVar[str] = "mmg"
    length: Measured = measured(u.LENGTH, positive)
    draught: Measured = measured(u.LENGTH, positive)
    resistance: Measured = measured(u.NUMBER, not_negative)
    surge: Measured = measured(u.NUMBER, numbers(4))
    sway: Measured = measured(u.NUMBER, numbers(6))
    yaw: Measured = measured(u.NUMBER, numbers(6))
    munk: Measured = measured(u.MASS)
    diameter: Measured = measured(u.LENGTH, positive)
    thrust: Measured = measured(u.NUMBER, numbers(3))
    thrust_deduction: Measured = measured(u.NUMBER)
    wake: Measured = measured(u.NUMBER, numbers(4))
    propeller_at: Measured = measured(u.NUMBER)
    revolutions: Measured = measured(u.REVOLUTIONS, positive)
    area: Measured = measured(u.AREA, positive)
    span: Measured = measured(u.LENGTH, positive)
    lift_slope: Measured = measured(u.NUMBER)
    interaction: Measured = measured(u.NUMBER, numbers(3))
    rudder_at: Measured = measured(u.NUMBER, numbers(2))
    inflow: Measured = measured(u.NUMBER, numbers(4))
    limit: Measured = measured(u.ANGLE, positive)
    lag: Measured = measured(u.TIME, not_negative, default=None)
    rate: Measured = measured(u.ANGULAR_VELOCITY, positive, default=None)

    @property
    def command(self) -> Command:
        return Command("rad")

    def force(self, flow: Flow, actual: Array, own: Named) -> Force:
        ahead, across, r = flow.velocity[0], flow.velocity[1], flow.omega[2]
        X, Y, N = planar(ahead, across, r, actual, flow.density, own)
        zero = jnp.zeros(())
        return Force(force=jnp.stack([X, Y, zero]), torque=jnp.stack([zero, zero, N + own.munk * ahead * across]))


def planar(
    ahead: Scalar, across: Scalar, r: Scalar, rudder: Scalar, density: Scalar, own: Named
) -> tuple[Array, Array, Array]:
    """X, Y, N about midships, N and N m, with the Munk moment, of hull, propeller and rudder."""
    square = ahead**2 + across**2
    U = jnp.sqrt(jnp.where(square > 0, square, 1.0))  # at rest the derivatives are finite too
    v, turn = across / U, jnp.where(square > 0, r, 0.0) * own.length / U
    pressure = 0.5 * density * own.length * own.draught * square

    def hull(coefficients: Array, powers: tuple[str, ...]) -> Array:
        terms = (v ** name.count("v") * turn ** name.count("r") for name in powers)
        return pressure * sum(c * term for c, term in zip(coefficients, terms, strict=True))

    drift = jnp.arctan2(-across, jnp.where(square > 0, ahead, 1.0))
    flow = _inflow(ahead, drift, turn, U, own)
    angle = rudder - jnp.arctan2(flow.across, flow.along)
    normal = 0.5 * density * own.area * (flow.along**2 + flow.across**2) * own.lift_slope * jnp.sin(angle)
    lost, gain, at_gain = own.interaction
    aside, n = normal * jnp.cos(rudder), own.revolutions
    X = hull(own.surge, SURGE) - pressure * own.resistance - (1 - lost) * normal * jnp.sin(rudder)
    X = X + (1 - own.thrust_deduction) * density * n**2 * own.diameter**4 * flow.thrust
    lever = own.rudder_at[0] + gain * at_gain
    return X, hull(own.sway, SWAY) - (1 + gain) * aside, own.length * (hull(own.yaw, SWAY) - lever * aside)


def _inflow(ahead: Scalar, drift: Scalar, turn: Scalar, speed: Scalar, own: Named) -> Inflow:
    """The water at propeller and rudder, of u and U of midships, m/s, β and r'."""
    wake, swing, starboard, port = own.wake
    beta = drift - own.propeller_at * turn
    rise = (jnp.where(beta > 0, starboard, port) - 1) * (1 - jnp.exp(-swing * jnp.abs(beta)))
    entering, tip = ahead * (1 - wake) * (1 + rise), own.revolutions * own.diameter
    ratio = entering / tip
    thrust = own.thrust[0] + own.thrust[1] * ratio + own.thrust[2] * ratio**2
    at_rudder, contraction, port_side, starboard_side = own.inflow
    after = jnp.sqrt(jnp.maximum(entering**2 + 8 * thrust * tip**2 / jnp.pi, 1e-12))
    race, share = entering + contraction * (after - entering), own.diameter / own.span
    beta = drift - own.rudder_at[1] * turn
    straight = jnp.where(beta > 0, starboard_side, port_side)
    along = at_rudder * jnp.sqrt(share * race**2 + (1 - share) * entering**2)
    return Inflow(thrust, along, speed * straight * beta)
