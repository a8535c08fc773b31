"""What does not fit in memory is refused before it is tried, with its size."""

from __future__ import annotations

import os

from coadjoint.errors import ArgumentError

ARRAYS = 60
"""Arrays of N² numbers that a step holds at once, measured at N = 64 with the adjoint of one step."""


def installed() -> float:
    """The memory of this machine, bytes; infinite where the system does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return float("inf")


def require_room(what: str, size: int, needed: float, power: int) -> None:
    """Raise ArgumentError where what is done at N = `size` needs more bytes than there are; it grows as N^power."""
    there = installed()
    if needed > there:
        raise ArgumentError(
            f"{what} at N = {size} would take {needed / 1e9:.3g} GB of memory, and this machine has {there / 1e9:.3g}: "
            f"take N up to {int(size * (there / needed) ** (1 / power))}."
        )
