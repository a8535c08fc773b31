"""Tables of comma-separated values: read with the place of every mistake, and written."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from coadjoint.errors import FileError
from coadjoint.texts import file_text

LARGEST, MOST_LINES, MOST_CELLS = 128_000_000, 4_000_000, 20_000_000
"""The most bytes, lines and cells of a table."""
_ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"


class Sheet(NamedTuple):
    """The cells of a file below a line of column names; lines that are empty or begin with # are left out.

    line: of the column names. lines: of each row. comments: the lines that begin with #.
    """

    path: str
    line: int
    names: list[str]
    lines: list[int]
    rows: list[list[str]]
    comments: list[str]

    def refuse(self, row: int, column: int, why: str) -> FileError:
        """The error for a cell."""
        return FileError(f"{self.path}, line {self.lines[row]}, column `{self.names[column]}`: {why}")

    def numbers(self, column: int, missing: Collection[str] = ()) -> np.ndarray:
        """The numbers of a column, (rows,); NaN where the cell is one of `missing`, in lower case.

        Raises FileError unless each is a finite number.
        """
        found = np.full(len(self.rows), np.nan)
        for row, cells in enumerate(self.rows):
            if cells[column].lower() in missing:
                continue
            try:
                found[row] = float(cells[column])
            except ValueError:
                what = f"{cells[column]!r} is not a number" if cells[column] else "a number is missing"
                raise self.refuse(row, column, f"{what}.") from None
            if not np.isfinite(found[row]):
                remedy = ": leave the cell empty where nothing was measured" if missing else ""
                raise self.refuse(row, column, f"{cells[column]!r} is not a finite number{remedy}.")
        return found


def read_sheet(path: str | os.PathLike[str]) -> Sheet:
    """The table in a file: a line of column names, then rows of as many cells, divided by commas, semicolons or tabs.

    Raises FileError for a file that cannot be read or has no rows, for a column without a name and for two of one name,
    and for a row of another length.
    """
    text = file_text(Path(path), most=LARGEST)
    _require_small(path, text)
    lines = list(enumerate(text.splitlines(), 1))
    kept = [(n, line) for n, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if len(kept) < 2:
        raise FileError(f"The file {path} must have a line of column names and at least one line of numbers.")
    mark = max((",", ";", "\t"), key=kept[0][1].count)
    try:
        cells = [[cell.strip() for cell in next(csv.reader([line], delimiter=mark))] for _, line in kept]
    except csv.Error as error:
        raise FileError(f"The file {path} is not a table of comma-separated values: {error}.") from error
    (first, _), *rest = kept
    names, *rows = cells
    _require_names(f"{path}, line {first}", names)
    for (line, _), row in zip(rest, rows, strict=True):
        if len(row) != len(names):
            raise FileError(f"{path}, line {line}: there are {len(row)} cells for {len(names)} columns.")
    comments = [line for _, line in lines if line.lstrip().startswith("#")]
    return Sheet(str(path), first, names, [line for line, _ in rest], rows, comments)


def _require_small(path: str | os.PathLike[str], text: str) -> None:
    """Raise FileError for a text that would become more lines and cells than fit in memory."""
    lines = sum(text.count(end) for end in _ENDS)
    cells = max(text.count(mark) for mark in ",;\t") + lines
    for found, most, what in ((lines, MOST_LINES, "lines"), (cells, MOST_CELLS, "cells")):
        if found > most:
            raise FileError(f"The file {path} has {found:,} {what}, more than {most:,}: thin it out.")


def csv_text(columns: Mapping[str, object], shown: Callable[[float], str] = "{:.12g}".format) -> str:
    """Columns of one length as text, a row a line; NaN is an empty cell, and there are no minus zeros."""
    arrays = [np.asarray(values) for values in columns.values()]
    lists = [(values if values.dtype.kind in "iu" else values + 0.0).tolist() for values in arrays]
    rows = (",".join(["" if x != x else shown(x) for x in row]) for row in zip(*lists, strict=True))
    return "\n".join([",".join(columns), *rows]) + "\n"


def _require_names(where: str, names: list[str]) -> None:
    if all(_is_number(name) for name in names):
        raise FileError(f"{where}: the first line must name the columns, such as time_s,depth_m, but holds numbers.")
    for place, name in enumerate(names):
        if not name:
            raise FileError(f"{where}: column {place + 1} has no name.")
        if name in names[:place]:
            raise FileError(f"{where}: column `{name}` is there twice.")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
