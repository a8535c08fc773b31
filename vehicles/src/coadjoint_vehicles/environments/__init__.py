"""Vehicles to learn from: Gymnasium environments, alone or thousands in parallel, with tasks, rewards and ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.environments.cross_current import CrossCurrent as CrossCurrent
    from coadjoint_vehicles.environments.dock import Dock as Dock
    from coadjoint_vehicles.environments.follow_path import FollowPath as FollowPath
    from coadjoint_vehicles.environments.hold_station import HoldStation as HoldStation
    from coadjoint_vehicles.environments.make import environment as environment
    from coadjoint_vehicles.environments.make import vector_environment as vector_environment
    from coadjoint_vehicles.environments.task import End as End
    from coadjoint_vehicles.environments.task import Task as Task
    from coadjoint_vehicles.environments.uncertainties import Uncertain as Uncertain

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
