"""The group SE₂(3) of extended poses (R, v, q), attitude, velocity and place, in closed form.

Sources: A. Barrau, S. Bonnabel, *The invariant extended Kalman filter as a stable observer*, IEEE Trans. Automat.
Control 62 (2017), section IV-B; R. Hartley, M. Ghaffari, R. M. Eustice, J. W. Grizzle, *Contact-aided invariant
extended Kalman filtering for robot state estimation*, Int. J. Robotics Research 39 (2020), appendix A, for the Γ_m.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree
from coadjoint.groups.rotations import skew
from coadjoint.groups.small_angle import cotangent_ratio, cubic_ratio, quartic_ratio, sine_ratio, versine_ratio


class ExtendedPose(NamedTuple):
    """R (3, 3) from body to space, v and q in space, (3,) m/s and m, which act as (x, t) ↦ Rx + tv + q."""

    R: Any
    v: Any
    q: PyTree


def gammas(phi: Array) -> tuple[Array, Array, Array]:
    """Γ_m(φ) = Σ_n φ̂ⁿ/(n + m)! for m = 0, 1, 2, (3, 3) each, of φ (3,): Γ₀ is the rotation.

    Γ₁h and Γ₂h² are the integrals of exp(φ̂s/h) over s once and twice from 0 to h.
    """
    t, hat = phi @ phi, skew(phi)
    square, one = hat @ hat, jnp.eye(3)
    a, b, c, d = sine_ratio(t), versine_ratio(t), cubic_ratio(t), quartic_ratio(t)
    return one + a * hat + b * square, one + b * hat + c * square, 0.5 * one + c * hat + d * square


def exponential(e: Array) -> ExtendedPose:
    """exp of (η, ξ_v, ξ_q) (9,): (Γ₀(η), Γ₁(η)ξ_v, Γ₁(η)ξ_q)."""
    turn, along, _ = gammas(e[:3])
    return ExtendedPose(turn, along @ e[3:6], along @ e[6:9])


def product(x: ExtendedPose, y: ExtendedPose) -> ExtendedPose:
    """xy = (R_x R_y, R_x v_y + v_x, R_x q_y + q_x)."""
    return ExtendedPose(x.R @ y.R, x.R @ y.v + x.v, x.R @ y.q + x.q)


def inverse(x: ExtendedPose) -> ExtendedPose:
    """x⁻¹ = (Rᵀ, −Rᵀv, −Rᵀq)."""
    return ExtendedPose(x.R.T, -(x.R.T @ x.v), -(x.R.T @ x.q))


def logarithm(x: ExtendedPose, eta: Array) -> Array:
    """e = (η, Γ₁(η)⁻¹v, Γ₁(η)⁻¹q), (9,), with exp(e) = x, where exp(η̂) = R, |η| < 2π."""
    hat = skew(eta)
    back = jnp.eye(3) - 0.5 * hat + cotangent_ratio(eta @ eta) * (hat @ hat)
    return jnp.concatenate([eta, back @ x.v, back @ x.q])


def small_turn(R: Array) -> Array:
    """η (3,) of a rotation near 1, to second order."""
    return 0.5 * jnp.stack([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
