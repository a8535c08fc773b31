"""A digital PID controller whose integral does not wind up."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from coadjoint.groups.group import Array


def pid(gains: Any, error: Array, rate: Array, integral: Array, period: Any, limit: Any) -> tuple[Array, Array]:
    """(u, I) with u = clip(k_p e + k_i I − k_d ė_m, ±limit) and I ← I + T e unless that winds up.

    gains: (k_p, k_i, k_d). rate: that of what is measured, so that a step of the set point does not kick. period: T, s.
    The integral stops where u is beyond its limit and e drives it further out (conditional integration; Åström and
    Hägglund 2006, 3.5).
    """
    free = gains[0] * error + gains[1] * integral - gains[2] * rate
    winds_up = (jnp.abs(free) > limit) & (free * error * gains[1] > 0)
    following = jnp.where(winds_up, integral, integral + period * error)
    return jnp.clip(gains[0] * error + gains[1] * following - gains[2] * rate, -limit, limit), following


def nearest_turn(angle: Array) -> Array:
    """The angle in (−π, π]."""
    return jnp.arctan2(jnp.sin(angle), jnp.cos(angle))
