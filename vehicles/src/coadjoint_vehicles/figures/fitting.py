"""Which figures of vehicles a dataset has data for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint_vehicles.logs.records import VehicleRecords, is_vehicle

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset


def of_vehicle(dataset: AnyDataset) -> bool:
    """Whether it is a vehicle's, with directions of down and north."""
    return is_vehicle(dataset)


def of_actuators(dataset: AnyDataset) -> bool:
    """Whether it is a vehicle's that has actuators."""
    return is_vehicle(dataset) and bool(_log(dataset).actuators)


def of_current(dataset: AnyDataset) -> bool:
    """Whether it is a vehicle's in water that moves."""
    return is_vehicle(dataset) and _log(dataset).current is not None


def _log(dataset: AnyDataset) -> VehicleRecords:
    return VehicleRecords(dataset.isel(member=0) if "member" in dataset.dims else dataset)
