"""Libraries that only logs of robots need: the extra `[logs]`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from coadjoint.errors import ArgumentError


def library(name: str, what: str) -> Any:
    """A module of the extra `[logs]`, for `what`; raises ArgumentError with the command that installs it."""
    try:
        return import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        raise ArgumentError(
            f'{what} needs {package}, which is not installed: pip install "coadjoint-vehicles[logs]".'
        ) from error
