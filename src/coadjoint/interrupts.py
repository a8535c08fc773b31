"""Interrupts that Python would lose, such as Ctrl-C in the garbage collector's callbacks.

KeyboardInterrupt has nowhere to go in a callback of the collector (JAX has one), in `__del__`, or in a function that C
calls: Python writes "Exception ignored in …" and continues, and other libraries may drop it silently. A long call of
the library remembers that an interrupt came, and raises it at its next check. To do so it replaces Python's own handler
of SIGINT, and `sys.unraisablehook`, until it returns.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from coadjoint.arrays import PyTree

_came: list[int] = []


class _Hook:
    """The hook that Python calls with an exception that it ignores."""

    def __init__(self, before: PyTree) -> None:
        self.before = before

    def __call__(self, unraisable: Any) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt) and _in_main_thread():
            note()
        else:
            self.before(unraisable)


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """Inside this context, `look` raises an interrupt that was lost; so does its end. It also decorates functions.

    In other threads than the main one, which are not interrupted, and inside of another such call it does nothing. A
    handler of SIGINT that is not Python's own stays.
    """
    if not _in_main_thread() or isinstance(sys.unraisablehook, _Hook):
        yield
        return
    hook = _Hook(sys.unraisablehook)
    try:
        sys.unraisablehook = hook
        forget()
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, _handle)
        yield
        look()
    finally:
        if signal.getsignal(signal.SIGINT) is _handle:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        if sys.unraisablehook is hook:
            sys.unraisablehook = hook.before
        forget()


def note() -> None:
    """Note that an interrupt has come, even if it gets lost."""
    _came.append(1)


def look() -> None:
    """Raise KeyboardInterrupt if one came since the last look: the call is still running, so it was lost."""
    if _came and _in_main_thread():
        forget()
        raise KeyboardInterrupt


def forget() -> None:
    """Note that an interrupt has ended the call: it is not raised again."""
    _came.clear()


def _handle(number: int, frame: FrameType | None) -> None:
    note()
    raise KeyboardInterrupt


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
