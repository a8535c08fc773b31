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

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, FileError, prefixed
from coadjoint.sections import key, read
from coadjoint.texts import file_text, read_table
from coadjoint.units import ANGLE, LENGTH, TIME
from coadjoint_vehicles.axes import Axes, body_axes, space_axes
from coadjoint_vehicles.logs.bags.converted import MOST_NORTH, OTHERS, WaterAbove
from coadjoint_vehicles.logs.bags.mounting import Mounting, require_place
from coadjoint_vehicles.logs.bags.sensors import CommandTopic, Number, SensorTopic, Stamp
from coadjoint_vehicles.logs.headers import NAMES, column, inside

T = TypeVar("T")
AXES = ("NED/FRD", "ENU/FLU")
LARGEST = 1e9
"""Numbers beyond it are mistakes."""
_number = partial(checks.number, least=-LARGEST, most=LARGEST)


def _three(value: object, name: str) -> np.ndarray:
    return np.array([_number(one, f"Each number of {name}") for one in _listed(value, name, 3, "three numbers")])


def _listed(value: object, name: str, count: int, words: str) -> list[object]:
    found: list[object] = checks.instance(value, name, list, words)
    checks.expect(len(found) == count, value, name, words)
    return found


def _columns(value: object, name: str) -> dict[str, Number]:
    """The number of each column, by the names of quantities."""
    found: dict[str, Number] = {}
    for header, path in checks.mapping(value, name, 'a table, as in { u_m_s = "velocity.x" }').items():
        quantity, factor = header, 1.0
        if header not in OTHERS:
            made = column(header, f"{name}:")
            quantity, factor = made.name, made.factor
        if quantity == "time" or quantity not in {*NAMES, *OTHERS}:
            near = checks.nearest(quantity, [*NAMES, *OTHERS], 0.0)
            raise ArgumentError(f"{name}: `{header}` is not a quantity of a vehicle, the nearest is `{near}`.")
        if quantity in found:
            raise ArgumentError(f"{name}: `{quantity}` is given twice, as `{header}` too.")
        found[quantity] = Number(checks.text(path, f"{name}: `{header}`"), factor)
    return found


def _origin(value: object, name: str) -> tuple[float, float]:
    north, east = _listed(value, name, 2, "[latitude, longitude] in degrees")
    latitude = checks.number(north, f"The latitude of {name}", -MOST_NORTH, MOST_NORTH)
    return latitude, checks.number(east, f"The longitude of {name}", -360.0, 360.0)


def _paths(value: object, name: str) -> tuple[str, ...]:
    if not value:
        raise ArgumentError(f'{name} must be a list of paths, as in ["data[0]", "data[1]"], but is empty.')
    return checks.texts(value, name, 'a list of paths, as in ["data[0]", "data[1]"]')


@dataclass(frozen=True)
class SensorSection:
    """A table [[sensor]]: which fields of a topic are which quantities."""

    topic: str = key("its topic", check=checks.text)
    columns: dict[str, Number] = key("which field each column is", check=_columns, factory=dict)
    axes: str = key("axes of its messages", words=("", *AXES), default="")
    stamp: str = key("which stamp counts as its time", words=("", "header", "log"), default="")
    offset: float = key("the offset that is added to its times", TIME, needs_unit=True, check=_number, default=0.0)
    every: float = key(
        "time between the samples that are kept", TIME, needs_unit=True, check=partial(_number, least=0.0), default=0.0
    )
    surface_pressure: float = key(
        "pressure at the surface, Pa", check=partial(_number, least=0.0), default=WaterAbove().surface
    )
    density: float = key("density of the water, kg/m³", check=partial(_number, least=1.0), default=WaterAbove().density)
    origin: Any = key("latitude and longitude from which north and east count", check=_origin, default=None)
    position: PyTree = key("its place on the body", LENGTH, needs_unit=True, check=_three, default=None)
    euler_zyx: Any = key(
        "yaw, pitch and roll of its axes on the body", ANGLE, needs_unit=True, check=_three, default=None
    )

    def sensor(self, usual: Axes, where: str) -> SensorTopic:
        """The topic of a sensor; usual: the axes of one that names none."""
        axes = cast(Axes, self.axes or usual)
        stamp = cast("Stamp | None", self.stamp or None)
        return SensorTopic(
            self.topic,
            self.columns,
            axes,
            stamp,
            self.offset,
            self.every,
            water=WaterAbove(self.surface_pressure, self.density),
            origin=self.origin,
            mounting=self._mounting(axes, where),
        )

    def _mounting(self, axes: Axes, where: str) -> Mounting:
        """Where it sits, from the axes of its section, FRD or FLU, to FRD."""
        signs = np.diag(body_axes(axes))
        if self.position is not None:
            require_place(self.position, where)
        turned = (self.position, signs), (self.euler_zyx, signs[::-1])
        return Mounting(*(None if value is None else tuple((sign * value + 0.0).tolist()) for value, sign in turned))


