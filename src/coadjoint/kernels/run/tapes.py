"""Tapes of runs whose pullbacks may follow: what their adjoints need of every step.

A tape is found by the numbers that its run began with, so that a pullback gives the same without one. Those that were
pulled already are the first to be replaced, and memory of the same shape is used again.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Hashable

import numpy as np

ROOM = 2**25
"""Bytes of all tapes that are kept."""


class Tapes:
    """Rows by keys, those first that are the first to go."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Hashable, np.ndarray] = OrderedDict()
        self._pulled: set[Hashable] = set()
        self._lock = threading.Lock()

    def keep(self, key: Hashable, rows: np.ndarray, pulled: bool = False) -> None:
        """Keep a tape, in the place of those that exceed ROOM with it."""
        with self._lock:
            self._kept[key] = rows
            self._kept.move_to_end(key, last=not pulled)
            (self._pulled.add if pulled else self._pulled.discard)(key)
            while sum(kept.nbytes for kept in self._kept.values()) > ROOM:
                self._drop()

    def taken(self, key: Hashable) -> np.ndarray | None:
        """The tape of a run, which is nobody else's until it is kept again."""
        with self._lock:
            self._pulled.discard(key)
            return self._kept.pop(key, None)

    def room(self, shape: tuple[int, int]) -> np.ndarray:
        """Memory for a tape: that of one which was pulled, if it has this shape."""
        with self._lock:
            first = next(iter(self._kept), None)
            if first in self._pulled and self._kept[first].shape == shape:
                return self._drop()
        return np.empty(shape)

    def _drop(self) -> np.ndarray:
        key, rows = self._kept.popitem(last=False)
        self._pulled.discard(key)
        return rows
