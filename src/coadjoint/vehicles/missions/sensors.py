"""The section [sensors] of a mission: which sensors are read, from which seed, over which bottom."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.errors import ArgumentError, CoadjointError
from coadjoint.runs.units import in_si, unknown
from coadjoint.units import LENGTH
from coadjoint.vehicles.missions import legs
from coadjoint.vehicles.missions.lost_sensors import without_lost

if TYPE_CHECKING:
    from pathlib import Path

    from coadjoint.simulation.run import Run
    from coadjoint.vehicles.missions.file import MissionFile
    from coadjoint.vehicles.water.bottom import Bottom

KEYS = ("seed", "names", "bottom")
"""What [sensors] holds."""


@dataclass(frozen=True)
class SensorsSection:
    """names: of the sensors that are read, in this order. seed: of their errors. bottom: its depth, m, or a grid of
    depths, or None."""

    names: tuple[str, ...]
    seed: int
    bottom: float | Bottom | None


def sensors_section(file: MissionFile, vehicle: Any) -> SensorsSection | None:
    """What [sensors] says of a vehicle; None where the mission has no such section. Raises ArgumentError."""
    if not file.sensors:
        return None
    if file.run.members > 1:
        raise ArgumentError(
            "Section [sensors] reads a single vehicle, but [run] members are "
            f"{file.run.members}: leave one of them out."
        )
    given = in_si("sensors", file.sensors, KEYS, {"bottom": LENGTH})
    seed = given.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ArgumentError(f"[sensors] seed must be a whole number of at least 0, but is {seed!r}.")
    bottom = _bottom(file, given)
    names = _names(given, vehicle)
    over = [one for one in vehicle.sensors if "bottom" in one.required and one.name in names]
    if over and bottom is None:
        raise ArgumentError(
            f"The {over[0].kind} {over[0].name} needs the depth of the bottom: give [sensors] bottom_m or "
            "[water.bottom], or leave it out of [sensors] names."
        )
    return SensorsSection(names, seed, bottom)


def _bottom(file: MissionFile, given: dict[str, Any]) -> float | Bottom | None:
    """The depth of [sensors] bottom_m, else the grid of [water.bottom], else [mission] bottom_m."""
    from coadjoint.vehicles.missions import water

    if "bottom" not in given and file.water.get("bottom") is not None:
        return water.bottom(file)
    bottom = given.get("bottom", legs.bottom(file))
    if bottom is not None and (isinstance(bottom, bool) or not isinstance(bottom, (int, float))):
        raise ArgumentError(f"[sensors] bottom must be the depth of the bottom, one number, but is {bottom!r}.")
    if bottom is not None and not (np.isfinite(bottom) and bottom >= 0):
        raise ArgumentError(f"[sensors] bottom must be a depth of at least 0 m, positive down, but is {bottom!r} m.")
    return None if bottom is None else float(bottom)


def _names(given: dict[str, Any], vehicle: Any) -> tuple[str, ...]:
    known = [one.name for one in vehicle.sensors]
    if not known:
        raise ArgumentError(
            f"The vehicle {vehicle.name} has no sensors, which [sensors] could read: give its file sections "
            "[sensors.NAME]."
        )
    names = given.get("names", known)
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise ArgumentError(f'[sensors] names must be a list such as ["{known[0]}"], but is {names!r}.')
    for name in names:
        if name not in known:
            raise ArgumentError(unknown(f"sensor {name!r}", f"The vehicle {vehicle.name}", name, known))
    if len(set(names)) < len(names):
        raise ArgumentError("[sensors] names has a sensor twice: leave one out.")
    return tuple(names)


def observe(file: MissionFile, run: Run) -> None:
    """Put what the sensors of [sensors] read into the dataset of a run; nothing where a step failed.

    What cannot be read, or does not arrive, becomes a warning of the run, which is not lost.
    """
    from coadjoint.vehicles.missions.vehicle import vehicle_of
    from coadjoint.vehicles.readings.of_run import readings

    if not file.sensors or run.position.failed:
        return
    section = sensors_section(file, vehicle_of(file)[0])
    assert section is not None
    try:
        with warnings.catch_warnings():  # they are told with the run
            warnings.simplefilter("ignore", UserWarning)
            read = readings(run, seed=section.seed, sensors=section.names, bottom=section.bottom)
        run.warnings += read.warnings
        without_lost(file, read, run.dataset).add_to(run.dataset)
    except CoadjointError as error:
        run.warnings.append(f"What [sensors] asks for could not be read: {error}")


def logs(dataset: Any, folder: Path) -> None:
    """Write `sensor_NAME.csv` for each sensor of a dataset to a folder."""
    from coadjoint.disk import write_text
    from coadjoint.vehicles.readings.taken import read_sensors, sensor_text

    for name in read_sensors(dataset):
        write_text(folder / f"sensor_{name}.csv", sensor_text(dataset, name))


def counts(dataset: Any) -> dict[str, Any]:
    """What the summary says of each sensor: how many readings came, and of how many that were tried."""
    from coadjoint.vehicles.readings.taken import PREFIX, read_sensors

    found = {}
    for name in read_sensors(dataset):
        arrival = dataset[f"{PREFIX}{name}_arrival"]
        found[name] = {"readings": int(arrival.size), "tried": int(arrival.attrs["tried"])}
    return {"sensors": found} if found else {}
