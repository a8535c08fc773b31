"""Inputs of a run from a CSV file: set points or commands by time."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from coadjoint import checks
from coadjoint.clocks import Unsorted, clock
from coadjoint.csv_tables import read_sheet
from coadjoint.errors import ArgumentError, FileError
from coadjoint.mechanics import Held, Linear
from coadjoint.texts import Table
from coadjoint_vehicles.logs.headers import loose

MOST_ROWS = 100_000
"""The most rows of an input: they are looked up by bisection, and are constants in the code that is compiled."""
KINDS = {"held": Held, "linear": Linear}


def inputs_from_csv(
    path: str | os.PathLike[str],
    *,
    names: Sequence[str] | None = None,
    between: Literal["held", "linear"] = "held",
    every: float = 0.0,
    unsorted: Unsorted = "refuse",
) -> dict[str, object]:
    """The inputs in a CSV file, for `co.simulate(…, inputs=…)`: co.Held, or co.Linear, of each column over `time_s`.

    `names`: the inputs to take, such as ["depth", "heading"]; by default the columns `set_…` of a log, or else
    `command_…`, or else all. `depth` is in the column `set_depth_m`, `command_depth_m` or `depth_m`; columns
    `thrusters[1]_N`, `thrusters[2]_N`, … are one input. Units are those at the end of the name, and become SI and rad.
    `between`: the interpolation between two rows. Rows that repeat the one before are left out; `every` keeps one row
    in that many seconds of those that are left. unsorted: "sort" sorts rows that are out of order by their times.
    Raises FileError with line and column for a file that cannot be used, ArgumentError for names that it lacks and for
    an input of more than 100 000 rows.
    """
    checks.choice(between, "between", KINDS)
    checks.expect(isinstance(every, (int, float)) and every >= 0, every, "every", "a time in s, 0 or more")
    table = read_csv(path, unsorted)
    whole = _gathered(table)
    chosen = {name: _column(table, whole, name) for name in names} if names is not None else _default(whole)
    return {name: _signal(table, name, values, between, every) for name, values in chosen.items()}


def _gathered(table: CsvFile) -> dict[str, np.ndarray]:
    """The columns, those of the components of one thing put together."""
    found: Table = {}
    for name, values in table.columns.items():
        component = re.fullmatch(r"(.+)\[(\d+)\]", name)
        if component is None:
            found[name] = values
        else:
            found.setdefault(component[1], {})[int(component[2])] = values
    return {name: _stacked(table, name, part) if isinstance(part, dict) else part for name, part in found.items()}


def _stacked(table: CsvFile, name: str, parts: dict[int, np.ndarray]) -> np.ndarray:
    if sorted(parts) != list(range(1, len(parts) + 1)):
        raise ArgumentError(
            f"The components of `{name}` in {table.path} must be numbered from 1, but are {sorted(parts)}."
        )
    return np.stack([parts[i] for i in sorted(parts)], axis=-1)


def _default(whole: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    for prefix in ("set_", "command_"):
        found = {name.removeprefix(prefix): values for name, values in whole.items() if name.startswith(prefix)}
        if found:
            return found
    return whole


def _column(table: CsvFile, whole: dict[str, np.ndarray], name: str) -> np.ndarray:
    for column in (f"set_{name}", f"command_{name}", name):
        if column in whole:
            return whole[column]
    raise ArgumentError(f"The file {table.path} has no column of `{name}`: it has {', '.join(whole)}.")


def _signal(table: CsvFile, name: str, values: np.ndarray, between: str, every: float) -> Any:
    kept = _kept(table.time, values, between, every)
    if len(kept) > MOST_ROWS:
        raise ArgumentError(
            f"Input `{name}` of {table.path} has {len(kept)} rows, but at most {MOST_ROWS} can be used, because they "
            "become a part of the code that is compiled: keep fewer with every=1.0 (s), or run the table piece by "
            "piece, each run from the end of the one before."
        )
    return KINDS[between](table.time[kept], values[kept])


def _kept(time: np.ndarray, values: np.ndarray, between: str, every: float) -> np.ndarray:
    """The rows that say something new: held, a value other than before; linear, a slope other than before."""
    columns = values.reshape(len(values), -1)
    new = np.ones(len(values), dtype=bool)
    if between == "held":
        new[1:] = np.any(columns[1:] != columns[:-1], axis=1)
    elif len(values) > 2:
        slopes = np.diff(columns, axis=0) / np.diff(time)[:, None]
        scale = np.max(np.abs(columns), axis=0, initial=0.0) / (time[-1] - time[0])
        new[1:-1] = np.any(np.abs(np.diff(slopes, axis=0)) > 1e-9 * scale + 1e-300, axis=1)
    rows = np.flatnonzero(new)
    if every > 0:
        bins = np.floor((time[rows] - time[0]) / every)
        rows = rows[np.unique(bins, return_index=True)[1]]
    return rows


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
