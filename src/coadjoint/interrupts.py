"""Interrupts that Python must ignore where they come, such as Ctrl-C in the garbage collector's callbacks.

An exception has nowhere to go in a callback of the collector (JAX has one), in `__del__`, or in a function that C
calls: Python writes "Exception ignored in …" and goes on. A call of the library that lasts remembers such an interrupt,
and raises it where it next looks. It handles no signals for this: it takes the place of `sys.unraisablehook` meanwhile.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_ignored: list[type[BaseException]] = []


class _Hook:
    """What Python calls with an exception that it ignores."""

    def __init__(self, before: Any) -> None:
        self.before = before

    def __call__(self, unraisable: Any) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt) and _in_main_thread():
            _ignored.append(unraisable.exc_type)
        else:
            self.before(unraisable)


@contextmanager
def heeded() -> Iterator[None]:
    """While this lasts, `look` raises an interrupt that Python has ignored; so does its end. Decorates functions, too.

    In other threads than the main one, which are not interrupted, and inside of another such call it does nothing.
    """
    if not _in_main_thread() or isinstance(sys.unraisablehook, _Hook):
        yield
        return
    hook = _Hook(sys.unraisablehook)
    sys.unraisablehook = hook
    try:
        yield
        look()
    finally:
        if sys.unraisablehook is hook:
            sys.unraisablehook = hook.before
        _ignored.clear()


def look() -> None:
    """Raise KeyboardInterrupt if one has been ignored since the last look."""
    if _ignored and _in_main_thread():
        _ignored.clear()
        raise KeyboardInterrupt


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
