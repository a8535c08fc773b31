"""Interrupts that are lost where they come, such as Ctrl-C in the garbage collector's callbacks.

KeyboardInterrupt has nowhere to go in a callback of the collector (JAX has one), in `__del__`, or in a function that C
calls: Python writes "Exception ignored in …" and goes on, and other libraries may drop it without a word. A call of the
library that lasts remembers that an interrupt came, and raises it where it next looks. For this it replaces Python's
own handler of SIGINT, and `sys.unraisablehook`, for as long as it lasts.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_came: list[int] = []


class _Hook:
    """What Python calls with an exception that it ignores."""

    def __init__(self, before: Any) -> None:
        self.before = before

    def __call__(self, unraisable: Any) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt) and _in_main_thread():
            note()
        else:
            self.before(unraisable)


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """While this lasts, `look` raises an interrupt that was lost; so does its end. It decorates functions, too.

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
    """An interrupt has come, whatever becomes of it."""
    _came.append(1)


def look() -> None:
    """Raise KeyboardInterrupt if one came since the last look: the call goes on, so it was lost."""
    if _came and _in_main_thread():
        forget()
        raise KeyboardInterrupt


def forget() -> None:
    """An interrupt has arrived where it ends what was done: nothing is to be raised again."""
    _came.clear()


def _handle(number: int, frame: FrameType | None) -> None:
    note()
    raise KeyboardInterrupt


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