@dataclass(frozen=True)
class CommandSection:
    """A table [[command]]: which fields of a topic command an actuator."""

    topic: str = key("its topic", check=checks.text)
    name: str = key("name of the command", check=checks.text)
    field: str = key("path of its number", default="")
    fields: Any = key("paths of its numbers", check=_paths, default=None)
    unit: str = key("unit of its numbers", check=checks.text, default="1")
    stamp: str = key("which stamp counts as its time", words=("", "header", "log"), default="")
    offset: float = key("the offset that is added to its times", TIME, needs_unit=True, check=_number, default=0.0)

    def __post_init__(self) -> None:
        if bool(self.field) == (self.fields is not None):
            raise ArgumentError(
                'A command needs `field` or `fields`, as in field = "data" or fields = ["data[0]", "data[1]"].'
            )

    def command(self) -> CommandTopic:
        """The topic of a command."""
        unit, factor = inside(self.unit)
        numbers = tuple(Number(path, factor) for path in self.fields or (self.field,))
        return CommandTopic(self.topic, self.name, numbers, unit, cast("Stamp | None", self.stamp or None), self.offset)


class Declared(NamedTuple):
    """The declared topics; the columns of a sensor are None if they are those of its type."""

    sensors: tuple[tuple[SensorTopic, bool], ...] = ()
    commands: tuple[CommandTopic, ...] = ()

    @property
    def topics(self) -> set[str]:
        return {sensor.topic for sensor, _ in self.sensors} | {command.topic for command in self.commands}


def declared(given: str | os.PathLike[str] | Mapping[str, Any] | None, axes: Axes | None, usual: Axes) -> Declared:
    """The declaration in a TOML file or a table; `axes` are those of sensors that name none.

    Raises FileError, with the section and the key, for an invalid table.
    """
    if given is None:
        return Declared()
    if isinstance(given, Mapping):
        table, where = dict(given), "The declaration of a log"
    else:
        where = f"{given}"
        table = read_table(file_text(Path(given), "declaration of a log"), given)
    _require_keys(table, ("axes", "sensor", "command"), where)
    axes = axes or _axes(table.get("axes", usual), where)
    sensors = [(row.sensor(axes, where), bool(row.columns)) for row in _rows(SensorSection, "sensor", table, where)]
    with prefixed(where):  # of a unit
        commands = [row.command() for row in _rows(CommandSection, "command", table, where)]
    if not sensors and not commands:
        raise FileError(f"{where} declares nothing: give [[sensor]] tables, each with a topic.")
    return Declared(tuple(sensors), tuple(commands))


def _plain(value: object) -> PyTree:
    """Rows of Python's and of NumPy's as lists, which a TOML file has."""
    return np.asarray(value).tolist() if isinstance(value, (tuple, np.ndarray)) else value


def _rows(kind: type[T], name: str, table: Mapping[str, object], where: str) -> list[T]:
    """The tables of a name as sections; raises FileError."""
    rows = table.get(name, [])
    if not isinstance(rows, Sequence) or isinstance(rows, str) or not all(isinstance(row, Mapping) for row in rows):
        raise FileError(f"{where}: `{name}` must be tables, each under [[{name}]].")
    try:
        return [
            read(kind, f"{name} {i}", {one: _plain(value) for one, value in row.items()})
            for i, row in enumerate(rows, 1)
        ]
    except (ArgumentError, FileError) as error:
        raise FileError(f"{where}: {error}") from error


def _require_keys(row: Mapping[str, object], known: Sequence[str], where: str) -> None:
    checks.all_known(row, known, "key", where, FileError)


def _axes(value: Any, where: str) -> Axes:
    with prefixed(where):
        space_axes(value)
    return cast(Axes, value)
