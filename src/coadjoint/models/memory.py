"""Errors for sizes N of models that do not fit in memory; they name the largest that does."""

from __future__ import annotations

from coadjoint import memory

ARRAYS = 60
"""Arrays of N² numbers that a step holds together, measured at N = 64 with the adjoint of one step."""


def require_room_at(what: str, size: int, needed: float, power: int) -> None:
    """Raise ArgumentError where a computation at N = `size` needs more memory than available; it grows as N^power."""
    fits = memory.most_that_fit(size, needed, power)
    memory.require_room(f"{what} at N = {size}", needed, f"take N up to {fits}")
