"""The readings of sensors as data: times, arrivals and values, as a labelled dataset and as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.csv_tables import csv_text
from coadjoint.errors import ArgumentError
from coadjoint.units import ending
from coadjoint_vehicles.sensors.sensor import Sensor

if TYPE_CHECKING:
    import xarray

    from coadjoint.labelled import AnyDataset

PREFIX = "sensor_"
"""The prefix of the variables of sensors in datasets."""


@dataclass(frozen=True, eq=False)
class SensorReading:
    """The readings of one sensor in a run: k readings of m numbers.

    sensor: whose. time: when each was taken, (k,) s. arrival: when it was there, (k,) s. values: with their errors,
    (k, m), in `sensor.units`. exact: the same without errors, (k, m). number: the place of each, (k,), among all that
    were tried from 0, of which `tried` is the count: those that are missing were dropped, or outside of the limits.
    """

    sensor: Sensor
    time: np.ndarray
    arrival: np.ndarray
    values: np.ndarray
    exact: np.ndarray
    number: np.ndarray
    tried: int

    def __len__(self) -> int:
        return len(self.time)

    def of(self, name: str) -> np.ndarray:
        """One of the numbers by its name, (k,), or all of a channel, (k, …); raises ArgumentError."""
        names, begin = self.sensor.names, 0
        if name in names:
            return self.values[:, names.index(name)]
        for channel in self.sensor.channels:
            if channel.name == name:
                return self.values[:, begin : begin + len(channel.components)]
            begin += len(channel.components)
        raise ArgumentError(f"The sensor `{self.sensor.name}` reads no `{name}`: it reads {', '.join(names)}.")

    @property
    def text(self) -> str:
        """The readings as CSV: time_s, arrival_s and a column for each number, angles in degrees."""
        return _text(self.time, self.arrival, self.sensor.names, self.sensor.units, self.values)


@dataclass(frozen=True, eq=False)
class Readings(Mapping[str, SensorReading]):
    """The readings of all sensors of a run by their names.

    taken: of each, in the order of the vehicle. seed: that of their errors. warnings: a sentence for each sensor whose
    latency is so long that nothing of it arrives within the run.
    """

    taken: Mapping[str, SensorReading]
    seed: int
    warnings: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> SensorReading:
        return self.taken[checks.known(name, self.taken, "sensor", "The run")]

    def __iter__(self) -> Iterator[str]:
        return iter(self.taken)

    def __len__(self) -> int:
        return len(self.taken)

    @property
    def dataset(self) -> xarray.Dataset:
        """A variable `sensor_NAME_CHANNEL` for each channel over `sensor_NAME_time`, with arrivals, units and rates."""
        import xarray

        made = xarray.Dataset(attrs={"sensors_seed": self.seed})
        self.add_to(made)
        return made

    def add_to(self, dataset: AnyDataset) -> None:
        """Add the variables of all sensors to a dataset, in place; raises ArgumentError unless it is a dataset."""
        checks.expect(hasattr(dataset, "coords"), dataset, "dataset", "that of a run, such as run.dataset")
        for name, read in self.taken.items():
            key, begin, sensor = PREFIX + name, 0, read.sensor
            dataset[f"{key}_time"] = (f"{key}_time", read.time, {"units": "s", "long_name": "time of a reading"})
            about = {"units": "s", "long_name": "when a reading was there", "tried": read.tried}
            dataset[f"{key}_arrival"] = (f"{key}_time", read.arrival, about)
            for channel in sensor.channels:
                count = len(channel.components)
                axis = f"{key}_{channel.name}_component"
                attrs: dict[str, PyTree] = {"units": channel.unit, "kind": sensor.kind, "rate": float(sensor.rate)}
                attrs |= {"latency": float(sensor.latency)}
                attrs |= {key: np.asarray(getattr(sensor, key), float) for key in ("position", "euler_zyx")}
                values = read.values[:, begin : begin + count]
                dataset[f"{key}_{channel.name}"] = ((f"{key}_time", axis), values, attrs)
                dataset[axis] = (axis, list(channel.components))
                begin += count
        dataset.attrs["sensors_seed"] = self.seed


def read_sensors(dataset: AnyDataset) -> list[str]:
    """The names of the sensors whose readings a dataset has."""
    ends = (PREFIX, "_arrival")
    found = [str(name) for name in dataset.data_vars if str(name).startswith(ends[0]) and str(name).endswith(ends[1])]
    return [name[len(ends[0]) : -len(ends[1])] for name in found]


def sensor_text(dataset: AnyDataset, name: str) -> str:
    """The readings of one sensor in a dataset as CSV: time_s, arrival_s and a column for each number."""
    key, names, units, parts = PREFIX + name, [], [], []
    arrival = dataset[f"{key}_arrival"]
    for channel in dataset.data_vars.values():
        if channel.dims[:1] == (f"{key}_time",) and channel.ndim == 2:
            names += [str(one) for one in dataset[channel.dims[1]].values]
            units += [channel.attrs["units"]] * channel.shape[1]
            parts.append(channel.values)
    return _text(dataset[f"{key}_time"].values, arrival.values, names, units, np.concatenate(parts, axis=1))


def _text(time: object, arrival: object, names: Sequence[str], units: Sequence[str], values: np.ndarray) -> str:
    columns = {"time_s": time, "arrival_s": arrival}
    for name, unit, column in zip(names, units, values.T, strict=True):
        turned = "rad" in unit
        unit = unit.replace("rad", "deg")
        columns[f"{name}{ending(unit) or '_' + _spelled(unit)}"] = np.degrees(column) if turned else column
    return csv_text(columns)


def _spelled(unit: str) -> str:
    """A unit as the end of a name: m/s² is m_s2."""
    return unit.replace("/", "_").replace("²", "2").replace("³", "3").replace(" ", "_")
