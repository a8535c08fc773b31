"""Addresses of schedulers: their syntax, and whether a scheduler listens there."""

from __future__ import annotations

import socket
import time
from urllib.parse import SplitResult, urlsplit

from coadjoint import checks
from coadjoint.errors import FileError, warn

PROTOCOLS = ("tcp", "tls", "ws", "wss")
"""Those at whose ports a scheduler listens."""
INSIDE = "inproc"
"""The kind of a scheduler in this process, whose address has no port."""
LOOK = 0.2
"""Seconds between two attempts to reach a scheduler."""
ANSWER = 10.0
"""Seconds that an attempt may take."""


def require_address(scheduler: str) -> None:
    """Raise ArgumentError unless it is the address of a scheduler."""
    try:
        found = _split(scheduler)
        fits = bool(found.netloc) and (found.scheme == INSIDE or (found.scheme in PROTOCOLS and bool(found.port)))
    except (ValueError, TypeError):
        fits = False
    checks.expect(fits, scheduler, "The address of a scheduler", "like tcp://HOST:8786")


def require_answer(scheduler: str, patience: float) -> None:
    """Wait so many seconds for a scheduler that does not answer, with a warning; raises FileError after them."""
    began, warned = time.monotonic(), False
    while not _listens(_split(scheduler)):
        if time.monotonic() - began >= patience:
            raise FileError(
                f"The scheduler {scheduler} does not answer; it was waited for, {patience:.0f} s. Start one by "
                "`dask scheduler`, and give the address that it prints."
            )
        if not warned:
            sentence = f"The scheduler {scheduler} does not answer; it is waited for, up to {patience:.0f} s."
            warn(sentence, stacklevel=2)
        warned = True
        time.sleep(LOOK)


def _split(scheduler: str) -> SplitResult:
    return urlsplit(scheduler if "://" in scheduler else f"tcp://{scheduler}")


def _listens(address: SplitResult) -> bool:
    if address.scheme == INSIDE:
        return True
    try:
        with socket.create_connection((address.hostname or "", address.port or 0), timeout=ANSWER):
            return True
    except (OSError, UnicodeError):
        return False
