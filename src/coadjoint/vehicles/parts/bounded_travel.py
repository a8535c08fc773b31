"""Actuators that travel between two ends at a bounded rate: masses on a line, volumes of a bladder."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Array
from coadjoint.vehicles.parts.part import Part, share_of_lag


def followed(actual: Array, command: Array, h: Array, own: Any) -> Array:
    """The change over h towards a command: clip((1 − exp(−h/τ))(clip(command, low, high) − x), ±rate·h)."""
    change = jnp.clip(command, own.low, own.high) - actual
    if "lag" in own:
        change = share_of_lag(h, own.lag) * change
    return jnp.clip(change, -own.rate * h, own.rate * h)


def require_range(part: Part) -> None:
    """Raise ArgumentError unless `low` is below `high`."""
    low, high = (getattr(part, end) for end in ("low", "high"))
    if low >= high:
        raise ArgumentError(
            f"Argument `low` of the {part.title}` must be below `high`, but low is {low:g} and high {high:g}."
        )
