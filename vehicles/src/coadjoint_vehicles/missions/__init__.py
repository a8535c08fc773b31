"""Missions: a vehicle, its water, its controller and its way points as TOML, flown to a folder of results."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.missions.mission import Mission as Mission
    from coadjoint_vehicles.missions.mission import load_mission as load_mission

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
