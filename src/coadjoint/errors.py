"""One way to fail: a typed error whose sentence says what was given, what is expected and how to mend it."""

from __future__ import annotations

from typing import Any


class CoadjointError(Exception):
    """Base of every error that the library raises on purpose."""


class ArgumentError(CoadjointError, ValueError):
    """An argument is not what the call needs."""


class LagrangianError(CoadjointError, ValueError):
    """A Lagrangian, or another function that the user wrote, cannot be used."""


class GroupError(CoadjointError, ValueError):
    """A group, a space and a difference map do not fit together."""


class FileError(CoadjointError, OSError):
    """A file or folder cannot be read or written as asked."""


class StepError(CoadjointError, ArithmeticError):
    """A step failed: `sentence` says where and why; what had been computed until then is kept in `run`."""

    def __init__(self, sentence: str, run: Any = None):
        kept = "" if run is None else " What was computed until then is kept in `.run`."
        super().__init__(sentence + kept)
        self.sentence = sentence
        self.run = run
