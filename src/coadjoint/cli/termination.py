"""Termination of the command line from outside: SIGTERM acts as Ctrl-C."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ExtensionFileLoader
from types import FrameType

from coadjoint.interrupts import note

_came: list[int] = []

_LOADING = {load.__code__ for load in (ExtensionFileLoader.create_module, ExtensionFileLoader.exec_module)}

AGAIN = 0.02
"""Seconds after which a signal that came at a bad moment is repeated."""


@contextmanager
def stoppable() -> Iterator[list[int]]:
    """Inside this context SIGTERM and Ctrl-C raise KeyboardInterrupt; the list holds the signals that came.

    Callers in other threads, and existing handlers of a signal, are left unchanged.
    """
    if threading.current_thread() is not threading.main_thread():
        yield []
        return
    usual = {signal.SIGTERM: signal.SIG_DFL, signal.SIGINT: signal.default_int_handler}
    taken = {number: handler for number, handler in usual.items() if signal.getsignal(number) is handler}
    for number in taken:
        signal.signal(number, _stop)
    try:
        yield _came
    finally:
        for number, handler in taken.items():
            signal.signal(number, handler)
        if taken:
            _came.clear()


def _stop(number: int, frame: FrameType | None) -> None:
    if _loads_extension(frame):
        timer = threading.Timer(AGAIN, _again, [number])
        timer.daemon = True
        timer.start()
        return
    _came.append(number)
    note()
    raise KeyboardInterrupt


def _again(number: int) -> None:
    if signal.getsignal(number) is _stop:
        signal.raise_signal(number)


def _loads_extension(frame: FrameType | None) -> bool:
    """Whether an extension module in C is being loaded, which may end the process where Python raises meanwhile."""
    while frame is not None:
        if frame.f_code in _LOADING:
            return True
        frame = frame.f_back
    return False


def status(came: list[int]) -> int:
    """The exit status of a command that signals have ended, as shells have it."""
    return 128 + (came[-1] if came else signal.SIGINT)


def word(came: list[int]) -> str:
    """The status in words."""
    return "Terminated" if signal.SIGTERM in came else "Interrupted"
