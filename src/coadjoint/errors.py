"""The errors of the library: each is typed and states in one sentence the value, the expectation and the remedy."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

__all__ = [
    "ArgumentError",
    "CoadjointError",
    "FileError",
    "GroupError",
    "Interrupted",
    "LagrangianError",
    "OptimumError",
    "StepError",
]
"""What users catch."""

_ENDLESS = re.compile(r"[^\s/\\]{300,}|[^\S\n]{300,}")
"""A word that cannot be a file or a name, or as many blanks; a sentence shows its beginning."""

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters but tab and newline, marks of direction, separators of lines, and halves of surrogate pairs."""

LONGEST = 80
"""The largest length of a value in a message."""


def shown(value: object) -> str:
    """A value in one short line, for a sentence; its kind if it has no short form."""
    try:
        words = " ".join(repr(value).split())
    except Exception:
        return f"an object of {type(value).__name__}"
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 1]}…"


def error_line(error: BaseException) -> str:
    """An error of another library in one short line: its kind and the first line of its message."""
    try:
        first = next(iter(str(error).strip().splitlines()), "").rstrip(".")
    except Exception:
        first = ""
    return f"{type(error).__name__}: {first[: 2 * LONGEST]}" if first else type(error).__name__


def printable(text: str) -> str:
    """A text that a terminal shows and does not obey: control characters become escapes, such as \\u001b.

    Such an escape means the same character in JSON and in the texts of TOML.
    """
    return _CONTROL.sub(lambda found: f"\\u{ord(found.group()):04x}", text)


def warn(sentence: str, stacklevel: int = 1, category: type[Warning] = UserWarning) -> None:
    """Warn of what the user did and can change, as `warnings.warn` does; control characters become escapes."""
    warnings.warn(printable(sentence), category, stacklevel=stacklevel + 1)


def nearest(name: object, known: Iterable[str], cutoff: float = 0.6) -> str:
    """The known name that is most similar to another one, "" where the similarity of all, 0 to 1, is below `cutoff`."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(str(name), list(known), 1, cutoff)), "")


class CoadjointError(Exception):
    """Base of every error that the library raises on purpose."""

    def __str__(self) -> str:
        return printable(_ENDLESS.sub(lambda word: f"{word.group()[:LONGEST]}…", super().__str__()))


class ArgumentError(CoadjointError, ValueError):
    """An argument does not fit the call."""


class LagrangianError(CoadjointError, ValueError):
    """A Lagrangian, or another function that the user wrote, cannot be used."""


class GroupError(CoadjointError, ValueError):
    """A group, a space and a difference map do not fit together, or one of them contradicts itself."""


def must_give(owner: object, member: str) -> NoReturn:
    """Raise GroupError for a member that a class leaves out and its base class does not have by itself."""
    raise GroupError(f"{type(owner).__name__} must give `{member}`, which its base class does not have by itself.")


class FileError(CoadjointError, OSError):
    """A file or folder cannot be read or written."""


@contextmanager
def rephrased(
    what: str, *caught: type[BaseException], then: str = "", kind: type[CoadjointError] = FileError
) -> Iterator[None]:
    """A block in which errors of other libraries, by default OSError, become one sentence: "what: reason; then.".

    The library's own errors pass. kind: the type of the error.
    """
    found = caught or (OSError,)
    try:
        yield
    except CoadjointError:
        raise
    except found as error:
        of_system = isinstance(error, OSError) and (error.strerror or next(iter(str(error).splitlines()), ""))
        reason = of_system or error_line(error)
        raise kind(f"{what}: {reason}{'; ' * bool(then)}{then}.") from error


@contextmanager
def prefixed(where: str, kind: type[CoadjointError] = FileError) -> Iterator[None]:
    """A block whose errors of arguments become errors of a file, "where: sentence", or of another kind."""
    try:
        yield
    except ArgumentError as error:
        raise kind(f"{where}: {error}") from error


class StepError(CoadjointError, ArithmeticError):
    """A step failed: `sentence` says where and why; `run` holds the results until then."""

    def __init__(self, sentence: str, run: Any = None):
        kept = "" if run is None else " The results until then are kept in `.run`."
        super().__init__(sentence + kept)
        self.sentence = sentence
        self.run = run


class OptimumError(CoadjointError, ArithmeticError):
    """No optimal motion was found: the sentence says why, and which constraint resists most."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, or another interrupt, came during a computation: `run` holds the results until then.

    sentence: the event, and how to continue. run: a `Run`, an `Ensemble` or a `Trajectory` of the steps that were
    done.
    A KeyboardInterrupt, so that `except Exception` does not catch it.
    """

    def __init__(self, sentence: str, run: Any = None):
        super().__init__(sentence)
        self.sentence = sentence
        self.run = run

    def __str__(self) -> str:
        return printable(super().__str__())
