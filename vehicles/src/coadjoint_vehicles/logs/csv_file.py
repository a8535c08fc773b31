"""Tables of numbers over time in CSV files."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from coadjoint.clocks import Unsorted, clock
from coadjoint.csv_tables import read_sheet
from coadjoint.errors import FileError
from coadjoint_vehicles.logs.headers import loose

TIME = "time"


@dataclass(frozen=True)
class CsvFile:
    """The columns of a CSV file in SI units and rad, by their names without the unit."""

    path: str
    time: np.ndarray
    columns: dict[str, np.ndarray]


def read_csv(path: str | os.PathLike[str], unsorted: Unsorted = "refuse") -> CsvFile:
    """The table in a CSV file: a line of column names that end in their units, `time_s` among them, then numbers.

    unsorted: whether rows that are out of order are sorted. Raises FileError with file, line and column for a value
    that is not a number, is missing, or is duplicated, and for times that do not increase or are not in seconds.
    """
    sheet = read_sheet(path)
    known = [loose(name) for name in sheet.names]
    columns: dict[str, np.ndarray] = {}
    for place, found in enumerate(known):
        if found.name in columns:
            before = next(other.header for other in known if other.name == found.name)
            raise FileError(
                f"{path}, line {sheet.line}: `{found.name}` comes twice, as `{before}` and `{found.header}`."
            )
        columns[found.name] = sheet.numbers(place) * found.factor
    at = next((place for place, found in enumerate(known) if found.name == TIME and found.unit == "s"), None)
    if at is None:
        raise FileError(
            f"{path}, line {sheet.line}: there must be a column `time_s`, but there are {', '.join(sheet.names)}."
        )
    time = columns.pop(TIME)
    where = f"column `{sheet.names[at]}`"
    # Set points may well be an hour apart: they are held, and no sensor was read in between.
    read = clock(time, lambda row: f"{path}, line {sheet.lines[row]}, {where}", None, unsorted)
    return CsvFile(str(path), read.time, {name: values[read.order] for name, values in columns.items()})
