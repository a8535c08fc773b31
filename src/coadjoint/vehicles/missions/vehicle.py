"""The vehicle of a mission file."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coadjoint.vehicles.missions.file import MissionFile


def vehicle_of(file: MissionFile) -> tuple[Any, list[str]]:
    """The vehicle, and what is doubtful about one of the user's own."""
    from coadjoint.vehicles.files.registry import load_vehicle

    if not file.vehicle.file:
        return load_vehicle(file.vehicle.name), []
    path = file.located(file.vehicle.file)
    with warnings.catch_warnings():  # they are told with the run
        warnings.simplefilter("ignore", UserWarning)
        vehicle = load_vehicle(path)
    return vehicle, [f"{path.name}: {sentence}" for sentence in vehicle.warnings]
