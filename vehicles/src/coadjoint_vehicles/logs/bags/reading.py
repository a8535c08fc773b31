"""Bags of ROS as logs."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from coadjoint import checks
from coadjoint.checks import all_known
from coadjoint.clocks import Choices, Jumps, Unsorted, require_choices
from coadjoint.disk import reading
from coadjoint.errors import FileError, prefixed
from coadjoint.identification import Log
from coadjoint.identification.channels import VEHICLE
from coadjoint.units import unit_of
from coadjoint_vehicles.axes import Axes, space_axes
from coadjoint_vehicles.logs.bags import BAG_FORMATS, BagFormat
from coadjoint_vehicles.logs.bags.bag import Bag, TopicLog
from coadjoint_vehicles.logs.bags.converted import WaterAbove
from coadjoint_vehicles.logs.bags.declared import Declared, declared
from coadjoint_vehicles.logs.bags.merged import Actuation, Samples, merged
from coadjoint_vehicles.logs.bags.messages import Topic
from coadjoint_vehicles.logs.bags.mounting import mounting_of
from coadjoint_vehicles.logs.bags.sampled import driving, samples
from coadjoint_vehicles.logs.bags.sensor_messages import FOLDER
from coadjoint_vehicles.logs.bags.sensors import (
    ARDUPILOT,
    CURRENT,
    TYPES,
    CommandTopic,
    Number,
    SensorTopic,
    driven,
    strange_frame,
    usual,
    water,
)

OWN = "coadjoint"
"""The name of the metadata that bags of this library hold: the axes, the step and the units of commands."""


def read_bag(
    path: str | os.PathLike[str],
    *,
    axes: Axes | None = None,
    topics: Collection[str] | None = None,
    sensors: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    ignore: Collection[str] = (),
    partial: bool = False,
    jumps: Jumps = "refuse",
    unsorted: Unsorted = "refuse",
) -> Log:
    """The log that a robot recorded: the measurements of its sensors and its inputs.

    Of ROS an MCAP file, `.db3`, `.bag`, or a folder of rosbag2; of ArduPilot `.BIN`, whose messages are topics such as
    `ATT` and `IMU[0]`, and telemetry, `.tlog`, by pymavlink.

    Odometry, poses, twists, inertial units, pressures and fixes are known by their types; topics `…/command/NAME` of
    plain numbers are inputs; of ArduPilot the Kalman filter, the attitude and the gyroscopes.

    axes: of the messages, by default "ENU/FLU" as in ROS (REP 103), and "NED/FRD" of ArduPilot;
    bags that this library wrote state theirs.
    topics: take only these. sensors: a declaration of the meaning of fields of topics, a TOML file or its table
    (docs/logs.md); a declaration replaces the defaults of the types. ignore: columns to leave out.
    partial: read the complete part of a file that was not closed.
    jumps: where the clock goes back, or nothing was measured for more than an hour and 100 usual intervals, "refuse"
    raises, "split" begins a new stretch of the log. unsorted: messages that go back raise FileError, or "sort" sorts
    them. `log.notes` lists unusual findings, and the topic taken if several measure the same.
    Raises FileError for damaged files, topics that are not there, and two that measure the same.
    """
    file = Path(path)
    require_choices(jumps, unsorted)
    if axes is not None:
        space_axes(axes)
    native = _format(file).axes
    checks.expect(not isinstance(topics, str), topics, "topics", f"a list of topics, such as [{topics!r}]")
    wanted = declared(sensors, axes, native)
    chosen = set(topics) | wanted.topics if topics is not None else wanted.topics if sensors is not None else None
    bags = [_opened(part, chosen, partial) for part in _parts(file)]
    there: dict[str, tuple[str, int]] = {}
    for bag in bags:
        for name, (kind, count) in bag.topics().items():
            there[name] = kind, count + there.get(name, ("", 0))[1]
    all_known(chosen or (), there, "topic", str(file), FileError)
    own = bags[0].metadata.get(OWN, {})
    if told := own.get("axes"):
        if axes not in (None, told):
            raise FileError(f"The bag {file} says that its axes are {told}, not {axes}: leave out `axes`.")
        native = cast(Axes, told)
        space_axes(native)
        wanted = declared(sensors, axes, native)
    choices = Choices(jumps, unsorted)
    found, commands, notes = _taken(bags, wanted, chosen, axes or native, own, ignore, choices)
    if not found and chosen:
        taken = ", ".join(f"{name} ({there[name][0]}, {there[name][1]})" for name in sorted(chosen))
        raise FileError(
            f"{file} holds no message that measures a vehicle on the topics that are taken, {taken}: topics of "
            "another type are declared by `sensors`, and the others are "
            f"{', '.join(sorted(set(there) - chosen)) or 'none'}."
        )
    if not found:
        known = ", ".join(f"{name} ({kind}, {count})" for name, (kind, count) in sorted(there.items()))
        raise FileError(f"{file} holds no message that measures a vehicle; it holds {known or 'none'}.")
    notes = [*(note for bag in bags for note in bag.notes), *notes]
    return merged(str(file), found, commands, notes, _step(file, own), not own, jumps)


def _parts(file: Path) -> list[Path]:
    """The files of a bag: itself, or those of a folder in the order of the numbers in their names."""
    if not file.is_dir():
        if not file.is_file():
            raise FileError(f"There is no log {file}.")
        return [file]
    found = [part for part in file.iterdir() if part.suffix in (".mcap", ".db3")]
    if not found:
        packed = any(part.name.endswith((".mcap.zstd", ".db3.zstd")) for part in file.iterdir())
        remedy = ", but compressed files: unpack them by `zstd -d`" if packed else ""
        raise FileError(f"The folder {file} is not a bag of ROS 2: it holds no .mcap and no .db3{remedy}.")
    return sorted(found, key=lambda part: [int(n) if n.isdigit() else n for n in re.split(r"(\d+)", part.name)])


def _format(file: Path) -> BagFormat:
    return BAG_FORMATS.get(file.suffix.lower(), BAG_FORMATS[".mcap"])


def _opened(file: Path, chosen: Collection[str] | None, partial: bool) -> Bag | TopicLog:
    """The bag in one file, by the end of its name, with the messages that are wanted."""

    def wanted(topic: str, kind: str) -> bool:
        if chosen is not None:
            return topic in chosen
        return kind in TYPES or kind in ARDUPILOT or driven(topic, kind) is not None or (topic, kind) == CURRENT

    with reading(file, "log"):
        return _format(file).read(file, wanted, partial)


def _taken(
    bags: list[Bag | TopicLog],
    wanted: Declared,
    chosen: Collection[str] | None,
    axes: Axes,
    own: Mapping[str, str],
    ignore: Collection[str],
    choices: Choices,
) -> tuple[list[Samples], list[Actuation], list[str]]:
    """The measurements of sensors, the commands of actuators, and notes."""
    sensors: list[Samples] = []
    commands: list[Actuation] = []
    notes: list[str] = []
    for topic in _topics(bags):
        if not len(topic) or (chosen is not None and topic.name not in chosen):
            continue
        kind = topic.definition.name
        if (topic.name, kind) == CURRENT and own and "current" not in ignore:
            found, _ = samples(topic, water(axes), (), choices)
            named = {"north": "current_north", "east": "current_east", "depth": "current_down"}
            kept = {named[name]: values for name, values in found.columns.items() if named[name] not in ignore}
            sensors.append(replace(found, columns=kept, positions={}))
            continue
        sensor = _ours(topic, usual(topic.name, kind, axes, chosen is not None), own)
        own_sensors = [
            _filled(given, whole, sensor, topic) for given, whole in wanted.sensors if given.topic == topic.name
        ]
        own_commands = [given for given in wanted.commands if given.topic == topic.name]
        if not own_sensors and not own_commands:
            own_sensors = [sensor] if sensor else []
            command = _command(topic, own)
            own_commands = [command] if command else []
            notes += _bare(command, own)
        for one in own_sensors:
            if sensor and one.columns == sensor.columns:
                _require_frame(topic, one)
            found, told = samples(topic, one, ignore, choices)
            sensors.append(found)
            notes += [*told, *(_mounted(topic, one) if chosen is not None and one.columns else [])]
        for command in own_commands:
            if command.name not in ignore:
                drove, told = driving(topic, command, choices)
                commands.append(drove)
                notes += told
    return sensors, commands, notes


def _ours(topic: Topic, sensor: SensorTopic | None, own: Mapping[str, str]) -> SensorTopic | None:
    """A sensor of a bag of this library: after the motion itself, in the water and at the place given by the bag."""
    if sensor is None or not own:
        return sensor
    try:
        water = WaterAbove(
            float(own.get("surface_pressure_pa", WaterAbove().surface)),
            float(own.get("density_kg_m3", WaterAbove().density)),
        )
    except ValueError:
        water = WaterAbove(math.nan, math.nan)
    if not (math.isfinite(water.surface) and math.isfinite(water.density) and water.density > 0):
        raise FileError(f"{topic.where}: density and pressure in the metadata `{OWN}` must be numbers.")
    after = 10 if topic.name.startswith(FOLDER) else 0
    if after:
        sensor = replace(sensor, mounting=mounting_of(own, topic.name.removeprefix(FOLDER), topic.where))
    return replace(sensor, water=water, rank={name: sensor.rank.get(name, 1) + after for name in VEHICLE})


def _mounted(topic: Topic, sensor: SensorTopic) -> list[str]:
    """A note on a sensor that was asked for and does not sit at O along the axes of the body."""
    said = sensor.mounting.said()
    return [f"{topic.name} is of a sensor {said}: its numbers count from there."] if said else []


def _require_frame(topic: Topic, sensor: SensorTopic) -> None:
    """Raise FileError for messages whose frame is not the one that their type is read in."""
    what = strange_frame(topic.definition.name, topic.text("header.frame_id"), sensor.axes)
    if what:
        raise FileError(
            f"{topic.where}: {topic.name} holds {what}: declare its `columns` and `axes` in a [[sensor]] "
            "(`north_speed`, `east_speed` and `down_speed` are velocities in space), or leave it out by `topics`."
        )


def _bare(command: CommandTopic | None, own: Mapping[str, str]) -> list[str]:
    """A note on commands without a known unit."""
    if command is None or command.did or f"unit.{command.name}" in own:
        return []
    return [
        f"Nothing declares the unit of {command.topic}: its numbers count as SI (rad, rad/s, N); a [[command]] with "
        "`unit` declares another."
    ]


def _topics(bags: list[Bag | TopicLog]) -> list[Topic]:
    """The topics of all files of a bag, each with the messages of all of them."""
    found: dict[str, Topic] = {}
    for bag in bags:
        for name, (_, count) in bag.topics().items():
            if count:
                topic = bag.topic(name)
                before = found.get(name)
                if before is not None and before.definition != topic.definition:
                    raise FileError(f"{topic.where}: {name} has messages of another type than in {before.where}.")
                found[name] = topic if before is None else replace(before, blocks=before.blocks + topic.blocks)
    return list(found.values())


def _filled(given: SensorTopic, whole: bool, usual: SensorTopic | None, topic: Topic) -> SensorTopic:
    """A declared sensor, with the columns of its type if it declares none."""
    if usual is not None:
        given = replace(given, mounting=given.mounting.completed(usual.mounting))
    if whole:
        return given
    if usual is None:
        raise FileError(
            f"{topic.where}: what {topic.name} ({topic.definition.name}) measures is not known: declare its `columns`, "
            'as in { u_m_s = "velocity.x" }.'
        )
    return replace(given, columns=usual.columns, unless=usual.unless)


def _step(file: Path, own: Mapping[str, str]) -> float | None:
    """The step of the simulation that wrote a bag; raises FileError unless it is a positive number."""
    if "dt_s" not in own:
        return None
    with suppress(ValueError):
        if math.isfinite(step := float(own["dt_s"])) and step > 0:
            return step
    raise FileError(f"{file}: dt_s in the metadata `{OWN}` must be a positive number, but is {own['dt_s']!r:.40}.")


def _unit(topic: Topic, own: Mapping[str, str], name: str) -> str:
    """The unit of a command, from the metadata; raises FileError for an unknown one."""
    unit = own.get(f"unit.{name}", "1") or "1"
    with prefixed(str(topic.where)):
        unit_of(unit, f"The unit of {topic.name}")
    return unit


def _command(topic: Topic, own: Mapping[str, str]) -> CommandTopic | None:
    """The command of a topic `…/command/NAME`, and the actual value of `…/actuator/NAME`."""
    kind = topic.definition.name
    found = driven(topic.name, kind)
    if found is None:
        return None
    name, did = found
    count = topic.count("data") if kind.endswith("Array") else None
    paths = ["data"] if count is None else [f"data[{i}]" for i in range(count)]
    return CommandTopic(topic.name, name, tuple(map(Number, paths)), _unit(topic, own, name), did=did)
