"""Whose turn a stepper's memory is: one thread at a time steps, and reading waits for its end."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from weakref import WeakSet

from coadjoint.errors import StepError

BUSY = "Another thread is stepping this stepper: give each thread a clone() of its own."


class Turn:
    """A lock that refuses a second thread that steps or changes, and lets those that only read wait.

    `lock.acquire(False)` and `lock.release()` are the fast way in and out; where it fails, `wait()` decides.
    """

    def __init__(self) -> None:
        self.renew()
        _all.add(self)

    def renew(self) -> None:
        """Nobody has it."""
        self.lock, self._readers = threading.RLock(), set[int]()

    def wait(self) -> None:
        """Have the lock once all have read; raises StepError where another thread is stepping."""
        if not self.lock.acquire(bool(self._readers)):
            raise StepError(BUSY)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """For what changes the memory."""
        lock = self.lock
        if not lock.acquire(False):
            self.wait()
        try:
            yield
        finally:
            lock.release()

    @contextmanager
    def reading(self) -> Iterator[None]:
        """For what only copies the memory: waits for the end of a call in another thread."""
        me = threading.get_ident()
        self._readers.add(me)
        try:
            with self.lock:
                yield
        finally:
            self._readers.discard(me)


_all: WeakSet[Turn] = WeakSet()


def _renew_all() -> None:
    """In a fork, threads that had a lock are gone."""
    for turn in list(_all):
        turn.renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_all)
