"""The electric side of a mission: current, voltage and energy of thrusters whose data sheets are known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from coadjoint.mechanics.members import Each
from coadjoint.spaces import Named
from coadjoint_vehicles.logs.records import VehicleRecords
from coadjoint_vehicles.parts.data_sheets import DataSheet, data_sheet
from coadjoint_vehicles.parts.published_curves import T200
from coadjoint_vehicles.parts.supplied_curve import Supplied
from coadjoint_vehicles.parts.thrusters import Thrusters

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset
    from coadjoint_vehicles.model.vehicle import Vehicle

SUPPLY = "electric_supply"
"""The attribute of a dataset with the data sheet and the battery of each part that has them, as JSON."""


def supply(vehicle: Vehicle, parameters: Named) -> dict[str, str]:
    """The attribute `SUPPLY` of a vehicle's missions; none without data sheets, or where batteries differ by member."""
    found: dict[str, dict[str, object]] = {}
    for part in vehicle.parts:
        if not isinstance(part, Thrusters):
            continue
        if part.curve is T200:
            found[part.name] = {"published": "T200", "voltage": 16.0, "resistance": 0.0}
        elif isinstance(part.curve, Supplied):
            own = getattr(parameters, part.name).curve.asdict()
            if not any(isinstance(value, Each) for value in own.values()):
                numbers = {name: float(value) for name, value in own.items()}
                found[part.name] = {"published": part.curve.published, "resistance": 0.0, **numbers}
    return {SUPPLY: json.dumps(found)} if found else {}


def electric_summary(dataset: AnyDataset) -> dict[str, dict[str, float]]:
    """What thrusters with a data sheet draw, by part, from the saved nodes.

    energy: out of the battery, ∫ V₀ I dt, J; energy_wh: the same, W h. charge_ah: ∫ I dt, A h. current_mean,
    current_max: of the thrusters of a part together, A. voltage_min: the lowest voltage under load, V.
    """
    if SUPPLY not in dataset.attrs:
        return {}
    log = VehicleRecords(dataset)
    return {
        name: _of_part(log.time, log.actuators[name].actual, given)
        for name, given in json.loads(dataset.attrs[SUPPLY]).items()
    }


def beyond_sheet(dataset: AnyDataset) -> list[str]:
    """A warning where a battery falls below the voltages of a data sheet; saved nodes of one run only."""
    if SUPPLY not in dataset.attrs or "member" in dataset.dims:
        return []
    log, found = VehicleRecords(dataset), []
    for name, given in json.loads(dataset.attrs[SUPPLY]).items():
        sheet = data_sheet(str(given["published"]))
        loaded = _loaded(sheet, log.actuators[name].actual, given)[0]
        if np.any(low := loaded < sheet.voltages[0]):
            found.append(
                f"The battery of `{name}` falls to {np.min(loaded):.3g} V under load, from t = "
                f"{log.time[np.argmax(low)]:.6g} s on below {sheet.voltages[0]:g} V, where the data sheet of "
                f"{sheet.name} begins: its thrust there is less than computed."
            )
    return found


def _loaded(sheet: DataSheet, commands: np.ndarray, given: Mapping[str, object]) -> tuple[np.ndarray, np.ndarray]:
    """The voltage under load, V, and the current of all thrusters together, A, at nodes."""
    voltage, resistance = float(str(given["voltage"])), float(str(given["resistance"]))
    rows = [sheet.supplied(row, voltage, resistance) for row in commands.reshape(len(commands), -1)]
    return np.array([row[0] for row in rows]), np.array([np.sum(row[1]) for row in rows])


def _of_part(time: np.ndarray, commands: np.ndarray, given: Mapping[str, object]) -> dict[str, float]:
    sheet = data_sheet(str(given["published"]))
    voltage = float(str(given["voltage"]))
    loaded, current = _loaded(sheet, commands, given)
    charge = float(np.sum(0.5 * np.diff(time) * (current[1:] + current[:-1])))
    energy = voltage * charge
    return {
        "energy": energy,
        "energy_wh": energy / 3600,
        "charge_ah": charge / 3600,
        "current_mean": charge / float(time[-1] - time[0]) if len(time) > 1 else float(current[0]),
        "current_max": float(np.max(current)),
        "voltage_min": float(np.min(loaded)),
    }
