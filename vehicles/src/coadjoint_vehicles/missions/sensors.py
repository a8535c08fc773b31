"""The section [sensors] of a mission: which sensors are read, from which seed, over which bottom."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from coadjoint import checks
from coadjoint.checks import whole
from coadjoint.errors import ArgumentError, CoadjointError
from coadjoint.labelled import of_run
from coadjoint.sections import key
from coadjoint.texts import Table
from coadjoint.units import LENGTH
from coadjoint_vehicles.missions.lost_sensors import LostSensor, without_lost

if TYPE_CHECKING:
    from pathlib import Path

    from coadjoint.labelled import AnyDataset
    from coadjoint.simulation import Run
    from coadjoint_vehicles.model.vehicle import Vehicle
    from coadjoint_vehicles.water.bottom import Bottom


def _depth(value: float, name: str) -> float:
    if not (np.isfinite(value) and value >= 0):
        raise ArgumentError(f"{name} must be a depth of at least 0 m, positive down, but is {value:g} m.")
    return value


@dataclass(frozen=True)
class SensorsSection:
    """Which sensors of the vehicle are read."""

    names: list[str] | None = key("the sensors, in this order; all of them unless given", default=None)
    seed: int = key("seed of their errors", check=partial(whole, least=0), default=0)
    bottom: float | None = key("depth of a level bottom", LENGTH, check=_depth, default=None)

    def __post_init__(self) -> None:
        if self.names is not None and len(set(self.names)) < len(self.names):
            raise ArgumentError("[sensors] names has a sensor twice: leave one out.")

    def of(self, vehicle: Vehicle) -> tuple[str, ...]:
        """The names of the sensors that are read; raises ArgumentError for those that a vehicle does not have."""
        known = [one.name for one in vehicle.sensors]
        if not known:
            raise ArgumentError(
                f"The vehicle {vehicle.name} has no sensors, which [sensors] could read: give its file sections "
                "[sensors.NAME]."
            )
        if self.names is not None and not self.names:
            raise ArgumentError(f'[sensors] names must be a list such as ["{known[0]}"], but is [].')
        for name in self.names or ():
            checks.known(name, known, "sensor", f"The vehicle {vehicle.name}")
        return tuple(self.names or known)

    def require(self, vehicle: Vehicle, bottom: float | Bottom | None) -> None:
        """Raise ArgumentError for sensors that a vehicle does not have, and where one needs a bottom."""
        names = self.of(vehicle)
        over = [one for one in vehicle.sensors if "bottom" in one.required and one.name in names]
        if over and bottom is None:
            raise ArgumentError(
                f"The {over[0].kind} {over[0].name} needs the depth of the bottom: give [sensors] bottom_m or "
                "[water.bottom], or leave it out of [sensors] names."
            )


def observe(
    section: SensorsSection,
    vehicle: Vehicle,
    bottom: float | Bottom | None,
    lost_sensors: Iterable[LostSensor],
    run: Run,
) -> None:
    """Add the readings of [sensors] to the dataset of a run.

    A reading that fails, or does not arrive, becomes a warning; the run is kept.
    """
    from coadjoint_vehicles.readings.of_run import readings

    names = section.of(vehicle)
    try:
        with warnings.catch_warnings():  # they belong to the run
            warnings.simplefilter("ignore", UserWarning)
            read = readings(run, seed=section.seed, sensors=names, bottom=bottom)
        run.warnings += read.warnings
        without_lost(lost_sensors, read, of_run(run)).add_to(of_run(run))
    except CoadjointError as error:
        run.warnings.append(f"What [sensors] asks for could not be read: {error}")


def logs(dataset: AnyDataset, folder: Path) -> None:
    """Write `sensor_NAME.csv` for each sensor of a dataset to a folder."""
    from coadjoint.disk import write_text
    from coadjoint_vehicles.readings.taken import read_sensors, sensor_text

    for name in read_sensors(dataset):
        write_text(folder / f"sensor_{name}.csv", sensor_text(dataset, name))


def counts(dataset: AnyDataset) -> Table:
    """The summary of each sensor: the number of readings that arrived, and that were attempted."""
    from coadjoint_vehicles.readings.taken import PREFIX, read_sensors

    found = {}
    for name in read_sensors(dataset):
        arrival = dataset[f"{PREFIX}{name}_arrival"]
        found[name] = {"readings": int(arrival.size), "tried": int(arrival.attrs["tried"])}
    return {"sensors": found} if found else {}
