"""Declarations: which topic or field of a log is which quantity, as tables of TOML.

[[sensor]]
topic = "/dvl/data"
columns = { u_m_s = "velocity.x", v_m_s = "velocity.y", w_m_s = "velocity.z" }
axes = "NED/FRD"
offset_s = -0.12

[[command]]
topic = "/thrusters/input"
name = "thrusters"
fields = ["data[0]", "data[1]"]
unit = "N"
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError, FileError
from coadjoint.texts import read_table, told_text
from coadjoint.vehicles.axes import Axes, body_axes, space_axes
from coadjoint.vehicles.logs.bags.converted import MOST_NORTH, OTHERS, WaterAbove
from coadjoint.vehicles.logs.bags.mounting import Mounting, require_place
from coadjoint.vehicles.logs.bags.sensors import CommandTopic, Number, SensorTopic, Stamp
from coadjoint.vehicles.logs.headers import NAMES, column, inside

_SENSOR = (
    "topic", "columns", "axes", "stamp", "offset_s", "every_s", "surface_pressure", "density", "origin", "position_m",
    "euler_zyx_deg",
)  # fmt: skip
_COMMAND = ("topic", "name", "field", "fields", "unit", "stamp", "offset_s")


class Declared(NamedTuple):
    """What was declared; the columns of a sensor are None where they are those of its type."""

    sensors: tuple[tuple[SensorTopic, bool], ...] = ()
    commands: tuple[CommandTopic, ...] = ()

    @property
    def topics(self) -> set[str]:
        return {sensor.topic for sensor, _ in self.sensors} | {command.topic for command in self.commands}


def declared(given: str | os.PathLike[str] | Mapping[str, Any] | None, axes: Axes | None, usual: Axes) -> Declared:
    """The declaration in a TOML file or a table; `axes` are those of sensors that name none.

    Raises FileError for what is no such table, with the section and the key.
    """
    if given is None:
        return Declared()
    if isinstance(given, Mapping):
        table, where = dict(given), "The declaration of a log"
    else:
        where = f"{given}"
        table = read_table(told_text(Path(given), "declaration of a log"), given)
    _require_keys(table, ("axes", "sensor", "command"), where)
    axes = axes or _axes(table.get("axes", usual), where)
    sensors = [_sensor(row, f"{where}, [[sensor]] {i}", axes) for i, row in _rows(table, "sensor", where)]
    commands = [_command(row, f"{where}, [[command]] {i}") for i, row in _rows(table, "command", where)]
    if not sensors and not commands:
        raise FileError(f"{where} declares nothing: give [[sensor]] tables, each with a topic.")
    return Declared(tuple(sensors), tuple(commands))


def _rows(table: Mapping[str, Any], name: str, where: str) -> list[tuple[int, dict[str, Any]]]:
    rows = table.get(name, [])
    if not isinstance(rows, Sequence) or isinstance(rows, str) or not all(isinstance(row, Mapping) for row in rows):
        raise FileError(f"{where}: `{name}` must be tables, each under [[{name}]].")
    return [(i, dict(row)) for i, row in enumerate(rows, 1)]


def _sensor(row: dict[str, Any], where: str, axes: Axes) -> tuple[SensorTopic, bool]:
    """A sensor, and whether it declares its columns."""
    _require_keys(row, _SENSOR, where)
    columns: dict[str, Number] = {}
    given = row.get("columns", {})
    if not isinstance(given, Mapping):
        raise FileError(f'{where}: `columns` must be a table, as in {{ u_m_s = "velocity.x" }}.')
    for header, path in given.items():
        if header in OTHERS:
            name, factor = header, 1.0
        else:
            made = column(header, f"{where}, columns:")
            name, factor = made.name, made.factor
        if name == "time" or name not in {*NAMES, *OTHERS}:
            near = difflib.get_close_matches(name, [*NAMES, *OTHERS], 1, 0.0)[0]
            raise FileError(f"{where}: `{header}` is no quantity of a vehicle, the nearest is `{near}`.")
        if name in columns:
            raise FileError(f"{where}: `{name}` is given twice, as `{header}` too.")
        columns[name] = Number(_text(path, header, where), factor)
    turn = _axes(row.get("axes", axes), where)
    sensor = SensorTopic(
        _text(row.get("topic"), "topic", where),
        columns,
        turn,
        _stamp(row, where),
        _number(row, "offset_s", 0.0, where),
        _number(row, "every_s", 0.0, where, least=0.0),
        water=WaterAbove(
            _number(row, "surface_pressure", WaterAbove().surface, where, least=0.0),
            _number(row, "density", WaterAbove().density, where, least=1.0),
        ),
        origin=_origin(row, where),
        mounting=_mounting(row, turn, where),
    )
    return sensor, bool(columns)


def _mounting(row: Mapping[str, Any], axes: Axes, where: str) -> Mounting:
    """Where a sensor sits, from the axes of its section, FRD or FLU, to FRD."""
    given = {}
    for key in ("position_m", "euler_zyx_deg"):
        value = row.get(key, (0.0, 0.0, 0.0))
        if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 3:
            raise FileError(f"{where}: `{key}` must be three numbers, but is {value!r:.40}.")
        given[key] = np.array([_number({key: one}, key, 0.0, where) for one in value])
    signs = np.diag(body_axes(axes))
    require_place(given["position_m"], where)
    position, angles = signs * given["position_m"], signs[::-1] * np.radians(given["euler_zyx_deg"])
    found = zip(given, (position, angles), strict=True)
    return Mounting(*(tuple((value + 0.0).tolist()) if key in row else None for key, value in found))


def _command(row: dict[str, Any], where: str) -> CommandTopic:
    _require_keys(row, _COMMAND, where)
    if ("field" in row) == ("fields" in row):
        raise FileError(f'{where} needs `field` or `fields`, as in field = "data" or fields = ["data[0]", "data[1]"].')
    paths = row.get("fields", [row.get("field")])
    if not isinstance(paths, Sequence) or isinstance(paths, str) or not paths:
        raise FileError(f'{where}: `fields` must be a list of paths, as in ["data[0]", "data[1]"].')
    try:
        unit, factor = inside(_text(row.get("unit", "1"), "unit", where))
    except ArgumentError as error:
        raise FileError(f"{where}: {error}") from error
    numbers = tuple(Number(_text(path, "fields", where), factor) for path in paths)
    topic, name = _text(row.get("topic"), "topic", where), _text(row.get("name"), "name", where)
    return CommandTopic(topic, name, numbers, unit, _stamp(row, where), _number(row, "offset_s", 0.0, where))


def _require_keys(row: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    if unknown := [key for key in row if key not in known]:
        near = difflib.get_close_matches(str(unknown[0]), known, 1, 0.0)[0]
        raise FileError(f"{where} has no key `{unknown[0]}`, the nearest is `{near}`; it has {', '.join(known)}.")


def _text(value: Any, key: str, where: str) -> str:
    if not isinstance(value, str) or not value:
        what = "is missing" if value is None else f"is {value!r:.40}"
        raise FileError(f"{where}: `{key}` must be a text, but {what}.")
    return value


def _number(row: Mapping[str, Any], key: str, usual: float, where: str, least: float = -np.inf) -> float:
    value = row.get(key, usual)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value) or value < least:
        bound = f" of at least {least:g}" if least > -np.inf else ""
        raise FileError(f"{where}: `{key}` must be a number{bound}, but is {value!r:.40}.")
    if abs(value) > 1e9:
        raise FileError(f"{where}: `{key}` is {value:g}, which is too large.")
    return float(value)


def _axes(value: Any, where: str) -> Axes:
    try:
        space_axes(value)
    except ArgumentError as error:
        raise FileError(f"{where}: {error}") from error
    return cast(Axes, value)


def _stamp(row: Mapping[str, Any], where: str) -> Stamp | None:
    value = row.get("stamp")
    if value is not None:
        checks.choice(value, f"{where}: `stamp`", ("header", "log"), error=FileError)
    return value


def _origin(row: Mapping[str, Any], where: str) -> tuple[float, float] | None:
    if "origin" not in row:
        return None
    value = row["origin"]
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 2:
        raise FileError(f"{where}: `origin` must be [latitude, longitude] in degrees, but is {value!r:.40}.")
    pair = {"latitude": value[0], "longitude": value[1]}
    latitude, longitude = (_number(pair, key, 0.0, f"{where}, origin") for key in pair)
    if abs(latitude) > MOST_NORTH or abs(longitude) > 360:
        raise FileError(f"{where}: `origin` must be a latitude within 89° and a longitude, but is {value!r:.40}.")
    return latitude, longitude
