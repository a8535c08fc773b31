"""Libraries that only logs of robots need: the extra `[logs]`."""

from __future__ import annotations

from typing import Any

from coadjoint import checks


def library(name: str, what: str) -> Any:
    """A module of the extra `[logs]`, for `what`; raises ArgumentError with the command that installs it."""
    return checks.library(name, f"{what} needs", "coadjoint-vehicles[logs]")
