"""Texts of files, read within limits, and their TOML tables, with an error for anything else."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, TypeAlias

from coadjoint.errors import FileError, rephrased

LARGEST, DEEPEST = 1_000_000, 64
"""The most bytes of a text, and the most tables and lists within each other."""
LARGEST_SUMMARY = 64_000_000
"""The most bytes of the summary of a run or of a sweep."""

Table: TypeAlias = dict[str, Any]
"""The contents of a TOML or JSON file, or of one of its sections: texts, numbers, lists and tables, by their keys."""

_KEYS = re.compile(r"[\w.\-\"' \t]+")
"""A possible dotted key. Python looks up each of its prefixes, so that long ones take forever."""


def text_of(source: Path, most: int = LARGEST) -> str:
    """The text in a file; raises FileError for a larger one, UnicodeDecodeError and OSError as reading does."""
    with source.open("rb") as opened:
        content = opened.read(most + 1)
    if len(content) > most:
        raise too_large(source, most)
    return content.decode("utf-8-sig")


def file_text(path: Path, what: str = "file", most: int = LARGEST) -> str:
    """The text in a file, as `text_of`; raises FileError alone, with `what` the file is in the sentence."""
    with rephrased(f"The {what} {path} cannot be read"):
        try:
            return text_of(path, most)
        except FileNotFoundError as error:
            raise FileError(f"There is no {what} {path}.") from error
        except UnicodeDecodeError as error:
            raise FileError(f"The file {path} is not a text in UTF-8.") from error
        except ValueError as error:
            raise FileError(f"There is no {what} {path}: a file name cannot hold a NUL.") from error


def too_large(name: object, most: int) -> FileError:
    """The error for a text of more than `most` bytes."""
    return FileError(
        f"The file {name} is larger than the {most / 1e6:.0f} MB up to which such files are read: put long rows of "
        "numbers of a TOML file into a CSV file, and thin out long logs."
    )


def read_table(text: str, name: object) -> Table:
    """The table in a text; `name` is that of the file in sentences.

    Raises FileError unless it is TOML, and if it is too large, is nested too deeply or has too long a number.
    """
    if len(text) > LARGEST:
        raise too_large(name, LARGEST)
    if any(run.group().count(".") > DEEPEST for run in _KEYS.finditer(text)):
        raise _too_deep(name)
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        said = str(error)
        raise FileError(f"The file {name} is not valid TOML: {said[:1].lower()}{said[1:]}.") from error
    except ValueError as error:  # raised by Python for integers of thousands of digits
        raise too_long(name) from error
    except RecursionError as error:
        raise _too_deep(name) from error
    _require_shallow(table, name)
    return table


def _require_shallow(table: dict[str, object], name: object) -> None:
    """Raise FileError for tables nested too deeply."""
    level: list[object] = [table]
    for _ in range(DEEPEST):
        inner: list[Any] = []
        for value in level:
            inner += value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
        if not inner:
            return
        level = inner
    raise _too_deep(name)


def _too_deep(name: object) -> FileError:
    return FileError(f"The file {name} is nested too deeply: it has more than {DEEPEST} tables within each other.")


def too_long(name: object) -> FileError:
    """The error for a number of hundreds of digits."""
    return FileError(f"The file {name} holds a number that is too long to be read.")
