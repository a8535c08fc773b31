"""A digital PID controller whose integral does not wind up."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree


def asked(
    gains: PyTree,
    error: Array,
    rate: Array,
    integral: Array,
    period: Any,
    limit: Any,
    *,
    base: Any = 0.0,
    low: Any = None,
) -> tuple[Array, Array]:
    """(u, I) with u = u₀ + k_p e + k_i I − k_d ė_m, not clipped to [low, limit], and I ← I + T e unless that winds up.

    gains: (k_p, k_i, k_d). rate: of the measured value, so that a step of the set point does not kick. period: T, s.
    base: u₀, the feed-forward part. low: −limit by default.
    The integral stops where u is beyond its limits and e drives it further out (conditional integration; Åström and
    Hägglund 2006, 3.5).
    """
    low = -limit if low is None else low
    free = base + gains[0] * error + gains[1] * integral - gains[2] * rate
    outwards = jnp.where(free > limit, 1.0, jnp.where(free < low, -1.0, 0.0))
    following = jnp.where(outwards * error * gains[1] > 0, integral, integral + period * error)
    return base + gains[0] * error + gains[1] * following - gains[2] * rate, following


def pid(*given: Any, base: Any = 0.0, low: Any = None) -> tuple[Array, Array]:
    """(clip(u, low, limit), I) with (u, I) of `asked` for the same arguments."""
    found, following = asked(*given, base=base, low=low)
    return jnp.clip(found, -given[5] if low is None else low, given[5]), following


def nearest_turn(angle: Array) -> Array:
    """The angle in (−π, π]."""
    return jnp.arctan2(jnp.sin(angle), jnp.cos(angle))


def pull(feedback: Any, integral: Array, own: PyTree) -> tuple[Array, Array]:
    """The command of the propulsion for the set point `speed`, ahead only, and the integral of its error."""
    wanted = feedback.inputs.speed
    return pid(
        own.speed_gains, wanted - feedback.velocity[0], jnp.zeros(()), integral, own.period, own.thrust_limit,
        base=own.feed_forward * wanted, low=0.0,
    )  # fmt: skip
