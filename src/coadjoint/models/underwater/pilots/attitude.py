"""Attitude control on SO(3) itself: the error of an attitude, and the acceleration that takes it away."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from coadjoint.groups.group import Array


def attitude_of(down: Array, north: Array) -> Array:
    """R, body to space (north, east, down): its rows are the space axes as the body sees them."""
    return jnp.stack([north, jnp.cross(down, north), down])


def level(heading: Any) -> Array:
    """The attitude without roll and pitch at a heading (rad)."""
    c, s, o = jnp.cos(heading), jnp.sin(heading), jnp.zeros(())
    return jnp.stack([jnp.stack([c, -s, o]), jnp.stack([s, c, o]), jnp.array([0.0, 0.0, 1.0])])


def attitude_error(R: Array, wanted: Array) -> Array:
    """e_R = ½(R_dᵀR − RᵀR_d)^∨, rad for small errors; |e_R| = sin of the angle between R and R_d.

    Source: Bullo and Murray (1999); Lee, Leok, McClamroch (2010), (10).
    """
    E = wanted.T @ R
    return 0.5 * jnp.stack([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])


def attitude_distance(R: Array, wanted: Array) -> Array:
    """Ψ = ½ tr(I − R_dᵀR) = 1 − cos of the angle between R and R_d; at constant R_d, Ψ̇ = e_R·ω."""
    return 0.5 * (3.0 - jnp.sum(wanted * R))


def angular_acceleration(gains: Any, R: Array, wanted: Array, omega: Array) -> Array:
    """α = −k_R e_R − k_ω ω, rad/s², towards an attitude R_d at rest. gains: (k_R in 1/s², k_ω in 1/s).

    With ω̇ = α, V = ½|ω|² + k_R Ψ has V̇ = −k_ω|ω|²: from everywhere but a set without volume, attitudes that are half a
    turn away, R goes to R_d. Nothing here has Euler angles, so that pitch ±90° is no special place.
    Source: Lee, Leok, McClamroch (2010), Propositions 1 and 2, per unit of inertia.
    """
    return -gains[0] * attitude_error(R, wanted) - gains[1] * omega
