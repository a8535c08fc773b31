"""Tables of numbers over time as CSV: written whole or not at all, read with the place of every mistake."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from coadjoint.errors import FileError
from coadjoint.vehicles.logs.columns import split

TIME = "time"


@dataclass(frozen=True)
class Table:
    """The columns of a CSV file in SI units and rad, by their names without the unit; `units` are those of SI."""

    path: Path
    time: np.ndarray
    columns: dict[str, np.ndarray]
    units: dict[str, str]

    @property
    def axes(self) -> str:
        """The axes of a log: ENU/FLU where it has a column `up`, else NED/FRD."""
        return "ENU/FLU" if "up" in self.columns else "NED/FRD"


def csv_text(columns: Mapping[str, np.ndarray]) -> str:
    """Columns of one length as CSV, with twelve digits."""
    rows = (np.column_stack(list(columns.values())) + 0.0).tolist()  # no minus zeros
    lines = [",".join(columns), *(",".join([f"{number:.12g}" for number in row]) for row in rows)]
    return "\n".join(lines) + "\n"


def read_csv(path: str | os.PathLike[str]) -> Table:
    """The table in a CSV file: a line of column names that end in their units, `time_s` among them, then numbers.

    Lines that are empty or begin with # are left out. Raises FileError with file, line and column for what is no
    number, is missing, or comes twice, and for times that do not grow.
    """
    source = Path(path)
    lines = [(n, row) for n, row in _rows(source) if row and not row[0].lstrip().startswith("#")]
    if not lines:
        raise FileError(f"The file {source} is empty: its first line must name the columns, such as time_s,depth_m.")
    number, header = lines[0][0], [name.strip() for name in lines[0][1]]
    names, units, factors = _header(source, number, header)
    if len(lines) == 1:
        raise FileError(f"The file {source} has column names, but no rows of numbers.")
    values = np.array([_numbers(source, n, row, header) for n, row in lines[1:]]) * factors
    at = names.index(TIME)
    time = values[:, at]
    for before, after in zip(range(len(time)), range(1, len(time)), strict=False):
        if time[after] <= time[before]:
            raise FileError(
                f"{source}, line {lines[after + 1][0]}, column `{header[at]}`: times must grow, but "
                f"{time[after]:g} s comes after {time[before]:g} s."
            )
    held = {name: values[:, i] for i, name in enumerate(names) if name != TIME}
    return Table(source, time, held, {name: units[i] for i, name in enumerate(names) if name != TIME})


def _rows(source: Path) -> list[tuple[int, list[str]]]:
    try:
        with open(source, encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            return [(reader.line_num, row) for row in reader]
    except FileNotFoundError as error:
        raise FileError(f"There is no file {source}.") from error
    except UnicodeDecodeError as error:
        raise FileError(f"The file {source} is not a text in UTF-8.") from error
    except csv.Error as error:
        raise FileError(f"The file {source} is not a table of comma-separated values: {error}.") from error
    except OSError as error:
        raise FileError(f"The file {source} cannot be read: {error.strerror or error}.") from error


def _header(source: Path, number: int, header: list[str]) -> tuple[list[str], list[str], np.ndarray]:
    where = f"{source}, line {number}"
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
        raise FileError(f"{where}: columns must be separated by commas, but are by semicolons or tabs.")
    if all(_is_number(cell) for cell in header):
        raise FileError(f"{where}: the first line must name the columns, such as time_s,depth_m, but holds numbers.")
    parts = [split(column) for column in header]
    names = [name for name, _, _ in parts]
    for place, (column, name) in enumerate(zip(header, names, strict=True)):
        if not column:
            raise FileError(f"{where}: column {place + 1} has no name.")
        if name in names[:place]:
            raise FileError(f"{where}: `{name}` comes twice, as `{header[names.index(name)]}` and `{column}`.")
    if TIME not in names or parts[names.index(TIME)][1] != "s":
        raise FileError(f"{where}: there must be a column `time_s`, but there are {', '.join(header)}.")
    return names, [unit for _, unit, _ in parts], np.array([factor for _, _, factor in parts])


def _numbers(source: Path, line: int, row: list[str], header: list[str]) -> list[float]:
    if len(row) != len(header):
        raise FileError(
            f"{source}, line {line}: there must be {len(header)} numbers, one a column, but are {len(row)}."
        )
    found = []
    for column, cell in zip(header, row, strict=True):
        if not _is_number(cell):
            said = repr(cell.strip()) if cell.strip() else "nothing"
            raise FileError(f"{source}, line {line}, column `{column}`: there must be a number, but there is {said}.")
        found.append(float(cell))
    return found


def _is_number(cell: str) -> bool:
    try:
        return bool(np.isfinite(float(cell)))
    except ValueError:
        return False
