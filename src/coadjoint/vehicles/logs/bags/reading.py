"""Bags of ROS as logs."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from coadjoint.errors import ArgumentError, FileError
from coadjoint.identification.log import Log
from coadjoint.units import unit_of
from coadjoint.vehicles.axes import Axes, space_axes
from coadjoint.vehicles.logs.bags.definitions import short
from coadjoint.vehicles.logs.bags.mcap_file import read_mcap
from coadjoint.vehicles.logs.bags.merged import Actuation, Samples, merged
from coadjoint.vehicles.logs.bags.messages import Topic
from coadjoint.vehicles.logs.bags.sampled import driving, samples
from coadjoint.vehicles.logs.bags.sensors import TYPES, CommandTopic, Number, driven, usual

OWN = "coadjoint"
"""The name of the metadata that bags of this library hold: the axes, the step and the units of commands."""


class Bag(Protocol):
    """What is read of a bag of any format."""

    metadata: dict[str, dict[str, str]]
    notes: list[str]

    def topics(self) -> dict[str, tuple[str, int]]: ...

    def topic(self, name: str) -> Topic: ...


def read_bag(
    path: str | os.PathLike[str],
    *,
    axes: Axes | None = None,
    topics: Collection[str] | None = None,
    ignore: Collection[str] = (),
    partial: bool = False,
) -> Log:
    """The log in an MCAP file of ROS: what its sensors measured and what drove the vehicle.

    Odometry, poses and twists, and inertial units are known by their types; topics `…/command/NAME` of plain
    numbers are inputs. axes: of the messages, by default "ENU/FLU" as in ROS (REP 103). topics: take these alone.
    ignore: columns to leave out. partial: of a file that was not closed take what is whole. `log.notes` tells which
    topic each column is from.
    Raises FileError for damaged files, topics that are not there, and two that measure the same.
    """
    file = Path(path)
    if axes is not None:
        space_axes(axes)
    if not file.is_file():
        raise FileError(f"There is no log {file}.")
    bag = read_mcap(file, lambda topic, kind: _wanted(topic, kind, topics), partial)
    there = bag.topics()
    own = bag.metadata.get(OWN, {})
    if missing := [name for name in topics or () if name not in there]:
        raise FileError(f"{file} has no topic {missing[0]}; it has {', '.join(sorted(there)) or 'none'}.")
    sensors: list[Samples] = []
    commands: list[Actuation] = []
    notes = list(bag.notes)
    for name, (kind, count) in there.items():
        if not count or not _wanted(name, short(kind), topics):
            continue
        topic = bag.topic(name)
        if sensor := usual(name, topic.definition.name, axes or "ENU/FLU"):
            found, told = samples(topic, sensor, ignore)
            sensors.append(found)
            notes += told
        elif (command := _command(topic, own)) and command.name not in ignore:
            drove, told = driving(topic, command)
            commands.append(drove)
            notes += told
    if not sensors:
        known = ", ".join(f"{name} ({kind}, {count})" for name, (kind, count) in sorted(there.items()))
        raise FileError(f"{file} holds no topic that measures a vehicle; it holds {known or 'none'}.")
    return merged(str(file), sensors, commands, notes, _step(file, own), telling=not own)


def _wanted(topic: str, kind: str, topics: Collection[str] | None) -> bool:
    return (kind in TYPES or driven(topic, kind) is not None) and (topics is None or topic in topics)


def _command(topic: Topic, own: Mapping[str, str]) -> CommandTopic | None:
    """The command of a topic `…/command/NAME`, and what an actuator did of `…/actuator/NAME`."""
    kind = topic.definition.name
    found = driven(topic.name, kind)
    if found is None:
        return None
    name, did = found
    count = topic.count("data") if kind.endswith("Array") else None
    paths = ["data"] if count is None else [f"data[{i}]" for i in range(count)]
    return CommandTopic(topic.name, name, tuple(map(Number, paths)), _unit(topic, own, name), did=did)


def _step(file: Path, own: Mapping[str, str]) -> float | None:
    """The step of the simulation that wrote a bag; raises FileError for what is no positive number."""
    if "dt_s" not in own:
        return None
    with suppress(ValueError):
        if math.isfinite(step := float(own["dt_s"])) and step > 0:
            return step
    raise FileError(f"{file}: dt_s in the metadata `{OWN}` must be a positive number, but is {own['dt_s']!r:.40}.")


def _unit(topic: Topic, own: Mapping[str, str], name: str) -> str:
    """The unit of a command, as the metadata tell; raises FileError for one that is not known."""
    unit = own.get(f"unit.{name}", "1") or "1"
    try:
        unit_of(unit, f"The unit of {topic.name}")
    except ArgumentError as error:
        raise FileError(f"{topic.where}: {error}") from error
    return unit
