"""Numbers from the columns of a CSV file whose names and units are fixed."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coadjoint.csv_tables import Sheet, read_sheet
from coadjoint.errors import FileError

UNITS = {"time": "s", "depth": "m", "north": "m/s", "east": "m/s", "down": "m/s", "density": "kg/m³"}
DOWN = "z points down, so that depths below the surface are positive"


class Columns(NamedTuple):
    """A file's numbers by column."""

    sheet: Sheet
    values: dict[str, np.ndarray]

    def refuse(self, row: int, column: str, why: str) -> FileError:
        """The error for a value."""
        return self.sheet.refuse(row, self.sheet.names.index(column), why)

    def require_growth(self, axes: Sequence[str]) -> None:
        """Raise FileError unless rows grow, by the first axis and then by the second, with depths below the surface."""
        if "depth" in axes and np.any(above := self.values["depth"] < 0):
            row = int(np.flatnonzero(above)[0])
            raise self.refuse(row, "depth", f"{self.values['depth'][row]:g} m is above the surface: {DOWN}.")
        places = list(zip(*(self.values[name] for name in axes), strict=True))
        for row in range(1, len(places)):
            before, here = places[row - 1], places[row]
            if here == before:
                line = self.sheet.lines[row - 1]
                raise self.refuse(row, axes[-1], f"{here[-1]:g} is there twice, in line {line}, too.")
            if here < before:
                column = next(name for name, a, b in zip(axes, before, here, strict=True) if b < a)
                order = "by time, then by depth" if len(axes) > 1 else f"by {axes[0]}"
                value, last = self.values[column][row], self.values[column][row - 1]
                raise self.refuse(row, column, f"{value:g} comes after {last:g}: sort the rows {order}.")


def read(path: str | os.PathLike[str], required: Sequence[str], optional: Sequence[str] = ()) -> Columns:
    """The numbers of a CSV file with these columns; raises FileError for others, and as `read_sheet`."""
    sheet = read_sheet(path)
    where, known = f"{path}, line {sheet.line}", (*required, *optional)
    wanted = f"the columns are {', '.join(required)}" + (f" and, optionally, {', '.join(optional)}" if optional else "")
    for column in sheet.names:
        bare = re.split(r"[^a-z]", column.lower(), maxsplit=1)[0]
        if column not in known and bare in known:
            raise FileError(f"{where}: column `{column}` must be called `{bare}` and be in {UNITS[bare]}; {wanted}.")
    for column in required:
        if column not in sheet.names:
            raise FileError(f"{where}: column `{column}` is missing; {wanted}.")
    for column in sheet.names:
        if column not in known:
            raise FileError(f"{where}: column `{column}` is not known; {wanted}.")
    return Columns(sheet, {column: sheet.numbers(place) for place, column in enumerate(sheet.names)})
