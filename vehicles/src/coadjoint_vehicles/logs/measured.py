"""Logs as CSV files: read with units and axes turned to those inside, and written."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection
from contextlib import suppress
from inspect import signature
from pathlib import Path

import numpy as np

from coadjoint.checks import all_known
from coadjoint.clocks import Jumps, Unsorted, clock, require_choices
from coadjoint.csv_tables import Sheet, csv_text, read_sheet
from coadjoint.disk import atomic_file, write_text
from coadjoint.errors import ArgumentError, FileError, prefixed, warn
from coadjoint.extending import Registry, import_string
from coadjoint.identification import Log
from coadjoint.texts import Table
from coadjoint_vehicles.axes import Axes, space_axes
from coadjoint_vehicles.logs.bags import BAG_FORMATS
from coadjoint_vehicles.logs.columns import written
from coadjoint_vehicles.logs.headers import NAMES, Column, column
from coadjoint_vehicles.logs.turned import turned

_EMPTY = ("", "nan", "none", "null", "na", "n/a", "-")
_COMPONENT = re.compile(r"^(.+?)(?:_(\d+)|\[(\d+)\])$")
_BRACKETS = re.compile(r"^(.+)\[(\d+)\]$")
_STEP = "# simulated with dt_s = "
_CURRENT = "current_"
_LEFT_OUT = ("set_", _CURRENT, "u_water", "v_water", "w_water")

LOG_FORMATS: Registry[str] = Registry("LOG_FORMATS")
"""Formats of packages above, by suffix: "module:function" of the path, with options by name, which returns a Log."""

IRREGULAR = 1.2
"""From which ratio of the longest to the median interval on a log counts as irregular."""

TABLES = (".csv", ".txt")
"""How names of tables end."""


def read_log(
    path: str | os.PathLike[str],
    *,
    axes: Axes | None = None,
    ignore: Collection[str] = (),
    jumps: Jumps = "refuse",
    unsorted: Unsorted = "refuse",
    **options: object,
) -> Log:
    """The log in a file: a table as CSV, or a robot's recording, such as a bag of ROS, by the suffix of its name.

    axes: of the log, "NED/FRD" or "ENU/FLU"; by default the first for a table, and the second of ROS for a bag.
    ignore: columns to leave out. jumps: the treatment of a clock that is set back, or leaves out more than an hour and
    100 usual intervals: "refuse" raises, "split" begins a new stretch of the log there, `log.breaks`. unsorted: the
    treatment of rows that are out of order: "refuse" raises, "sort" sorts them by their times. options: those of
    `co.vehicles.logs.read_bag`, for a robot's recording, or those of a format that another package adds.

    The headers of a table are names with units: `time_s, roll_deg, u_m_s, p_deg_s, rudder_rad, …`.
    Names: time; north, east, depth, or x, y, z in the `axes`; roll, pitch, heading (or yaw), Euler angles ZYX, or a
    quaternion qw, qx, qy, qz; u, v, w; p, q, r. `heading` is that of a compass in any axes, `yaw` that of the `axes`.
    Every other column is an input; name[1], name[2], … are one of several
    numbers. `command_rudder_deg` is the input `rudder`, rather than `rudder_deg`, which then is the actual value;
    `current_north`, `current_east` and `current_down` become `log.current`; `set_…` and `u_water`, … are left out.
    `[deg]` or `(deg)` at the end of a header count as `_deg`. Lines that begin with # and columns named in `ignore`,
    with their unit or without, are skipped. Attitude, velocity and rates are of body axes, turned from `axes`.
    Empty cells and nan are missing; a missing input keeps its last value. `log.notes` lists unusual findings.
    Warns of columns whose values contradict their names, `log.doubts`. Raises FileError naming file, line and column.
    """
    require_choices(jumps, unsorted)
    log = _read(path, axes, ignore, jumps, unsorted, options)
    for doubt in log.doubts:
        warn(f"{path}: {doubt}", stacklevel=2)
    return log


def _read(
    path: str | os.PathLike[str],
    axes: Axes | None,
    ignore: Collection[str],
    jumps: Jumps,
    unsorted: Unsorted,
    options: Table,
) -> Log:
    suffix = Path(path).suffix.lower()
    if suffix in LOG_FORMATS:
        return _added(
            Path(path), suffix, {"axes": axes, "ignore": ignore, "jumps": jumps, "unsorted": unsorted, **options}
        )
    if suffix in BAG_FORMATS or Path(path).is_dir():
        from coadjoint_vehicles.logs.bags.reading import read_bag

        return read_bag(path, axes=axes, ignore=ignore, jumps=jumps, unsorted=unsorted, **options)
    if suffix == ".nc":
        raise FileError(
            f"The file {path} is a dataset, not a log: of a run `co.load` reads it, whose `save` writes a log that "
            "ends in .mcap or .csv."
        )
    if suffix not in (*TABLES, ""):
        raise FileError(
            f"The file {path} has a name of no format that is known: name a table "
            f"{' or '.join(TABLES)}; others are {', '.join((*BAG_FORMATS, *LOG_FORMATS))}."
        )
    if options:
        raise ArgumentError(
            f"A table has no option `{next(iter(options))}`; it is of files that end in {', '.join(BAG_FORMATS)}."
        )
    return read_table(path, "NED/FRD" if axes is None else axes, ignore, jumps, unsorted)


def _added(path: Path, suffix: str, options: Table) -> Log:
    """The log by the reader of another package, which gets the options that differ from the defaults."""
    given = {name: value for name, value in options.items() if value not in (None, (), "refuse")}
    reader = import_string(LOG_FORMATS[suffix])
    if strange := [name for name in given if name not in signature(reader).parameters]:
        raise ArgumentError(f"The reader of {suffix} has no option `{strange[0]}`: leave it out.")
    if not path.is_file():
        raise FileError(f"There is no log {path}.")
    log = reader(path, **given)
    if not isinstance(log, Log):
        raise ArgumentError(f"The reader {LOG_FORMATS[suffix]} must return a Log, but returned {type(log).__name__}.")
    return log


def read_table(
    path: str | os.PathLike[str],
    axes: Axes,
    ignore: Collection[str],
    jumps: Jumps = "refuse",
    unsorted: Unsorted = "refuse",
) -> Log:
    """The log of a CSV file, as described in `read_log`; raises FileError naming file, line and column."""
    space_axes(axes)
    file = str(path)
    sheet = read_sheet(path)
    header_line, headers = sheet.line, sheet.names
    where = f"{file}, line {header_line}: column"
    known = [None if name in ignore else column(name, where) for name in headers]
    names = {made.name for made in known if made is not None}
    all_known([name for name in ignore if name not in names], headers, "column", str(file), FileError)
    found: dict[str, tuple[Column, np.ndarray]] = {}
    for place, made in enumerate(known):
        if made is None or made.name in ignore:
            continue
        if made.name in found:
            raise FileError(f"{file}, line {header_line}: `{made.name}` is given twice, as `{made.header}` too.")
        found[made.name] = made, sheet.numbers(place, _EMPTY) * made.factor
    if "time" not in found:
        raise FileError(f"{file}, line {header_line}: there is no column `time_s`; there is: {', '.join(headers)}.")
    made, time = found.pop("time")
    read = clock(time, _places(sheet, made, time), jumps, unsorted)
    time, lines = read.time, [sheet.lines[row] for row in read.order]
    found = {name: (column, values[read.order]) for name, (column, values) in found.items()}
    columns = turned(file, {name: values for name, (_, values) in found.items() if name in NAMES}, axes)
    driving, did = _driving(file, found)
    inputs, units, notes = _inputs(file, lines, driving)
    actual, *_ = _inputs(file, lines, did)
    notes = [*read.notes, *notes]
    notes += [
        f"{int(gaps)} of {len(time)} values of {name} are missing."
        for name, values in columns.items()
        if (gaps := np.isnan(values).sum())
    ]
    gaps = np.diff(time)
    if len(gaps) and gaps.max() > IRREGULAR * np.median(gaps):
        notes.append(f"Samples are irregular: {gaps.min():g} to {gaps.max():g} s apart.")
    with prefixed(str(file)):
        return Log(
            time,
            columns,
            inputs,
            units,
            tuple(notes),
            _step(path, sheet.comments),
            actual,
            breaks=read.breaks,
            current=_current(found),
        )


def write_log(log: Log, path: str | os.PathLike[str]) -> None:
    """The log as a file that `read_log` reads: CSV, angles in degrees, inputs as `command_…`, missing cells empty; or
    messages of ROS 2 in ENU/FLU where the name ends in `.mcap`. Raises ArgumentError for names that end otherwise."""
    from coadjoint_vehicles.logs.bags.mounting import require_at_origin

    end = Path(path).suffix.lower()
    if end not in (*TABLES, ".mcap"):
        raise ArgumentError(f"A log is written as .csv or .mcap, but the name of {path} ends otherwise.")
    if end == ".mcap":
        from coadjoint_vehicles.logs.bags.writing import log_bytes

        require_at_origin(log.positions, "A bag with /odometry")
        content = log_bytes(log)
        with atomic_file(path) as temporary:
            temporary.write_bytes(content)
        return
    require_at_origin(log.positions, "A table")
    columns = {"time_s": log.time}
    for prefix, part in (("", log.columns), ("", log.actual), ("command_", log.inputs)):
        for name, values in part.items():
            columns |= written(f"{prefix}{name}", values, log.units.get(name, "1"))
    for name, values in log.current.items():
        columns |= written(f"{_CURRENT}{name}", values, "m/s")
    text = csv_text(columns)
    write_text(path, text if log.step is None else f"{_STEP}{log.step:.12g}\n{text}")


def _step(path: str | os.PathLike[str], comments: list[str]) -> float | None:
    """The step stated in a log, None if there is none; raises FileError."""
    told = [line.removeprefix(_STEP) for line in comments if line.startswith(_STEP)]
    if not told:
        return None
    with suppress(ValueError):
        if np.isfinite(step := float(told[0])) and step > 0:
            return step
    raise FileError(f"{path}: the line `{_STEP}{told[0]}` must be a positive number, in s.")


def _places(sheet: Sheet, column: Column, time: np.ndarray) -> Callable[[int], str]:
    """Where rows are, by their lines; raises FileError for one without a time."""

    def place(row: int) -> str:
        return f"{sheet.path}, line {sheet.lines[row]}, column `{column.header}`"

    bad = np.flatnonzero(np.isnan(time))
    if len(bad):
        raise FileError(f"{place(int(bad[0]))}: the time is missing.")
    return place


_Found = dict[str, tuple[Column, np.ndarray]]


def _require_whole(file: str, found: _Found, prefix: str) -> None:
    """Raise FileError where one of several numbers, name[1], name[2], …, is missing among them."""
    groups: dict[str, list[int]] = {}
    for name in found:
        if match := _BRACKETS.match(name):
            groups.setdefault(match[1], []).append(int(match[2]))
    for name, there in groups.items():
        gaps = sorted(set(range(min(1, *there), max(there))) - set(there))
        if gaps:
            raise FileError(f"{file}: the column `{prefix}{name}[{gaps[0]}]` is missing among those of {name}.")


def _current(found: _Found) -> dict[str, np.ndarray]:
    """The given components of the water's velocity, m/s, by north, east and down."""
    names = {f"{_CURRENT}{name}": name for name in ("north", "east", "down")}
    return {names[key]: values for key, (made, values) in found.items() if key in names and made.unit == "m/s"}


