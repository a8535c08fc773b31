"""Checks of memory before large computations; their errors give the size."""

from __future__ import annotations

import os

from coadjoint.errors import ArgumentError


def installed() -> float:
    """The memory of this machine, bytes; infinite if the system does not report it."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return float("inf")


def require_room(what: str, needed: float, remedy: str, most: float | None = None) -> None:
    """Raise ArgumentError where something needs more bytes than this machine has, or than `most`."""
    there = installed() if most is None else most
    if not needed <= there:
        limit = "this machine has" if most is None else "may take at most"
        raise ArgumentError(
            f"{what} would take {needed / 1e9:.3g} GB of memory, and {limit} {there / 1e9:.3g} GB: {remedy}."
        )


def most_that_fit(count: int, needed: float, power: int) -> int:
    """How many of `count` things fit where all take `needed` bytes, which grow as count^power."""
    return int(count * min(installed() / needed, 1.0) ** (1 / power)) if needed > 0 else count
