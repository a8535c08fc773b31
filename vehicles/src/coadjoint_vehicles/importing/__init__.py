"""Vehicles of other simulators: SDF of Gazebo, URDF and xacro of uuv_simulator, read into vehicle files."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.importing.importing import Imported as Imported
    from coadjoint_vehicles.importing.importing import import_vehicle as import_vehicle
    from coadjoint_vehicles.importing.report import Report as Report

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
