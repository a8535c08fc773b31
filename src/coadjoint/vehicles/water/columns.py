"""Numbers from the columns of a CSV file, with the file, the line and the column of whatever is wrong."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError

UNITS = {"time": "s", "depth": "m", "north": "m/s", "east": "m/s", "down": "m/s", "density": "kg/m³"}
DOWN = "z points down, so that depths below the surface are positive"


class Columns(NamedTuple):
    """A file's numbers by column, and the line of each row."""

    path: str
    lines: list[int]
    values: dict[str, np.ndarray]

    def refuse(self, row: int, column: str, why: str) -> ArgumentError:
        """What to raise for a value."""
        return ArgumentError(f"File {self.path}, line {self.lines[row]}, column `{column}`: {why}")


def read(path: Any, required: Sequence[str], optional: Sequence[str] = ()) -> Columns:
    """The numbers of a CSV file whose first line names its columns; empty lines and lines with # first are left out.

    Raises ArgumentError for a file that cannot be read, columns that are missing, unknown or there twice, rows of
    another length, and what is no finite number.
    """
    name = str(path)
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, TypeError) as error:
        raise ArgumentError(f"File {name} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    rows = [
        (number, [cell.strip() for cell in row])
        for number, row in enumerate(csv.reader(text.splitlines()), start=1)
        if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
    ]
    if len(rows) < 2:
        raise ArgumentError(f"File {name} must have a line of column names and at least one line of numbers.")
    (first, header), *body = rows
    wanted = f"the columns are {', '.join(required)}" + (f" and, optionally, {', '.join(optional)}" if optional else "")
    _require_commas(name, first, header)
    for column in header:
        _require_bare(name, first, column, (*required, *optional), wanted)
    for column in required:
        if column not in header:
            raise ArgumentError(f"File {name}, line {first}: column `{column}` is missing; {wanted}.")
    for column in header:
        if column not in (*required, *optional):
            raise ArgumentError(f"File {name}, line {first}: column `{column}` is not known; {wanted}.")
        if header.count(column) > 1:
            raise ArgumentError(f"File {name}, line {first}: column `{column}` is there twice.")
    for line, row in body:
        if len(row) != len(header):
            raise ArgumentError(f"File {name}, line {line}: there are {len(row)} values for {len(header)} columns.")
    values = {
        column: np.array([_number(name, line, column, row[place]) for line, row in body])
        for place, column in enumerate(header)
    }
    return Columns(name, [line for line, _ in body], values)


def _require_commas(name: str, line: int, header: list[str]) -> None:
    for mark, what in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and mark in header[0]:
            raise ArgumentError(
                f"File {name}, line {line}: columns must be separated by commas, with a point in numbers, but these "
                f"are separated by {what}."
            )


def _require_bare(name: str, line: int, column: str, known: Sequence[str], wanted: str) -> None:
    """Raise for a column such as `time (min)` or `Depth [m]`: units are fixed, and names are bare."""
    bare = re.split(r"[^a-z]", column.lower(), maxsplit=1)[0]
    if column not in known and bare in known:
        raise ArgumentError(
            f"File {name}, line {line}: column `{column}` must be called `{bare}` and be in {UNITS[bare]}; {wanted}."
        )


def _number(name: str, line: int, column: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError as error:
        what = f"{cell!r} is no number" if cell else "there is no number"
        raise ArgumentError(f"File {name}, line {line}, column `{column}`: {what}.") from error
    if not np.isfinite(value):
        raise ArgumentError(f"File {name}, line {line}, column `{column}`: {cell} is not a finite number.")
    return value
