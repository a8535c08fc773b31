"""Processes that are killed at one of their operations on the disk."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from coadjoint import disk

Operation = tuple[str, str]


def kind(operation: str, path: Path) -> Operation:
    """An operation with what it is about, all chunks being one."""
    name = path.name.strip(".")
    return operation, "chunk" if name.startswith("c.") else name if "." in name or name == "lock" else "folder"


def recorded(monkeypatch: pytest.MonkeyPatch, run: Callable[[], object]) -> list[Operation]:
    """The operations of a run that nobody kills."""
    found: list[Operation] = []
    with monkeypatch.context() as patched:
        patched.setattr(disk, "before", lambda operation, path: found.append(kind(operation, path)))
        run()
    return found


def places(operations: list[Operation]) -> list[int]:
    """The index of the first and of the last operation of every kind."""
    first = {operation: index for index, operation in reversed(list(enumerate(operations)))}
    last = {operation: index for index, operation in enumerate(operations)}
    return sorted({*first.values(), *last.values()})


def killed_before(index: int, run: Callable[[], object]) -> bool:
    """Whether a process of its own, in which `run` begins, was killed before its operation `index`."""
    child = os.fork()
    if child == 0:
        left = iter(range(index))

        def before(operation: str, path: Path) -> None:
            if next(left, None) is None:
                os.kill(os.getpid(), signal.SIGKILL)

        disk.before = before
        try:
            run()
        finally:
            os._exit(0)
    _, status = os.waitpid(child, 0)
    assert status in (0, signal.SIGKILL)
    return status == signal.SIGKILL
