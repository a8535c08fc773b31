"""Sensors that fail, tables [faults.NAME] with `sensor`: no readings from a time, or a depth, on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.checks import number, unknown
from coadjoint.errors import ArgumentError
from coadjoint.sections import key, read
from coadjoint.units import LENGTH, TIME
from coadjoint_vehicles.missions.faults import require_one_begin
from coadjoint_vehicles.model.vehicle import Vehicle

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset
    from coadjoint_vehicles.readings.taken import Readings


@dataclass(frozen=True)
class LostSensor:
    """A sensor without readings from `time`, s, or from the first node at `depth`, m, on, up to `until`, s."""

    name: str
    sensor: str = key("the sensor")
    lost: Any = key("true: it gives no readings", default=None)
    time: float | None = key("when it begins", TIME, check=number, default=None)
    depth: float | None = key("depth at which it begins", LENGTH, check=number, default=None)
    until: float = key("when it ends", TIME, check=number, default=np.inf)

    def __post_init__(self) -> None:
        title = f"faults.{self.name}"
        if self.lost is not True:
            raise ArgumentError(f"[{title}] of a sensor needs lost = true, but has {self.lost!r}.")
        require_one_begin(self, title)
        if self.time is not None and self.until <= self.time:
            raise ArgumentError(f"[{title}] ends at {self.until:g} s, before it begins at {self.time:g} s.")

    def require_sensor(self, vehicle: Vehicle) -> None:
        """Raise ArgumentError unless a vehicle has the sensor."""
        known = [one.name for one in vehicle.sensors]
        if self.sensor not in known:
            what = f"[faults.{self.name}] sensor: the vehicle"
            said = unknown(f"sensor {self.sensor!r}", what, self.sensor, known)
            raise ArgumentError(said if known else f"{what} has no sensors.")

    def begin(self, dataset: AnyDataset) -> float:
        """When it fails in a run, s; infinity where it does not."""
        if self.time is not None:
            return self.time
        deep = np.flatnonzero(np.asarray(dataset["q"].values)[:, 2] >= self.depth)
        return float(dataset["time"].values[deep[0]]) if len(deep) else np.inf

    def sentence(self, dataset: AnyDataset) -> str:
        """From when on it was there, for the certificate."""
        begin = self.begin(dataset)
        if not begin <= float(dataset["time"].values[-1]):
            return f"The fault `{self.name}` of the sensor {self.sensor} did not come."
        end = f" to {self.until:.6g} s" if np.isfinite(self.until) else " on"
        return f"From t = {begin:.6g} s{end}, fault `{self.name}`: the sensor {self.sensor} reads nothing."


def is_of_sensor(table: object) -> bool:
    """Whether a table of [faults] is of a sensor."""
    return isinstance(table, dict) and "sensor" in table


def read_lost_sensor(name: str, given: dict[str, object]) -> LostSensor:
    """The lost sensor of a table [faults.NAME]; raises ArgumentError."""
    return read(LostSensor, f"faults.{name}", given, name=name)


def without_lost(lost_sensors: Iterable[LostSensor], read: Readings, dataset: AnyDataset) -> Readings:
    """The readings of a run without those of failed sensors; readings taken before a failure still arrive."""
    from coadjoint_vehicles.readings.taken import Readings

    taken = dict(read.taken)
    for lost in lost_sensors:
        one = taken.get(lost.sensor)
        if one is not None:
            kept = (one.time < lost.begin(dataset)) | (one.time >= lost.until)
            rows = {key: getattr(one, key)[kept] for key in ("time", "arrival", "values", "exact", "number")}
            taken[lost.sensor] = replace(one, **rows)
    return Readings(taken, read.seed)
