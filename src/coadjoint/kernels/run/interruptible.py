"""Long calls of machine code in pieces, between which Python sees signals: where they are cut changes no number."""

from __future__ import annotations

import time

from coadjoint.interrupts import look

PIECE = 0.1
"""Seconds that a piece is to last."""

FIRST, GROWTH = 16, 8
"""Steps of the first piece, and by how much the next one may be longer."""


class PieceLength:
    """How many steps a piece takes, by what pieces took before."""

    def __init__(self) -> None:
        self.steps = FIRST

    def took(self, steps: int, seconds: float) -> None:
        """A piece of so many steps took so long."""
        wished = steps * PIECE / max(seconds, 1e-9)
        self.steps = int(min(max(wished, 1.0), GROWTH * max(self.steps, steps)))


class Clock:
    """Times the pieces of one call."""

    def __init__(self, pace: PieceLength) -> None:
        self.pace, self._began = pace, time.perf_counter()

    def lap(self, steps: int) -> None:
        """A piece of so many steps ends here, and another one begins; raises an interrupt that was ignored."""
        look()
        now = time.perf_counter()
        self.pace.took(steps, now - self._began)
        self._began = now


class Cut(KeyboardInterrupt):
    """An interrupt between two pieces; `result` is what the pieces before it have computed."""

    def __init__(self, result: object) -> None:
        super().__init__()
        self.result = result
