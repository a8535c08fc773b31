"""A run of a vehicle as a log in CSV, for `run.save("log.csv")`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.csv_tables import csv_text
from coadjoint_vehicles.logs.columns import columns
from coadjoint_vehicles.logs.records import VehicleRecords

if TYPE_CHECKING:
    import xarray


def log_text(dataset: xarray.Dataset, axes: str = "NED/FRD") -> str:
    """Columns `time_s`, `north_m`, `east_m`, `depth_m`, …; with axes "ENU/FLU" of east, north, up.

    Raises ArgumentError for a run without a vehicle.
    """
    return csv_text(columns(VehicleRecords(dataset), axes))