def _driving(file: str, found: _Found) -> tuple[_Found, _Found]:
    """Inputs, which are the commands if there are any, otherwise the given columns; actual values of actuators.

    The actual value of an actuator in another unit than that of its command, newtons for microseconds, is left out.
    """
    rest = {name: pair for name, pair in found.items() if name not in NAMES and not name.startswith(_LEFT_OUT)}
    commands = {name.removeprefix("command_"): pair for name, pair in rest.items() if name.startswith("command_")}
    _require_whole(file, commands, "command_")
    plain = {name: pair for name, pair in rest.items() if not name.startswith("command_")}
    wholes = {match[1] for name in commands if (match := _BRACKETS.match(name))}
    uncommanded = {name: pair for name, pair in plain.items() if name not in commands}
    for name in uncommanded:
        if (match := _BRACKETS.match(name)) and match[1] in wholes:
            raise FileError(f"{file}: the column `command_{name}` is missing among the other commands of {match[1]}.")
    _require_whole(file, uncommanded, "")
    did = {name: pair for name, pair in plain.items() if name in commands and pair[0].unit == commands[name][0].unit}
    return commands | uncommanded, did


def _inputs(
    file: str, lines: list[int], found: dict[str, tuple[Column, np.ndarray]]
) -> tuple[dict[str, np.ndarray], dict[str, str], list[str]]:
    """The inputs of the vehicle, without gaps, their units, and notes: a missing value is the last one before it."""
    notes: list[str] = []
    filled: dict[str, np.ndarray] = {}
    for name, (made, values) in found.items():
        gaps = np.isnan(values)
        if gaps[0]:
            where = f"{file}, line {lines[0]}, column `{made.header}`"
            raise FileError(f"{where}: the first value of an input is missing.")
        last = np.maximum.accumulate(np.where(gaps, 0, np.arange(len(values))))
        filled[name] = values[last]
        if gaps.any():
            notes.append(f"{int(gaps.sum())} of {len(values)} values of {name} are missing and kept from before.")
    groups: dict[str, dict[int, str]] = {}
    for name in filled:
        match = _COMPONENT.match(name)
        if match:
            groups.setdefault(match[1], {})[int(match[2] or match[3])] = name
    inputs: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for name, values in filled.items():
        match = _COMPONENT.match(name)
        whole = groups.get(match[1], {}) if match else {}
        order = sorted(whole)
        if match and order == list(range(order[0], order[0] + len(order))) and order[0] in (0, 1):
            inputs[match[1]] = np.stack([filled[whole[i]] for i in order], axis=1)
            units[match[1]] = found[name][0].unit
        else:
            inputs[name], units[name] = values, found[name][0].unit
    return inputs, units, notes
