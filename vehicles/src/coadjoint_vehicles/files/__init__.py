"""Vehicles as TOML: every number with its unit and its source; the shipped vehicles; the checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.files.file import read_vehicle as read_vehicle
    from coadjoint_vehicles.files.registry import load_vehicle as load_vehicle
    from coadjoint_vehicles.files.registry import vehicle_names as vehicle_names
    from coadjoint_vehicles.files.writing import vehicle_to_toml as vehicle_to_toml

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
