"""Long calls of machine code in pieces, between which Python handles signals; the cuts change no number."""

from __future__ import annotations

import time

from coadjoint.interrupts import look

PIECE = 0.1
"""The intended duration of a piece, s."""

FIRST, GROWTH = 16, 8
"""The steps of the first piece, and the largest growth from one piece to the next."""


class PieceLength:
    """The number of steps of a piece, from the times of earlier pieces."""

    def __init__(self) -> None:
        self.steps = FIRST

    def took(self, steps: int, seconds: float) -> None:
        """Note the duration of a piece of so many steps."""
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
    """An interrupt between two pieces; `result` is that of the pieces before it."""

    def __init__(self, result: object) -> None:
        super().__init__()
        self.result = result
