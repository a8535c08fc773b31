"""Sensors that fail, tables [faults.NAME] with `sensor`: from a time, or a depth, on nothing more is read."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from coadjoint import units as u
from coadjoint.errors import ArgumentError
from coadjoint.runs.units import in_si, unknown

if TYPE_CHECKING:
    from coadjoint.vehicles.missions.file import MissionFile
    from coadjoint.vehicles.readings.taken import Readings

KEYS = ("sensor", "lost", "time", "depth", "until")
"""What such a table holds."""
MEASURED = {"time": u.TIME, "depth": u.LENGTH, "until": u.TIME}


class LostSensor(NamedTuple):
    """A sensor that reads nothing from `time`, s, or from the first node at `depth`, m, on, up to `until`, s."""

    name: str
    sensor: str
    time: float | None
    depth: float | None
    until: float

    def begin(self, dataset: Any) -> float:
        """When it fails in a run, s; infinity where it does not."""
        if self.time is not None:
            return self.time
        deep = np.flatnonzero(np.asarray(dataset.q.values)[:, 2] >= self.depth)
        return float(dataset.time.values[deep[0]]) if len(deep) else np.inf


def lost_sensors(file: MissionFile) -> list[LostSensor]:
    """The sensors that [faults] takes away; raises ArgumentError."""
    return [_lost(file, name, table) for name, table in file.faults.items() if is_of_sensor(table)]


def is_of_sensor(table: Any) -> bool:
    """Whether a table of [faults] is of a sensor."""
    return isinstance(table, dict) and "sensor" in table


def _lost(file: MissionFile, name: str, table: dict[str, Any]) -> LostSensor:
    title = f"faults.{name}"
    found = in_si(title, table, KEYS, MEASURED)
    from coadjoint.vehicles.missions.vehicle import vehicle_of

    known = [one.name for one in vehicle_of(file)[0].sensors]
    if found["sensor"] not in known:
        said = unknown(f"sensor {found['sensor']!r}", f"[{title}] sensor: the vehicle", str(found["sensor"]), known)
        raise ArgumentError(said if known else f"[{title}] sensor: the vehicle has no sensors.")
    if found.get("lost") is not True:
        raise ArgumentError(f"[{title}] of a sensor needs lost = true, but has {found.get('lost')!r}.")
    if not file.sensors:
        raise ArgumentError(f"[{title}] is of a sensor, but the mission reads none: give it a section [sensors].")
    if ("time" in found) == ("depth" in found):
        raise ArgumentError(f"[{title}] needs one of `time_s` and `depth_m`, from which on it is there.")
    for key in ("time", "depth", "until"):
        if key in found and (isinstance(found[key], bool) or not isinstance(found[key], (int, float))):
            raise ArgumentError(f"[{title}] {key} must be one number, but is {found[key]!r}.")
    until = float(found.get("until", np.inf))
    if "time" in found and until <= found["time"]:
        raise ArgumentError(f"[{title}] ends at {until:g} s, before it begins at {found['time']:g} s.")
    return LostSensor(name, str(found["sensor"]), found.get("time"), found.get("depth"), until)


def without_lost(file: MissionFile, read: Readings, dataset: Any) -> Readings:
    """The readings of a run without those of sensors while they fail; what was read before still arrives."""
    from coadjoint.vehicles.readings.taken import Readings

    taken = dict(read.taken)
    for lost in lost_sensors(file):
        one = taken.get(lost.sensor)
        if one is not None:
            kept = (one.time < lost.begin(dataset)) | (one.time >= lost.until)
            rows = {key: getattr(one, key)[kept] for key in ("time", "arrival", "values", "exact", "number")}
            taken[lost.sensor] = replace(one, **rows)
    return Readings(taken, read.seed)


def sentences(file: MissionFile, dataset: Any) -> list[str]:
    """A sentence on each for the card."""
    found = []
    for lost in lost_sensors(file):
        begin = lost.begin(dataset)
        if not begin <= float(dataset.time.values[-1]):
            found.append(f"The fault `{lost.name}` of the sensor {lost.sensor} did not come.")
        else:
            end = f" to {lost.until:.6g} s" if np.isfinite(lost.until) else " on"
            found.append(f"From t = {begin:.6g} s{end}, fault `{lost.name}`: the sensor {lost.sensor} reads nothing.")
    return found
