"""Actuators that travel between two ends at a bounded rate: masses on a line, volumes of a bladder."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Array
from coadjoint.models.quantities import number
from coadjoint.vehicles.parts.part import share_of_lag


def followed(actual: Array, command: Array, h: Array, own: Any) -> Array:
    """The change over h towards a command: clip((1 − exp(−h/τ))(clip(command, low, high) − x), ±rate·h)."""
    change = jnp.clip(command, own.low, own.high) - actual
    if "lag" in own:
        change = share_of_lag(h, own.lag) * change
    return jnp.clip(change, -own.rate * h, own.rate * h)


def between(low: Any, high: Any, of: str) -> dict[str, Any]:
    """The checked ends of a range; raises ArgumentError."""
    low, high = number(low, "low" + of), number(high, "high" + of)
    if low >= high:
        raise ArgumentError(f"Argument `low{of}` must be below `high`, but low is {low:g} and high {high:g}.")
    return {"low": low, "high": high}


def lag_of(lag: Any, of: str) -> Any:
    """The checked lag, None where there is none; raises ArgumentError for a negative one."""
    if lag is None:
        return None
    found = number(lag, "lag" + of, at_least=0.0)
    return found if found > 0 else None
